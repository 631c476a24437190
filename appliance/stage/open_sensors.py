"""Ears: which sensors of a show are let in, and where the box hears them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from appliance.sensor.keys import KeyFileError, SensorKey, load_keys, unknown_sensor
from appliance.sensor.link import SensorLink, open_link
from appliance.sensor.transports.udp import PortError
from appliance.show.box import BoxConfig, out_of_reach
from appliance.stage.stage_error import StageError


def open_sensors(
    box: BoxConfig, sensors: Sequence[str], profiles: Mapping[bytes, bytes]
) -> tuple[SensorLink, tuple[str, ...]]:
    """The link to a show's sensors, and why some are not let in. Raises StageError where a port is taken.

    profiles: the sensors' calibrations that the box has kept, by IMU.
    """
    keys, complaints = _keys(box.sensors.keys, sensors)
    return _link(box, keys, sensors, profiles), complaints


def reach(sensors: Sequence[str], box: BoxConfig) -> list[str]:
    """A warning when keys are there, but no wearable can reach this box: neither by Wi-Fi nor by cable."""
    if not sensors or box.sensors.keys is None or box.sensors.serial:
        return []
    why = out_of_reach(box.sensors)
    return [why] if why else []


def _link(
    box: BoxConfig, keys: Mapping[str, SensorKey], sensors: Sequence[str], profiles: Mapping[bytes, bytes]
) -> SensorLink:
    udp = box.sensors.udp
    try:
        link = open_link(
            keys,
            (udp.host, udp.port) if udp is not None and sensors else None,
            [(line.device, line.baud) for line in box.sensors.serial],
            profiles,
            sensors,
        )
    except PortError as error:
        raise StageError(str(error)) from error
    link.light = box.sensors.light
    return link


def _keys(path: Path | None, sensors: Sequence[str]) -> tuple[dict[str, SensorKey], tuple[str, ...]]:
    """Keys of the box's sensors, and why those of the show that have none are not let in."""
    if not sensors:
        return {}, ()
    moves_freely = f"Not let in: {', '.join(sensors)}; the dancer moves freely there."
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
        for name in sensors
        if name not in keys
    )
