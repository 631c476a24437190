"""MIDI bindings: which key, fader or program of a controller gives which command; learned on the page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from appliance.box.record import WholeFile
from appliance.levers.addresses import ADDRESSES
from appliance.levers.form import FADE, Number
from appliance.pose.foreign_file import plain_json
from appliance.show_control.command import LONGEST_NAME, command
from appliance.show_control.packet import Message

FILE = "midi-bindings.json"
MOST_BINDINGS = 256
_LARGEST = 1 << 19  # bytes: as many of the longest names fit, in any script
LONGEST_DEVICE = 64  # characters of its name

_KINDS = {0x8: "note", 0x9: "note", 0xB: "controller", 0xC: "program", 0xE: "pitch"}
_HALF = 0.5


class Moved(NamedTuple):
    """A movement on a device. channel: 1 to 16; number: 0 for pitch bend; value: 0 to 1."""

    device: str
    kind: str
    channel: int
    number: int
    value: float

    @property
    def control(self) -> tuple[str, str, int, int]:
        """Without its value."""
        return self.device, self.kind, self.channel, self.number


def moved(device: str, message: bytes) -> Moved | None:
    """The movement in a MIDI message; None: there is none."""
    kind = _KINDS.get(message[0] >> 4)
    if kind is None or len(message) < 2:
        return None
    channel, first = (message[0] & 0x0F) + 1, message[1]
    if kind == "program":
        return Moved(device, kind, channel, first, 1.0)
    second = message[2] if len(message) > 2 else 0
    if kind == "pitch":
        return Moved(device, kind, channel, 0, (second << 7 | first) / 0x3FFF)
    pressed = second / 0x7F if message[0] >> 4 != 0x8 else 0.0
    return Moved(device, kind, channel, first, pressed)


class Binding(NamedTuple):
    """A control and its command. name: what the command is about, like a cue; "" for none. low, high: the
    numbers that the ends of a fader stand for, where the command takes a number.
    """

    device: str
    kind: str
    channel: int
    number: int
    address: str
    name: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def control(self) -> tuple[str, str, int, int]:
        """Without its command."""
        return self.device, self.kind, self.channel, self.number


def range_of(address: str) -> Number | None:
    """The number that a fader sets at this address; None: it is a command that a key gives.

    Raises ValueError for an address that no control can have.
    """
    if address not in ADDRESSES:
        raise ValueError(f"{address} is no command of this box.")
    form = ADDRESSES[address].form
    needed = [number for number in form.numbers[: len(form.numbers) - form.optional] if number is not FADE]
    if len(needed) > 1:
        raise ValueError(f"{address} takes several numbers: no control has them.")
    return needed[0] if needed else None


def checked(values: dict[str, Any]) -> Binding:
    """A binding from JSON. Raises ValueError with a sentence."""
    try:
        one = Binding(**values)
        texts, numbers = (one.device, one.kind, one.address, one.name), (one.channel, one.number)
        if not (all(isinstance(text, str) for text in texts) and all(type(part) is int for part in numbers)):
            raise TypeError("a text or a number is of another type")
    except TypeError:
        raise ValueError("This is no binding.") from None
    if one.kind not in _KINDS.values() or not 1 <= one.channel <= 16 or not 0 <= one.number <= 127:
        raise ValueError("This is no control of a MIDI device.")
    if len(one.device) > LONGEST_DEVICE or len(one.name) > LONGEST_NAME:
        raise ValueError("The name is too long.")
    bounds = range_of(one.address)
    if bounds is not None:
        low = bounds.least if one.low is None else one.low
        high = bounds.most if one.high is None else one.high
        ends = [float(end) for end in (low, high) if isinstance(end, int | float)]
        if len(ends) < 2 or not all(bounds.admits(end) for end in ends):
            raise ValueError(f"{one.address} takes {bounds}.")
        one = one._replace(low=ends[0], high=ends[1])
    message = _message(one, bounds, one.low)
    command(str(message[0]), message[1:])  # the form, with its name
    return one


def _message(one: Binding, bounds: Number | None, number: float | None) -> Message:
    named: tuple[str | int | float, ...] = (one.address, one.name) if one.name else (one.address,)
    if bounds is None or number is None:
        return named
    return (*named, round(number) if bounds.is_whole else number)


class MidiBindings:
    """The file in the state folder, which the page writes and the process that hears MIDI reads."""

    def __init__(self, folder: Path) -> None:
        self._path, self._file = folder / FILE, WholeFile(folder / FILE, _LARGEST)
        self._changed = -1
        self._known: tuple[Binding, ...] = ()
        self._pressed: dict[tuple[str, str, int, int], bool] = {}

    @property
    def all(self) -> tuple[Binding, ...]:
        """Those in the file; a binding that this release does not know is left out."""
        try:
            changed = self._path.stat().st_mtime_ns
        except OSError:
            changed = 0
        if changed != self._changed:
            self._changed, self._known = changed, tuple(self._read())
        return self._known

    def bind(self, one: Binding) -> None:
        """Add one; a control has one command, and the newest counts. Raises OSError, ValueError."""
        others = [known for known in self.all if known.control != one.control]
        if len(others) >= MOST_BINDINGS:
            raise ValueError(f"There are {MOST_BINDINGS} bindings already. Remove one first.")
        self._write([*others, one])

    def remove(self, one: Binding) -> None:
        """Forget one. Raises OSError."""
        self._write([known for known in self.all if known.control != one.control])

    def commands(self, what: Moved) -> Iterator[Message]:
        """The commands that a movement gives: a key when it is pressed, a fader all the way."""
        was_pressed = self._pressed.get(what.control, False)
        if what.kind != "program":
            self._pressed[what.control] = _is_press(what)
        for one in self.all:
            if one.control != what.control:
                continue
            bounds = range_of(one.address)
            if bounds is not None and one.low is not None and one.high is not None:
                yield _message(one, bounds, one.low + what.value * (one.high - one.low))
            elif _is_press(what) and not was_pressed:
                yield _message(one, None, None)

    def _read(self) -> Iterator[Binding]:
        try:
            values = [plain_json(payload) for payload in self._file.read()]
            listed = values[0]["bindings"] if values else []
        except (OSError, ValueError, KeyError, TypeError):
            return
        for value in listed if isinstance(listed, list) else ():
            try:
                yield checked(dict(value))
            except (ValueError, TypeError):
                continue

    def _write(self, bindings: Sequence[Binding]) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._file.write(json.dumps({"bindings": [one._asdict() for one in bindings]}, indent=1).encode())


def _is_press(what: Moved) -> bool:
    """A key is pressed at any strength, a controller's button beyond its middle."""
    return what.value > 0.0 if what.kind == "note" else what.value >= _HALF
