"""Provisioning: a wearable gets its name, network and a new key by cable, and an entry in the key file.

The order keeps both sides consistent whenever the cable comes loose: nothing is stored until the wearable has
proved that everything arrived; the key file changes last, after it is known to be writable.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from dataclasses import dataclass, field
from pathlib import Path

from appliance.pose.correctable_error import CorrectableError
from appliance.sensor import wire
from appliance.sensor.key_editing import KeyEditing, editing
from appliance.sensor.keys import SensorKey, fresh_key, name_fault
from appliance.sensor.provisioning.wearable_console import (
    ConsoleError,
    Identity,
    UnpluggedError,
    WearableConsole,
)

LONGEST_NETWORK = 32  # bytes, IEEE 802.11
SHORTEST_PASSWORD, LONGEST_PASSWORD = 8, 63  # WPA2
DEFAULT_PORT = 9750
_AGAIN = "Plug it in, switch it off and on, and run this again."


class ProvisioningError(CorrectableError):
    """The wearable is not provisioned: what happened, how both sides stand, what to do. Holds no secret."""


@dataclass(frozen=True)
class WearableSettings:
    """A wearable's new settings. Empty `network`: cable only. None: unchanged."""

    name: str
    network: str = ""
    password: str = field(default="", repr=False)
    port: int = DEFAULT_PORT
    fusion: str | None = None
    axes: tuple[int, int] | None = None  # as the BNO055 has them, registers 0x41 (map) and 0x42 (sign)
    crystal: bool | None = None  # a 32 kHz crystal is fitted beside the BNO055

    def __post_init__(self) -> None:
        fault = name_fault(self.name) or _network_fault(self.network, self.password) or _axes_fault(self.axes)
        if fault:
            raise ProvisioningError(f"{fault[0].upper()}{fault[1:]}. Nothing was changed.")


@dataclass(frozen=True)
class Provisioned:
    """The result. `was`: the wearable's earlier name in the key file, if another."""

    sensor: SensorKey
    identity: Identity
    replaced: bool
    was: str


def provision(
    console: WearableConsole,
    path: Path,
    settings: WearableSettings,
    say: Callable[[str, str], None],
    takes_over: bool = False,
    worn: Container[str] = (),
) -> Provisioned:
    """Provision the wearable on `console` and enter it into the key file `path`.

    `say` gets each completed step: its name and a sentence. `takes_over`: the name may belong to another
    wearable so far. `worn`: sensors of the show, which none leaves to take over another's place. Raises
    ProvisioningError, ConsoleError (nothing answers), KeyFileError and OSError; then the key file is as it
    was.
    """
    identity = console.identify()
    imu = f"IMU {identity.imu_id[:8]}" if identity.imu_id else "no IMU found"
    say(console.device, f"wearable {identity.firmware}, {imu}, board {identity.board}")
    _require_same_wire(identity)
    with editing(path) as change:
        shown = _shown(console)
        known = _known_as(shown, change)
        _require_free_name(settings.name, known, shown, change, takes_over)
        if takes_over:
            _require_not_worn(settings.name, known, worn)
        replaced = settings.name in change.keys
        sensor = _new_key(settings.name, change, takes_over)
        change.put(sensor)
        _draft(console, sensor, settings)
        say("settings", f"sent and proved: fresh key, device 0x{sensor.device_id:08x}, {_way(settings)}")
        change.prepare()  # a full disk fails here, before anything is stored
        _save(console, sensor, path)
        say("saved", "the wearable keeps them over power-off, and has the key")
        try:
            change.commit()
        except OSError as error:
            raise ProvisioningError(
                f"The wearable has its new key, but {path} could not be changed ({error.strerror}): the box "
                "does not let it in. Make the file writable and run this again."
            ) from None
    say(
        path.name,
        f"{settings.name} {'has its new key' if replaced else 'added'}; readable by its owner alone",
    )
    return Provisioned(sensor, identity, replaced, known if known != settings.name else "")


def _require_same_wire(identity: Identity) -> None:
    if identity.wire_hash != wire.WIRE_HASH:
        raise ProvisioningError(
            f"The wearable's firmware {identity.firmware} speaks wire {identity.wire_hash:08x}, this box "
            f"{wire.WIRE_HASH:08x}: the box would not let it in. Nothing was changed. "
            "Flash firmware/wearable of this version onto the board (docs/firmware.md), then run this again; "
            "or, where the firmware is the newer of the two, update the box."
        )


def _shown(console: WearableConsole) -> str:
    try:
        return console.ask("show")
    except ConsoleError as error:
        raise ProvisioningError(f"{error} Nothing was changed. {_AGAIN}") from None


def _known_as(shown: str, change: KeyEditing) -> str:
    """This wearable's name in the key file, by its device id; empty for an unknown one."""
    device = _word_after("device", shown)
    return next((name for name, key in change.keys.items() if f"{key.device_id:08x}" == device), "")


def _require_free_name(name: str, known: str, shown: str, change: KeyEditing, takes_over: bool) -> None:
    """Wearables must not be mixed up by mistake; one without settings may get any name."""
    if takes_over or name not in change.keys or known == name or _word_after("device", shown) == "none":
        return
    own = known or _word_after("name", shown)
    owner = f"is '{own}' already" if known else f"was provisioned elsewhere (as '{own}')"
    raise ProvisioningError(
        f"This wearable {owner}, and '{name}' is another one. Nothing was changed. To put this one in the "
        f"place of a broken {name}: bunraku sensors replace {name} "
        + (f"{own} (no cable needed)." if known else "--port, with the other options as now.")
    )


def _require_not_worn(name: str, known: str, worn: Container[str]) -> None:
    if known and known != name and known in worn:
        raise ProvisioningError(
            f"This wearable is {known}, a sensor of this show: as {name} it leaves its joint, and the dancer "
            "moves freely there. Nothing was changed. Take another wearable, or revoke "
            f"{known} first (bunraku sensors revoke {known} --anyway)."
        )


def _new_key(name: str, change: KeyEditing, takes_over: bool) -> SensorKey:
    """A fresh key. The same wearable keeps its device id, by which it is known if this breaks off."""
    new = fresh_key(name, change.keys.values())
    has_place = name in change.keys and not takes_over
    return SensorKey(name, change.keys[name].device_id if has_place else new.device_id, new.key)


def _draft(console: WearableConsole, sensor: SensorKey, settings: WearableSettings) -> None:
    """Everything to the wearable's draft, which counts for nothing until it is saved."""
    try:
        console.ask(f"set name {sensor.name}")
        console.ask(f"set device {sensor.device_id:08x}")
        console.ask("set key", secret=sensor.key.hex())
        console.ask(f"set network {settings.network}")
        console.ask("set password", secret=settings.password)
        console.ask(f"set port {settings.port}")
        if settings.fusion is not None:
            console.ask(f"set fusion {settings.fusion}")
        if settings.crystal is not None:
            console.ask(f"set crystal {'yes' if settings.crystal else 'no'}")
        if settings.axes is not None:
            console.ask("set axes {:02x} {:02x}".format(*settings.axes))
        has_arrived = console.proves(sensor.key)
    except UnpluggedError as error:
        raise ProvisioningError(
            f"{error} Nothing was changed, neither in the wearable nor in the key file. {_AGAIN}"
        ) from None
    except ConsoleError as error:
        raise ProvisioningError(
            f"{error} Nothing was changed, neither in the wearable nor in the key file."
        ) from None
    if not has_arrived:
        raise ProvisioningError(
            "The wearable could not prove that the key arrived whole. Nothing was changed. "
            "Run this again with another cable; if that fails, flash the firmware again."
        )


def _save(console: WearableConsole, sensor: SensorKey, path: Path) -> None:
    unsure = (
        f"{path} was not changed, so the box does not let it in if it has its new key. "
        f"{_AGAIN} That mends it."
    )
    try:
        console.ask("save")
    except UnpluggedError as error:
        raise ProvisioningError(f"{error} It may or may not have its new key. {unsure}") from None
    except ConsoleError as error:
        raise ProvisioningError(
            f"{error} Its settings are not stored, and the key file is as it was."
        ) from None
    try:
        has_kept = console.proves(sensor.key)
    except ConsoleError as error:
        raise ProvisioningError(f"{error} It has its new key, but could not prove it. {unsure}") from None
    if not has_kept:
        raise ProvisioningError(f"The wearable lost its key while it was saved. {unsure}")


def _way(settings: WearableSettings) -> str:
    return f"network '{settings.network}', port {settings.port}" if settings.network else "by cable alone"


def _word_after(word: str, line: str) -> str:
    words = line.split()  # in pairs: the value of one may be the word of another
    return next((words[at + 1] for at in range(0, len(words) - 1, 2) if words[at] == word), "")


def _network_fault(network: str, password: str) -> str | None:
    if any(ord(sign) < 32 for sign in network + password):
        return "network and password cannot hold control characters"
    if len(network.encode()) > LONGEST_NETWORK or network != network.strip():
        return f"a network's name has at most {LONGEST_NETWORK} bytes and no space at its ends"
    if not network and password:
        return "a password needs a network: give --network"
    if password and not SHORTEST_PASSWORD <= len(password.encode()) <= LONGEST_PASSWORD:
        return (
            f"a Wi-Fi password has {SHORTEST_PASSWORD} to {LONGEST_PASSWORD} characters; "
            "none at all stands for an open network"
        )
    return None


def _axes_fault(axes: tuple[int, int] | None) -> str | None:
    """BNO055 datasheet, AXIS_MAP_CONFIG: two bits an axis, each axis once; AXIS_MAP_SIGN: three bits."""
    if axes is None:
        return None
    directions = {axes[0] & 3, axes[0] >> 2 & 3, axes[0] >> 4 & 3}
    if directions != {0, 1, 2} or not 0 <= axes[0] < 64 or not 0 <= axes[1] < 8:
        return (
            "these are no axes: MAP names each of x, y, z once (24: as printed on the chip), "
            "SIGN is 00 to 07, both hexadecimal"
        )
    return None
