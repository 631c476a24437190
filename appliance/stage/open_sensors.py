"""Ears: which sensors of a show are let in, and where the box hears them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from appliance.sensor.foreign.door import foreign_key, open_door
from appliance.sensor.keys import KeyFileError, SensorKey, load_keys, unknown_sensor
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.transports.udp import PortError
from appliance.show.box import BoxConfig, out_of_reach
from appliance.stage.stage_error import StageError


def open_sensors(
    box: BoxConfig, sensors: Sequence[str], profiles: Mapping[bytes, bytes], folder: Path | None = None
) -> tuple[SensorLink, tuple[str, ...]]:
    """The link to a show's sensors, and why some are not let in. Raises StageError where a port is taken.

    profiles: the sensors' calibrations that the box has kept, by IMU. folder: where the box's processes meet;
    None: no foreign sensor is let in.
    """
    others = {one.name: one.from_ for one in box.sensors.foreign} if sensors else {}
    keys, complaints = _keys(box.sensors.keys, sensors, others)
    complaints += tuple(
        f"{box.sensors.keys}: {name} has a key, and the box file says `from: {others[name]}` of it. The "
        "wearable is not let in. Rename one of them."
        for name in others
        if name in keys
    )
    return _link(box, keys, sensors, profiles, others if folder is not None else {}, folder), complaints


def reach(sensors: Sequence[str], box: BoxConfig) -> list[str]:
    """A warning when keys are there, but no wearable can reach this box: neither by Wi-Fi nor by cable."""
    if not sensors or box.sensors.keys is None or box.sensors.serial:
        return []
    why = out_of_reach(box.sensors)
    return [why] if why else []


def _link(
    box: BoxConfig,
    keys: Mapping[str, SensorKey],
    sensors: Sequence[str],
    profiles: Mapping[bytes, bytes],
    others: Mapping[str, str],
    folder: Path | None,
) -> SensorLink:
    udp, foreign = box.sensors.udp, None
    try:
        if others and folder is not None:
            door, secret = open_door(folder)
            foreign = door, {name: foreign_key(name, source, secret) for name, source in others.items()}
        link = open_link(
            keys,
            (udp.host, udp.port) if udp is not None and sensors else None,
            [(line.device, line.baud) for line in box.sensors.serial],
            profiles,
            sensors,
            foreign,
            box.sensors.rate_hz,
        )
    except PortError as error:
        raise StageError(str(error)) from error
    except OSError as error:
        raise StageError(
            f"{folder}: the door of foreign sensors cannot be kept there ({error.strerror}). Nothing dances. "
            "Free memory there, or give another folder as `runtime:` in the box file."
        ) from error
    link.light = box.sensors.light
    return link


def _keys(
    path: Path | None, sensors: Sequence[str], others: Collection[str]
) -> tuple[dict[str, SensorKey], tuple[str, ...]]:
    """Keys of the box's wearables, and why those of the show that have none are not let in."""
    wearables = [name for name in sensors if name not in others]
    if not sensors or (path is None and not wearables):
        return {}, ()
    moves_freely = f"Not let in: {', '.join(wearables)}; the dancer moves freely there."
    if path is None:
        return {}, (
            f"No key file. {moves_freely} "
            "Set sensors.keys in the box file (bunraku provision makes it), or try it with --emulate.",
        )
    try:
        keys = load_keys(path)
    except KeyFileError as error:
        return {}, (f"{error}. {moves_freely} Mend the key file.",)
    except FileNotFoundError:
        cure = "Correct `keys` under sensors in the box file, or run: bunraku provision."
        return {}, (f"There is no key file {path}. {moves_freely} {cure}",)
    except OSError as error:
        reason = f"{path}: the key file cannot be read ({error.strerror})"
        return {}, (f"{reason}. {moves_freely} Let this user read it, or play as the user who provisioned.",)
    return keys, tuple(
        f"{path}: {unknown_sensor(name, keys)}. It is not let in, and the dancer moves freely there. "
        f"Provision it (bunraku provision --name {name}), or rename another one (bunraku sensors rename)."
        for name in wearables
        if name not in keys
    )
