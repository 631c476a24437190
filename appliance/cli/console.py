"""`bunraku console`: serves the page for technicians; tells its PIN, lists and revokes devices."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import sys
import textwrap
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from appliance.box.durable import write_whole
from appliance.box.notify import WATCHDOG_S
from appliance.box.runtime_folder import RuntimeFolderError, runtime_folder
from appliance.box.served import from_here, is_loopback, name_in_network
from appliance.cli.companions import Companion
from appliance.cli.options import (
    BoxFile,
    ChosenFile,
    ThisBoxFile,
    command_group,
    is_for_subcommand,
)
from appliance.cli.page_address import address, address_of, open_console_port
from appliance.cli.phones import offer_phones, out_of_phones_reach, phone_names
from appliance.console.devices import Devices
from appliance.console.settings import WHERE, ConsoleSettings
from appliance.console.update_code import pending_code
from appliance.show.config_error import NotAskedForError, Problem
from appliance.stage.stage_error import StageError

if TYPE_CHECKING:
    from appliance.show.box import BoxConfig
    from appliance.show.report import ReportConfig

_log = logging.getLogger(__name__)

_DEVICES = "console.json"
_PATIENCE_S = 2.0
_CARD_LETTERS, _CARD_LINES = 40, 5  # the test card's, for one fault

console = command_group(
    "Serve the page: a browser at the venue shows the box and, with the PIN, commands it. `bunraku play` "
    "starts it by itself and prints its address and PIN."
)


@console.callback(invoke_without_command=True)
def serve(context: typer.Context, box: BoxFile = None, chosen: ChosenFile = None) -> None:
    """Serve the page until Ctrl-C: `console:` in the box file says where, and to which networks."""
    if is_for_subcommand(context, box, chosen):
        return
    from appliance.release.choice import box_of
    from appliance.show.box import load_box

    config = load_box(box_of(box, chosen))
    if config.console is None:
        message = "This box file says `console: null`, so this box serves no page."
        raise NotAskedForError([Problem(config.file.path, 0, message, "Write `console: {port: 8080}`.")])
    descriptor = open_console_port(config.console).detach()
    print(
        f"The page: {address_of(descriptor, config.console.https)}. Its PIN: bunraku console pin.", flush=True
    )
    os.set_inheritable(descriptor, True)
    command = console_command(
        config, descriptor, devices_file(config), journal=config.journal.folder, chosen=chosen
    )
    os.execv(command[0], command)  # a fresh process, which loads only what the page needs


@console.command()
def pin(
    box: ThisBoxFile = None,
    new: Annotated[
        bool,
        typer.Option(
            "--new", help="Choose another one; every device needs it again, and every phone a new code."
        ),
    ] = False,
) -> None:
    """Print the PIN that a device gives once before it may change anything; with HTTPS, the fingerprint."""
    from appliance.console.certificate import FILE, fingerprint

    devices = _devices(box)
    if new:
        devices.change_pin()
        _void_phones(box)
    print(devices.pin)
    with contextlib.suppress(OSError, ValueError):
        print(f"Certificate, SHA-256: {fingerprint(devices.path.with_name(FILE))}")


def _void_phones(box: Path | None) -> None:
    """Phones joined by the PIN or by a code that someone with the PIN gave: they join anew."""
    from appliance.console.join_codes import FILE, JoinCodes
    from appliance.release.installed_box import box_here
    from appliance.show.box import load_box

    with contextlib.suppress(OSError, RuntimeFolderError):  # no box runs here: its phones are gone with it
        folder = runtime_folder(load_box(box_here(box)))
        if (folder / FILE).is_file():
            JoinCodes(folder).void()


@console.command("devices")
def list_devices(box: ThisBoxFile = None) -> None:
    """List the devices that gave the PIN."""
    for device in _devices(box).devices:
        since = time.strftime("%Y-%m-%d %H:%M", time.localtime(device.since))
        print(f"{device.id}  {since}  {device.name}")


@console.command()
def revoke(
    device: Annotated[str, typer.Argument(help="Its number, as `bunraku console devices` lists it.")],
    box: ThisBoxFile = None,
) -> None:
    """Forget a device: it needs the PIN again."""
    if not _devices(box).revoke(device):
        raise StageError(f"There is no device {device}. List them: bunraku console devices")
    print(f"{device} is forgotten.")


@console.command()
def phone(
    name: Annotated[
        str | None, typer.Argument(help="The sensor. Default: the only one that phones may be.")
    ] = None,
    box: ThisBoxFile = None,
) -> None:
    """Print a code, as QR code and address, by which one phone becomes a sensor of the running box."""
    from appliance.cli.phones import invitation
    from appliance.console.join_codes import JoinCodes
    from appliance.release.installed_box import box_here
    from appliance.show.box import load_box

    folder = runtime_folder(load_box(box_here(box)))
    codes = JoinCodes(folder)
    names = codes.names
    chosen = names[0] if name is None and len(names) == 1 else name
    if chosen not in names:
        those = f"Phones may be: {', '.join(names)}." if names else "No box runs here that takes a phone."
        raise StageError(
            f"{those} The box file lists them: sensors: foreign: [{{name: left-wrist, from: phone}}]. To try "
            "it: bunraku play --phone"
        )
    try:
        _, host, port, https = (folder / WHERE).read_text().splitlines()
        socket.create_connection((from_here(host), int(port)), _PATIENCE_S).close()
        for line in invitation(codes, address(host, int(port), bool(https)), chosen, sys.stdout.isatty()):
            print(line)
    except (OSError, ValueError) as error:
        raise StageError("No page runs here. Start the box: bunraku play") from error


def card_lines(box: BoxConfig) -> tuple[str, ...]:
    """For the projector's test card: the page's address and PIN, the box's own Wi-Fi, a fault of it."""
    wifi = _network_lines(box) + wifi_lines(box)
    try:
        devices, host, port, https = (runtime_folder(box) / WHERE).read_text().splitlines()
        code = pending_code(runtime_folder(box))
        update = (f"update code {code}",) if code else ()
        at = address(host, int(port), bool(https))
        name = "" if is_loopback(host) else name_in_network()
        named = (f"or {address(name, int(port), bool(https))}",) if name else ()
        return f"page {at}", *named, f"pin {Devices(Path(devices)).pin}", *update, *wifi
    except (OSError, ValueError, RuntimeFolderError):
        return wifi


def wifi_lines(box: BoxConfig) -> tuple[str, ...]:
    """Short lines about the Wi-Fi that bunraku-wifi.yaml names; nothing where all is well."""
    from appliance.cli.join_wifi import MESSAGE_FILE

    message = _left(box, MESSAGE_FILE)
    return tuple(textwrap.wrap(message, _CARD_LETTERS, max_lines=_CARD_LINES, placeholder=" ..."))


def _network_lines(box: BoxConfig) -> tuple[str, ...]:
    """Name and password of the network that this box makes itself."""
    from appliance.cli.join_wifi import NETWORK_FILE

    return tuple(_left(box, NETWORK_FILE).splitlines())


def _left(box: BoxConfig, name: str) -> str:
    try:
        return (runtime_folder(box) / name).read_text("utf-8", "replace")
    except (OSError, RuntimeFolderError):
        return ""


def console_command(
    box: BoxConfig,
    descriptor: int,
    devices: Path,
    control: tuple[str, int] | None = None,
    journal: Path | None = None,
    chosen: Path | None = None,
) -> tuple[str, ...]:
    """How to start the page of a box whose port is open. control: where commands arrive in fact; journal:
    where one is kept in fact; chosen: what the preflight chose, on an installed box.

    Raises RuntimeFolderError.
    """
    from appliance.show.console import ConsoleConfig

    console, own = box.console or ConsoleConfig(), box.control
    if control is None and own is not None and own.port:
        control = own.host, own.port
    if control is not None:
        control = from_here(control[0]), control[1]
    folder = runtime_folder(box)
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as opened:
        host, port = opened.getsockname()[:2]
        (folder / WHERE).write_text(f"{devices}\n{host}\n{port}\n{'https' * console.https}\n")
    write_report_settings(folder, console.report)
    settings = ConsoleSettings(
        folder=str(folder),
        descriptor=descriptor,
        devices=str(devices),
        control=control,
        viewers=tuple(console.viewers),
        names=tuple(console.names),
        rehearsal=console.rehearsal,
        https=console.https,
        journal=None if journal is None else str(journal.resolve()),
        box=_named(box, chosen),
        is_installed=chosen is not None,
        phones=phone_names(box),
    )
    return sys.executable, "-m", "appliance.console", settings.packed()


def write_report_settings(folder: Path, report: ReportConfig | None) -> None:
    """For the page's process, which loads no pydantic; a command line is no place for secrets."""
    from appliance.console.report import FILE

    with contextlib.suppress(OSError):
        if report is None:
            (folder / FILE).unlink(missing_ok=True)
        else:
            write_whole(folder / FILE, report.model_dump_json().encode(), private=True)


def page_companion(
    box: BoxConfig,
    page: socket.socket,
    control: socket.socket | None,
    rehearsal: bool,
    journal: Path | None,
) -> Companion:
    """The page's process beside the stage; logs where browsers find it. Raises StageError.

    rehearsal: PIN and devices are not the venue's; they stay until the machine is off.
    """
    heard_on = None if control is None else control.getsockname()
    devices = runtime_folder(box) / _DEVICES if rehearsal else devices_file(box)
    command = console_command(box, page.fileno(), devices, heard_on, journal)
    try:
        https = box.console is not None and box.console.https
        origin = address_of(page.fileno(), https)
        _log.info(f"The page: {origin}, PIN {Devices(devices).pin}.")
    except OSError as error:
        _log.warning(f"{devices}: no PIN can be kept there ({error.strerror}). No page; the dance goes on.")
    else:
        if names := phone_names(box):
            option = "" if box.path is None else f" --box {box.path}"
            offer_phones(runtime_folder(box), origin, names, option)
            for line in out_of_phones_reach(box):
                _log.warning(line)
    return Companion(
        "The page",
        command,
        "Browsers come back by themselves.",
        descriptors=(page.fileno(),),
        watchdog_s=WATCHDOG_S["console"],
    )


def devices_file(box: BoxConfig) -> Path:
    """The file with PIN and devices: where the box keeps what it learns, else until the machine is off."""
    return (box.state_folder or runtime_folder(box)) / _DEVICES


def _named(box: BoxConfig, chosen: Path | None) -> dict[str, str]:
    """By which keyword and path others find the same box."""
    if chosen is not None:
        return {"chosen": str(chosen.resolve())}
    return {} if box._file is None else {"box": str(box.file.path.resolve())}


def _devices(box: Path | None) -> Devices:
    from appliance.release.installed_box import box_here
    from appliance.show.box import load_box

    path = devices_file_made(load_box(box_here(box)))
    try:
        return Devices(path)
    except OSError as error:
        raise StageError(
            f"{path}: the PIN cannot be kept there ({error.strerror}). On an installed box put sudo before "
            "the command; else give another folder as `state:` in the box file."
        ) from error


def devices_file_made(box: BoxConfig) -> Path:
    """The same as the page that runs here says: in a rehearsal it keeps them elsewhere."""
    path = devices_file(box)
    with contextlib.suppress(OSError, RuntimeFolderError):  # root does not meet the box's processes
        reported = Path((runtime_folder(box) / WHERE).read_text().partition("\n")[0])
        path = reported if reported.is_file() else path
    return path
