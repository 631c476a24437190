"""`bunraku console`: serves the page for technicians; tells its PIN, lists and revokes devices."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import json
import os
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from appliance.box.runtime_folder import RuntimeFolderError, runtime_folder
from appliance.cli.companions import Companion
from appliance.cli.options import BoxFile, ChosenFile, ThisBoxFile, command_group, is_for_subcommand
from appliance.console.devices import Devices
from appliance.console.settings import Settings
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import NotAskedForError, Problem
from appliance.show.console import ConsoleConfig
from appliance.stage.stage_error import StageError

_KEPT, _WHERE = "console.json", "console.path"
_ELSEWHERE = "192.0.2.1", 9  # an address of no machine (RFC 5737): which of ours would a packet leave by?

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

    config = load_box(box_of(box, chosen))
    if config.console is None:
        words = "This box file says `console: null`, so this box serves no page."
        raise NotAskedForError([Problem(config.file.path, 0, words, "Write `console: {port: 8080}`.")])
    descriptor = open_console_port(config.console).detach()
    print(f"The page: {address_of(descriptor)}. Its PIN: bunraku console pin.", flush=True)
    os.set_inheritable(descriptor, True)
    command = console_command(
        config, descriptor, kept_in(config), journal=config.journal.folder, chosen=chosen
    )
    os.execv(command[0], command)  # a fresh process, which loads only what the page needs


@console.command()
def pin(
    box: ThisBoxFile = None,
    new: Annotated[
        bool, typer.Option("--new", help="Choose another one; every device needs it again.")
    ] = False,
) -> None:
    """Print the PIN that a device gives once before it may change anything."""
    devices = _devices(box)
    print(devices.change_pin() if new else devices.pin)


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


@console.command("about", hidden=True)
def tell_about(box: BoxFile = None, chosen: ChosenFile = None) -> None:
    """Print what this box is, as JSON for the page."""
    from appliance.release.about import about

    print(json.dumps(about(chosen, box)))


def open_console_port(console: ConsoleConfig, or_any: bool = False) -> socket.socket:
    """The page's socket, listening. or_any: on a free port where the wanted one is taken.

    Raises StageError.
    """
    try:
        return _listening(console.host, console.port)
    except OSError as error:
        if or_any and error.errno == errno.EADDRINUSE:
            return _listening(console.host, 0)
        raise StageError(
            f"TCP port {console.port} on {console.host} cannot be opened for the page ({error.strerror}). "
            "Is a second bunraku running? Stop it, or give another port under console: in the box file."
        ) from error


def address_of(descriptor: int) -> str:
    """The page's address, as a browser takes it."""
    with socket.socket(fileno=os.dup(descriptor)) as listening:
        host, port = listening.getsockname()[:2]
    if ipaddress.ip_address(host).is_unspecified:
        host = socket.gethostname()
        with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
            asking.connect(_ELSEWHERE)
            host = asking.getsockname()[0]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def console_command(
    box: BoxConfig,
    descriptor: int,
    kept: Path,
    control: tuple[str, int] | None = None,
    journal: Path | None = None,
    chosen: Path | None = None,
) -> tuple[str, ...]:
    """How to start the page of a box whose port is open. control: where commands arrive in fact; journal:
    where one is kept in fact; chosen: what the preflight chose, on an installed box.

    Raises StageError.
    """
    console, own = box.console or ConsoleConfig(), box.control
    if control is None and own is not None and own.port:
        control = own.host, own.port
    if control is not None and control[0] == "0.0.0.0":
        control = "127.0.0.1", control[1]
    folder = _runtime(box)
    with contextlib.suppress(OSError):
        (folder / _WHERE).write_text(str(kept))
    settings = Settings(
        folder=str(folder),
        descriptor=descriptor,
        kept=str(kept),
        control=control,
        viewers=tuple(console.viewers),
        names=tuple(console.names),
        rehearsal=console.rehearsal,
        journal=None if journal is None else str(journal.resolve()),
        about=_named(box, chosen),
    )
    return sys.executable, "-m", "appliance.console", settings.packed()


def page_companion(
    box: BoxConfig,
    page: socket.socket,
    control: socket.socket | None,
    say: Callable[[str], None],
    rehearsal: bool,
    journal: Path | None,
) -> Companion:
    """The page's process beside the stage; says where browsers find it. Raises StageError.

    rehearsal: PIN and devices are not the venue's; they stay until the machine is off.
    """
    heard_on = None if control is None else control.getsockname()
    kept = _runtime(box) / _KEPT if rehearsal else kept_in(box)
    command = console_command(box, page.fileno(), kept, heard_on, journal)
    try:
        say(f"The page: {address_of(page.fileno())}, PIN {Devices(kept).pin}.")
    except OSError as error:
        say(f"{kept}: no PIN can be kept there ({error.strerror}). No page; the dance goes on.")
    return Companion("The page", command, "Browsers come back by themselves.", descriptors=(page.fileno(),))


def kept_in(box: BoxConfig) -> Path:
    """The file with PIN and devices: where the box keeps what it learns, else until the machine is off."""
    return (box.state_folder or _runtime(box)) / _KEPT


def _named(box: BoxConfig, chosen: Path | None) -> tuple[str, ...]:
    """Options by which a command finds the same box."""
    if chosen is not None:
        return "--chosen", str(chosen.resolve())
    return () if box._file is None else ("--box", str(box.file.path.resolve()))


def _devices(box: Path | None) -> Devices:
    from appliance.release.installed_box import box_here

    config = load_box(box_here(box))
    path = kept_in(config)
    # A page that runs says where it keeps them: in a rehearsal elsewhere.
    with contextlib.suppress(OSError):
        told = Path((_runtime(config) / _WHERE).read_text())
        path = told if told.is_file() else path
    try:
        return Devices(path)
    except OSError as error:
        raise StageError(
            f"{path}: the PIN cannot be kept there ({error.strerror}). On an installed box put sudo before "
            "the command; else give another folder as `state:` in the box file."
        ) from error


def _runtime(box: BoxConfig) -> Path:
    try:
        return runtime_folder(box)
    except RuntimeFolderError as error:
        raise StageError(str(error)) from error


def _listening(host: str, port: int) -> socket.socket:
    """`::` takes IPv4 too; on a machine without IPv6 it is IPv4 alone."""
    if host == "::" and not socket.has_dualstack_ipv6():
        host = "0.0.0.0"
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, dualstack_ipv6=host == "::")
