"""Commands by OSC: a small thread listens, checks each message, and lays it down for the tick to pick up.

Who asks about sensors is answered, by the same thread: `/sensors/reply` once the tick has done it.
"""

from __future__ import annotations

import contextlib
import math
import socket
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pythonosc.osc_message_builder import BuildError, OscMessageBuilder
from pythonosc.osc_packet import OscPacket

from appliance.sensor.keys import KeyFileError, SensorKey, load_keys
from appliance.stage.roster import Message, Roster

_LARGEST_DATAGRAM = 4096
_PAUSE_S = 0.002  # after each datagram: a flood takes at most a few percent of the interpreter from the tick
_A_PAUSE = 8  # messages of a bundle for which one pause is enough
_WAITING = 64  # commands that may wait for a tick; then the oldest gives way
_LISTEN_S = 0.1  # how soon the thread notices that the show is over, or that an answer waits
_PAUSE_AFTER_RELOAD_S = 0.1  # reading a changed key file is some milliseconds of work

Address = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Command:
    """One checked command: `name` as in the table below, its numbers, and what it is about.

    `asker`: who waits for an answer; `keys`: what a reload has read.
    """

    name: str
    values: tuple[float, ...] = ()
    joint: str | int = ""
    sensor: str = ""  # empty: all of them
    asker: Address | None = field(default=None, compare=False)
    keys: Mapping[str, SensorKey] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, slots=True)
class _Form:
    """How many numbers an address takes, and within which bounds."""

    name: str
    fewest: int = 0
    most: int = 0
    above: float = -1e6
    below: float = 1e6
    has_joint: bool = False
    sensors: tuple[int, int] = (0, 0)  # how many sensors' names it takes, at least and at most


FORMS = {
    "/player/start": _Form("start"),
    "/player/stop": _Form("stop"),
    "/player/jump": _Form("jump", 1, 1, above=0.0),
    "/player/rate": _Form("rate", 1, 1, above=-4.0, below=4.0),
    "/player/excerpt": _Form("excerpt", 1, 2, above=0.0),
    "/iterations": _Form("iterations", 2, 2, above=0.0, below=64.0),
    "/mocap/setjointrot": _Form("hold", 4, 4, has_joint=True),
    "/mocap/releasejoint": _Form("release", 0, 0, has_joint=True),
    "/sensors/neutral": _Form("neutral", sensors=(0, 1)),
    "/sensors/heading": _Form("heading", sensors=(0, 1)),
    "/sensors/strobe": _Form("strobe", sensors=(1, 1)),
    "/sensors/reload": _Form("reload"),
    "/sensors/list": _Form("list"),
}
ANSWERED, REPLY = "/sensors/", "/sensors/reply"
_ONCE_A_BUNDLE = ("/sensors/list", "/sensors/reload")  # much work, and the same each time


def command(address: str, arguments: Sequence[object]) -> Command:
    """The command in one message. Raises ValueError with one clear sentence."""
    if not all(text.isprintable() for text in (address, *arguments) if isinstance(text, str)):
        raise ValueError("A command has no control characters in it.")
    form = FORMS.get(address)
    if form is None:
        raise ValueError(f"{address} is no command of this box. It knows {', '.join(FORMS)}.")
    joint: str | int = ""
    if form.has_joint:
        if not arguments or not isinstance(arguments[0], str | int):
            raise ValueError(f"{address} begins with the joint: its name or its number.")
        joint, arguments = arguments[0], arguments[1:]
    if form.sensors[1]:
        return Command(form.name, sensor=_sensor(address, form, arguments))
    numbers = [float(value) for value in arguments if isinstance(value, int | float)]
    if len(numbers) != len(arguments) or not form.fewest <= len(numbers) <= form.most:
        count = f"{form.fewest}" if form.fewest == form.most else f"{form.fewest} to {form.most}"
        raise ValueError(f"{address} takes {count} numbers.")
    if not all(math.isfinite(number) and form.above <= number <= form.below for number in numbers):
        raise ValueError(f"{address} takes numbers from {form.above:g} to {form.below:g}.")
    return Command(form.name, tuple(numbers), joint)


def _sensor(address: str, form: _Form, arguments: Sequence[object]) -> str:
    fewest, most = form.sensors
    if not fewest <= len(arguments) <= most or not all(isinstance(word, str) and word for word in arguments):
        raise ValueError(f"{address} takes a sensor's name{'' if fewest else ', or nothing for all'}.")
    return "".join(map(str, arguments))


def readable(text: str) -> str:
    """What may be shown on a terminal, whoever sent it: no control characters."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def datagram(message: Message) -> bytes:
    """One OSC message: its address, then whole numbers, fractions and texts."""
    builder = OscMessageBuilder(str(message[0]))
    for argument in message[1:]:
        builder.add_arg(argument)
    return bytes(builder.build().dgram)


class Control:
    """The control port: commands wait in a queue until a tick takes them.

    `roster` is what `/sensors/list` tells, `key_file` what `/sensors/reload` reads, here and never in a tick.
    Raises OSError when the port is taken. What is no command is counted in `refused`, with the last `reason`.
    """

    def __init__(self, host: str, port: int, roster: Roster, key_file: Path | None = None) -> None:
        self._roster, self._key_file = roster, key_file
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(_LISTEN_S)
        self.port: int = self._socket.getsockname()[1]
        self.refused = 0
        self.reason = ""
        self._commands: deque[Command] = deque(maxlen=_WAITING)
        self._answers: deque[tuple[Address, Message]] = deque(maxlen=_WAITING)
        self._read_keys: tuple[object, Mapping[str, SensorKey] | str] | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._listen, name="control", daemon=True)
        self._thread.start()

    def take(self) -> Command | None:
        """The oldest command that waits, or None; never blocks."""
        return self._commands.popleft() if self._commands else None

    def answer(self, order: Command, done: bool, words: str) -> None:
        """Tell who asked what came of a command, if anyone waits for it; never blocks."""
        if order.asker is not None:
            self._answers.append((order.asker, (REPLY, f"{ANSWERED}{order.name}", int(done), words)))

    def close(self) -> None:
        """End the thread and free the port."""
        self._closing = True
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closing:
            try:
                received, asker = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except TimeoutError:
                self._send_answers()
                continue
            except OSError:  # an asker who is gone again, told by the kernel
                received, asker = b"", ("", 0)
            count = self._read(received, asker) if received else 0
            self._send_answers()
            time.sleep(_PAUSE_S * max(1.0, count / _A_PAUSE))

    def _read(self, received: bytes, asker: Address) -> int:
        """Take one datagram's messages; gives how many there were."""
        try:
            messages = [timed.message for timed in OscPacket(received).messages]
        except Exception as error:  # python-osc raises many kinds; whatever came, the show goes on
            self._refuse(str(error))
            return 1
        once: set[str] = set()
        for one in messages:
            if one.address in once:
                self._refuse(f"{one.address} came twice in a bundle: once is enough.")
                continue
            if one.address in _ONCE_A_BUNDLE:
                once.add(one.address)
            is_answered = one.address.startswith(ANSWERED)
            try:
                order = command(one.address, one.params)
                if is_answered:
                    order = replace(order, asker=asker)
                self._lay_down(order)
            except ValueError as error:
                self._refuse(str(error))
                if is_answered:
                    self._answers.append((asker, (REPLY, one.address, 0, str(error))))
        return len(messages)

    def _lay_down(self, order: Command) -> None:
        """Lists are told at once; a reload takes the keys along; the rest is the tick's."""
        if order.name == "list" and order.asker is not None:
            for message in self._roster.messages(time.monotonic()):
                self._send(order.asker, message)
                time.sleep(_PAUSE_S)
            return
        if order.name == "reload":
            order = replace(order, keys=self._keys())
        self._commands.append(order)

    def _keys(self) -> Mapping[str, SensorKey]:
        """What the key file holds; read only when it has changed, however often someone asks."""
        stamp = self._stamp()
        if self._read_keys is None or self._read_keys[0] != stamp:
            try:
                self._read_keys = stamp, self._load_keys()
            except ValueError as error:
                self._read_keys = stamp, str(error)
            time.sleep(_PAUSE_AFTER_RELOAD_S)
        read = self._read_keys[1]
        if isinstance(read, str):
            raise ValueError(read)
        return read

    def _stamp(self) -> object:
        """What changes with the key file; None when nothing is there."""
        try:
            status = self._key_file.stat() if self._key_file is not None else None
        except OSError:
            return None
        return status and (status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)

    def _load_keys(self) -> Mapping[str, SensorKey]:
        if self._key_file is None:
            raise ValueError("This box has no key file: name one under sensors.keys in its box file.")
        try:
            return load_keys(self._key_file)
        except KeyFileError as error:
            raise ValueError(f"{error}. The box goes on with the keys that it has.") from None
        except OSError as error:
            raise ValueError(
                f"{self._key_file} cannot be read ({error.strerror}). "
                "The box goes on with the keys that it has."
            ) from None

    def _refuse(self, reason: str) -> None:
        self.refused += 1
        self.reason = readable(reason)

    def _send_answers(self) -> None:
        while self._answers:
            self._send(*self._answers.popleft())

    def _send(self, asker: Address, message: Message) -> None:
        with contextlib.suppress(OSError, BuildError):  # who asked is gone; no OSC text
            self._socket.sendto(datagram(message), asker)
