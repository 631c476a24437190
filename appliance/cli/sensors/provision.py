"""`bunraku provision`: port, key file, password; prints each step; tells the running box."""

from __future__ import annotations

import getpass
import sys
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from appliance.cli.sensors.box_keys import (
    NOT_TAKEN,
    BoxKeys,
    clear_errors,
    forgotten,
    people_console,
    reload_keys,
    require_folder,
)
from appliance.cli.sensors.worn import worn_sensors
from appliance.sensor.provisioning.provisioning import (
    DEFAULT_PORT,
    Provisioned,
    WearableSettings,
    provision,
)
from appliance.sensor.provisioning.serial_ports import found_ports, only_wearable
from appliance.sensor.provisioning.wearable_console import WearableConsole
from appliance.show.box import out_of_reach
from appliance.stage.stage_error import StageError

STDIN = Path("-")


def provision_sensor(
    box_keys: BoxKeys,
    name: str,
    port: str | None,
    network: str | None,
    password_file: Path | None,
    fusion: str | None,
    axes: str | None,
    crystal: bool | None = None,
    takes_over: bool = False,
    anyway: bool = False,
) -> int:
    """Provision the wearable on a serial port; returns the exit status. StageError: it is not provisioned.

    anyway: also one that the show wears under another name.
    """
    console = people_console()

    def say(what: str, message: str) -> None:
        _step(console, what, message)

    require_folder(box_keys.keys)
    try:
        settings = WearableSettings(
            name, network or "", "", _udp_port(box_keys), fusion, _axes(axes), crystal
        )
        is_asked = network is not None and password_file is None and sys.stdin.isatty()
        if not is_asked:
            settings = replace(settings, password=_read_password(network, password_file))
        device = port or only_wearable(found_ports())
        worn = worn_sensors(box_keys) or ()
        with clear_errors(box_keys.keys), WearableConsole(device) as cable:
            if is_asked:  # last of all, so that it is not typed in vain
                settings = replace(settings, password=_ask_password(settings.network))
            with console.status(f"Asking {escape(device)}"):
                done = provision(cable, box_keys.keys, settings, say, takes_over, () if anyway else worn)
    except KeyboardInterrupt:
        raise StageError(
            f"Stopped half-way: {box_keys.keys} was not changed, and the wearable may have its new key. "
            "Run this again: that mends it."
        ) from None
    is_well, message = reload_keys(box_keys)
    _step(console, "box", message, is_well)
    for hint in _hints(box_keys, done, settings, device, done.was in worn):
        console.print(hint, markup=False, soft_wrap=True)
    return 0 if is_well else NOT_TAKEN


def _step(console: Console, what: str, message: str, is_well: bool = True) -> None:
    marks = ("[green]✓[/]", "[red]✗[/]") if console.encoding.startswith("utf") else ("ok", "!!")
    console.print(f"{marks[not is_well]} [bold]{escape(what):<14}[/] {escape(message)}", soft_wrap=True)


def _ask_password(network: str) -> str:
    """Hidden, on the terminal."""
    try:
        return getpass.getpass(f"Password of '{network}' (nothing for an open network): ")
    except (EOFError, KeyboardInterrupt):
        raise StageError("No password was given. Nothing was changed.") from None


def _read_password(network: str | None, file: Path | None) -> str:
    """The first line of a file or of standard input; never from the command line."""
    if network is None:
        if file is not None:
            raise StageError("A password needs a network: give --network with its name. Nothing was changed.")
        return ""
    try:
        if file is None or file == STDIN:
            line = sys.stdin.readline()
        else:
            with file.open(encoding="utf-8") as text:
                line = text.readline()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise StageError(
            f"{file or STDIN}: the password cannot be read ({why}). Nothing was changed."
        ) from None
    if not line:
        raise StageError(
            "No password came. Nothing was changed. Run this on a terminal, or give --password-file; "
            "an empty line stands for an open network."
        )
    return line.rstrip("\r\n")


def _udp_port(box_keys: BoxKeys) -> int:
    udp = box_keys.box.sensors.udp
    return udp.port if udp is not None and udp.port else DEFAULT_PORT


def _axes(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    try:
        mapped, sign = (int(part, 16) for part in text.split(","))
    except ValueError:
        raise StageError(
            "--axes takes two hexadecimal numbers, for instance 24,00. Nothing was changed."
        ) from None
    return mapped, sign


def _hints(
    box_keys: BoxKeys, done: Provisioned, settings: WearableSettings, device: str, was_worn: bool
) -> list[str]:
    """The next steps, and box file settings that would keep the wearable out."""
    name, sensors = done.sensor.name, box_keys.box.sensors
    hints = [*filter(None, [forgotten(box_keys.keys)]), ""]
    if settings.network:
        hints.append(
            f"{name} is ready: unplug it, switch it on, and it looks for its box on '{settings.network}'."
        )
        if box_keys.box.path is not None and (why := out_of_reach(sensors)):
            hints.append(why)
    else:
        hints.append(f"{name} is ready: it speaks to the box by cable, as long as it is plugged in.")
        if device not in [line.device for line in sensors.serial]:
            hints.append(
                f"The box listens there with `serial: [{{device: {device}}}]` under sensors in its box file."
            )
    if done.was:
        loss = ", and this show wears it: the dancer moves freely there" if was_worn else ""
        hints.append(
            f"It was {done.was} until now: no sensor has that name any more{loss}. Provision another one as "
            f"{done.was}, or: bunraku sensors revoke {done.was}{' --anyway' if was_worn else ''}"
        )
    if not done.identity.imu_id:
        hints.append("It finds no IMU: look at the wires between board and IMU (docs/build-a-wearable.md).")
    return hints
