"""MIDI by cable: ALSA's raw devices, which class-compliant USB controllers and interfaces appear as."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from appliance.remote.midi_messages import MidiParser

_FOLDER, _DEVICES = Path("/dev/snd"), "midiC*D*"
_CARDS = Path("/proc/asound")
_LOOK_S = 2.0
_AT_ONCE = 4096  # bytes: more than a second of a cable


class _Cable:
    """One open device; it may be without output."""

    def __init__(self, file: Path, name: str) -> None:
        self.name, self._parser = name, MidiParser()
        try:
            self.descriptor = os.open(file, os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY)
        except OSError:
            self.descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)

    def messages(self) -> Iterator[bytes]:
        """Messages that have come. Raises OSError when the device is unplugged."""
        try:
            received = os.read(self.descriptor, _AT_ONCE)
        except BlockingIOError:
            return
        if not received:
            raise OSError(f"{self.name} is unplugged")
        yield from self._parser.messages(received)

    def send(self, message: bytes) -> None:
        with contextlib.suppress(OSError):  # no output, or its buffer is full
            os.write(self.descriptor, message)

    def close(self) -> None:
        with contextlib.suppress(OSError):
            os.close(self.descriptor)


class RawMidi:
    """All devices that are asked for, opened again after they were unplugged. Never waits, never raises.

    wanted: parts of their names, or paths; none: every one that is there. missing: those of `wanted` that are
    not there.
    """

    def __init__(self, wanted: Sequence[str], folder: Path = _FOLDER) -> None:
        self._wanted, self._folder = tuple(wanted), folder
        self._cables: dict[Path, _Cable] = {}
        self._look_at = 0.0
        self.missing: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of those that are open."""
        return tuple(cable.name for cable in self._cables.values())

    def descriptors(self) -> list[int]:
        """To poll for messages."""
        return [cable.descriptor for cable in self._cables.values()]

    def look(self, now: float) -> None:
        """Open what has come; monotonic seconds."""
        if now < self._look_at:
            return
        self._look_at = now + _LOOK_S
        there = {file: _name(file) for file in sorted(self._folder.glob(_DEVICES))}
        there |= {Path(one): Path(one).name for one in self._wanted if one.startswith("/")}
        for file, name in there.items():
            if file not in self._cables and self._is_wanted(file, name):
                with contextlib.suppress(OSError):
                    self._cables[file] = _Cable(file, name)
        open_ = [(file, cable.name) for file, cable in self._cables.items()]
        self.missing = tuple(
            one for one in self._wanted if not any(_matches(one, *device) for device in open_)
        )

    def messages(self) -> Iterator[tuple[str, bytes]]:
        """The device's name and each message that has come."""
        for file, cable in list(self._cables.items()):
            try:
                for message in cable.messages():
                    yield cable.name, message
            except OSError:
                self._cables.pop(file).close()

    def send(self, name: str, message: bytes) -> None:
        """To one device; dropped where it is away."""
        for cable in self._cables.values():
            if cable.name == name:
                cable.send(message)

    def close(self) -> None:
        for cable in self._cables.values():
            cable.close()
        self._cables.clear()

    def _is_wanted(self, file: Path, name: str) -> bool:
        return not self._wanted or any(_matches(one, file, name) for one in self._wanted)


def _matches(wanted: str, file: Path, name: str) -> bool:
    return wanted == str(file) or wanted.lower() in name.lower()


def _name(file: Path) -> str:
    """The card's name: it stays the same at another socket."""
    card, _, device = file.name.removeprefix("midiC").partition("D")
    try:
        first = (_CARDS / f"card{card}" / f"midi{device}").read_text("utf-8", "replace").splitlines()[0]
    except (OSError, IndexError):
        return file.name
    return first.strip() or file.name
