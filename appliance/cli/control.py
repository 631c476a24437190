"""`bunraku control`: opens the control port as the box file says, and becomes show control."""

from __future__ import annotations

import errno
import os
import socket
import sys
import time
from typing import TYPE_CHECKING, Annotated

import typer

from appliance.box.runtime_folder import runtime_folder
from appliance.box.served import from_here, port_cure
from appliance.cli.options import BoxFile, ChosenFile
from appliance.release.choice import box_of
from appliance.sensor.foreign.sources import SourceSettings
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import NotAskedForError, Problem, did_you_mean
from appliance.show.control import ControlConfig
from appliance.show.foreign_sensors import ForeignSensorConfig
from appliance.show_control.foreign_sensors import ForeignPort
from appliance.show_control.packet import datagram
from appliance.show_control.port import open_port
from appliance.show_control.settings import ControlSettings
from appliance.stage.stage_error import StageError

if TYPE_CHECKING:
    from appliance.show.show import Show

_FIRST_OF_SYSTEMD = 3  # sd_listen_fds(3)
_FREED_WITHIN_S, _LOOK_S = 2.0, 0.05


def control(
    box: BoxFile = None,
    socket_fd: Annotated[
        int | None, typer.Option(min=3, help="The control port's socket, where it is open already.")
    ] = None,
    chosen: ChosenFile = None,
) -> None:
    """Take commands by OSC (go, stop, panic, cues ...), even while the stage hangs or is absent."""
    config = load_box(box_of(box, chosen))
    if config.control is None:
        message = "This box file says `control: null`, so this box takes no commands."
        cure = "Write `control: {port: 9002}`."
        raise NotAskedForError([Problem(config.file.path, 0, message, cure)])
    if socket_fd is None:
        socket_fd = _from_systemd()
    if socket_fd is None:
        socket_fd = open_control_port(config.control).detach()
    _require_udp(socket_fd)
    os.set_inheritable(socket_fd, True)
    command = control_command(config, socket_fd)
    os.execv(command[0], command)  # a fresh process, which loads only what show control needs


def open_control_port(control: ControlConfig) -> socket.socket:
    """The port's socket, bound. Raises StageError with what to do when it is taken.

    The show control of a killed box may still hold it for a moment.
    """
    until = time.monotonic() + _FREED_WITHIN_S
    while True:
        try:
            return open_port(control.host, control.port)
        except OSError as error:
            if error.errno != errno.EADDRINUSE or time.monotonic() >= until:
                raise _taken(control, error) from error
        time.sleep(_LOOK_S)


def _taken(control: ControlConfig, error: OSError) -> StageError:
    return StageError(
        f"UDP port {control.port} on {control.host} cannot be opened for commands ({error.strerror}). "
        f"Commands could not arrive, so nothing is started. {port_cure(error, 'control')} Or write "
        "`control: null` for none."
    )


def begin_in(cue: str, show: Show, control: socket.socket | None) -> None:
    """Have the show begin in a cue: the command waits in the control port until show control reads it.

    Raises StageError where the show has no such cue, or no show control runs with it.
    """
    names = [one.name for one in show.config.cues]
    if cue not in names:
        raise StageError(f"{show.config.name} has no cue '{cue}'. {did_you_mean(cue, names)}")
    if control is None:
        raise StageError("--cue needs show control beside the stage: leave --alone and `control: null` out.")
    host, port = control.getsockname()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.sendto(datagram(("/cue", cue)), (from_here(host), port))


def control_command(box: BoxConfig, descriptor: int) -> tuple[str, ...]:
    """How to start show control for a box whose port is open; `box.control` is there.

    Raises RuntimeFolderError.
    """
    control = box.control or ControlConfig()
    settings = ControlSettings(
        folder=str(runtime_folder(box)),
        descriptor=descriptor,
        senders=tuple(control.senders),
        heartbeat=tuple((one.host, one.port) for one in control.heartbeat),
        key_file=str(box.sensors.keys or ""),
        replies=tuple((one.host, one.port) for one in control.replies),
        feedback=tuple((one.host, one.port) for one in control.feedback),
        foreign=foreign_ports(box),
        state=str(box.state_folder or ""),
    )
    return sys.executable, "-m", "appliance.show_control", settings.packed()


def foreign_ports(box: BoxConfig) -> tuple[ForeignPort, ...]:
    """The ports of foreign sensors that are programs; those on one port share it."""
    ports: dict[tuple[str, int], list[ForeignSensorConfig]] = {}
    for one in box.sensors.foreign:
        if one.program is not None:
            ports.setdefault((one.host, one.usual_port), []).append(one)
    return tuple(
        ForeignPort(
            host,
            port,
            tuple(dict.fromkeys(sender for one in sensors for sender in one.senders)),
            tuple(
                SourceSettings(
                    *(one.name, one.from_, one.address or "", one.values or "", one.axes or ""),
                    *(one.facing or "", one.bone or "", one.drifts),
                )
                for one in sensors
            ),
        )
        for (host, port), sensors in ports.items()
    )


def _from_systemd() -> int | None:
    """The socket that a socket unit has opened for this process."""
    ours = os.environ.get("LISTEN_PID") == str(os.getpid()) and os.environ.get("LISTEN_FDS", "0") != "0"
    return _FIRST_OF_SYSTEMD if ours else None


def _require_udp(descriptor: int) -> None:
    try:
        one = socket.socket(fileno=os.dup(descriptor))
    except OSError as error:
        raise StageError(
            f"Descriptor {descriptor} is no open socket ({error.strerror}). Commands cannot arrive. "
            "Leave --socket-fd out, and the port is opened here."
        ) from error
    with one:
        if (one.family, one.type) != (socket.AF_INET, socket.SOCK_DGRAM):
            raise StageError(
                f"The socket with descriptor {descriptor} is not UDP over IPv4. Commands cannot arrive. "
                "In a socket unit, write ListenDatagram= with an IPv4 address."
            )
