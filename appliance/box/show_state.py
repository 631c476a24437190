"""The show state in shared memory: written by show control, read by all processes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from appliance.box.block import BlockWriter
from appliance.box.ring_file import RingFileReader
from appliance.levers import show_state as levers
from appliance.levers import table
from appliance.levers.fade import Fade, part_of_fade
from appliance.levers.lever import Lever
from appliance.levers.show_state import Change, packed, unpacked
from appliance.levers.table import CAMERA, CARD, GOING, LIGHTS, LOOK, MASTER, STRINGS

__all__ = ["MOTION", "Part", "ShowState", "ShowStateReader", "ShowStateWriter", "part_of_fade"]

T = TypeVar("T")

FILE, KIND = "show_state", "show_state"
LARGEST = 16384  # bytes; the longest names of a show fit, in any script
MOTION = f"{table.MOTION} "
Part = tuple[int, str, tuple[float, ...]]


class ShowState(levers.ShowState):
    """A show state with a name for each fade, for lights, projector, sound and generator.

    These names go when the four read the levers themselves: `state[LOOK].before`.
    """

    __slots__ = ()

    def __init__(
        self,
        panic: bool = False,
        blackout: bool = False,
        show: str = "",
        generation: int = 0,
        settings: Mapping[str, Fade[Any]] | None = None,
        **named: Any,
    ) -> None:
        """named: like look, look_before, look_since, look_fade_s."""
        fades = dict(settings or {})
        for one in table.LEVERS:
            if one.name in named:
                value = float(named[one.name]) if one is GOING else named[one.name]
                before = named.get(f"{one.name}_before", value if one is GOING else one.default)
                times = named.get(f"{one.name}_since", 0.0), named.get(f"{one.name}_fade_s", 0.0)
                fades[one.name] = Fade(value, before, *times)
        super().__init__(panic, blackout, show, generation, fades)

    @property
    def look(self) -> str:
        return self[LOOK].value

    @property
    def look_before(self) -> str:
        return self[LOOK].before

    def look_mix(self, now: float) -> float:
        return self[LOOK].share(now)

    @property
    def card(self) -> str:
        return self[CARD].value

    @property
    def card_before(self) -> str:
        return self[CARD].before

    def card_mix(self, now: float) -> float:
        return self[CARD].share(now)

    @property
    def camera(self) -> Mapping[str, float | str]:
        return self[CAMERA].value

    @property
    def camera_before(self) -> Mapping[str, float | str]:
        return self[CAMERA].before

    def camera_mix(self, now: float) -> float:
        return self[CAMERA].share(now)

    @property
    def lights(self) -> str:
        return self[LIGHTS].value

    @property
    def lights_before(self) -> str:
        return self[LIGHTS].before

    @property
    def lights_since(self) -> float:
        return self[LIGHTS].since

    @property
    def lights_fade_s(self) -> float:
        return self[LIGHTS].seconds

    @property
    def strings(self) -> float:
        return self[STRINGS].value

    @property
    def master(self) -> float:
        return self[MASTER].value

    def strings_level(self, now: float) -> float:
        return self[STRINGS].level(now)

    @property
    def dance(self) -> Mapping[str, Part]:
        """The parts that stage and generator follow: generation, text, numbers; without a fade of 0 s."""
        parts = {}
        for name, fade in self.settings.items():
            if (one := table.find_lever(name)) is not None and one.follower:
                text, numbers = one.told(fade) if fade.seconds else one.kind.told(fade.value)
                parts[name] = fade.generation, text, numbers
        return parts

    def with_going(self, going: bool, now: float, fade_s: float) -> ShowState:
        return self._to(GOING, float(going), now, fade_s)

    def with_master(self, master: float, now: float, fade_s: float) -> ShowState:
        return self._to(MASTER, master, now, fade_s)

    def with_strings(self, strings: float, now: float, fade_s: float) -> ShowState:
        return self._to(STRINGS, strings, now, fade_s)

    def with_look(self, look: str, now: float, fade_s: float) -> ShowState:
        return self._to(LOOK, look, now, fade_s)

    def with_card(self, card: str, now: float, fade_s: float) -> ShowState:
        return self._to(CARD, card, now, fade_s)

    def with_lights(self, lights: str, now: float, fade_s: float) -> ShowState:
        return self._to(LIGHTS, lights, now, fade_s)

    def with_dance(self, now: float, parts: Mapping[str, tuple[str, tuple[float, ...]]]) -> ShowState:
        changes = [
            Change(one, *one.given(text, numbers))
            for name, (text, numbers) in parts.items()
            if (one := table.find_lever(name)) is not None
        ]
        state = self.changed(now, changes)
        generation = max(state.generation, self.generation + 1, int(1e9 * now))
        return ShowState(state.panic, state.blackout, state.show, generation, state.settings)

    def _to(self, lever: Lever[T], value: T, now: float, seconds: float) -> ShowState:
        state = self.to(lever, value, now, seconds)
        return ShowState(state.panic, state.blackout, state.show, state.generation, state.settings)


class ShowStateReader:
    """Reads the show state of a runtime folder; before one is written the defaults hold: the show runs.

    An unchanged state costs a stat and eight bytes.

    A file that is gone stays in force until another one is written: panic stays panic when the folder is
    emptied, and what is dark does not flash up while a box ends.
    """

    def __init__(self, folder: Path) -> None:
        self._file = RingFileReader(folder / FILE, KIND, 1, "show control")
        self._sequence = 0
        self._show_state = ShowState()

    def read(self) -> ShowState:
        """The newest show state, the same object until it changes. Never waits, never raises."""
        if self._file.look():
            self._sequence = 0
        for ring in self._file.rings:
            if ring.newest_sequence() != self._sequence and (newest := ring.newest()):
                state = unpacked(newest[1])
                self._sequence, self._show_state = (
                    newest[0],
                    ShowState(state.panic, state.blackout, state.show, state.generation, state.settings),
                )
        return self._show_state

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()


class ShowStateWriter:
    """Show control's end: the file outlives it, so that panic stays panic. Raises OSError."""

    def __init__(self, folder: Path) -> None:
        self._block = BlockWriter(folder / FILE, KIND, LARGEST)

    def write(self, show_state: levers.ShowState) -> None:
        """Publish; readers have it from their next read on."""
        self._block.write(packed(show_state))

    def close(self) -> None:
        """Let go of the file; it stays."""
        self._block.close()


def forget_show_state(folder: Path) -> None:
    """A show that ended as it should leaves nothing in force for the next one."""
    (folder / FILE).unlink(missing_ok=True)
