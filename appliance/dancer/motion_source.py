"""Motion source: endless playback of phrases in windows of 8 poses, controllable while it runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from appliance.dancer.grounding import Floor
from appliance.dancer.loop import Loop, Placement
from appliance.dancer.phrase import AT, FPS, LIFT, NUMBER, STANDING, Phrase, X, Z
from appliance.dancer.playhead import Playhead, Reader
from appliance.dancer.repertoire import Made, Repertoire
from appliance.dancer.slerp import FloatArray, Slerp
from appliance.levers.sources import MAIN
from appliance.pose.ease import ease
from appliance.pose.recording import Recording

_ROWS = 256  # poses before it moves back to the start of its memory

_HURRY = 25  # ticks that a long crossfade takes at most, once the next change waits for it

MAX_RATE = 4.0
RATE_CHANGE_PER_TICK = 0.08  # from standing to full speed in a quarter of a second
_FRAME_DIGITS = 2  # rounding of a place to start at: its seconds are exact to some thousandths of a frame


class Playback:
    """Plays one of its phrases endlessly. Each tick: read window() and roots(), then advance().

    The motion is one continuous stream; the window is its next 8 poses, the first of them the pose of this
    tick. Every change (phrase, jump, excerpt, rate) enters at the far end of the window, 7 ticks before the
    audience sees it. Loops and changes carry on the root's position and heading. Times are seconds of the
    phrase that plays. Only the thread that advances it may call the control methods: a change sets several
    fields.
    """

    SNAPSHOT = ("_rate", "_wanted_rate", "_on_the_way", "_entered_at", "jumped", "_stream")

    def __init__(
        self,
        phrase: Recording,
        *,
        start_s: float = 0.0,
        end_s: float | None = None,
        rate: float = 1.0,
        crossfade_s: float = 0.5,
        window: int = 8,
        floor: Floor | None = None,
    ) -> None:
        """Starts with a phrase, `main`; start_s and end_s cut an excerpt. `floor`: of the grounding.

        Raises PhraseError, or ValueError for an excerpt or a rate that makes no sense.
        """
        self._window = window
        self._fade = max(0, round(crossfade_s * FPS))
        self._rate = self._wanted_rate = _checked_rate(rate)
        self._asked = Phrase(0, MAIN, phrase, floor, self._fade, window)
        self._excerpt = self._asked.cut(start_s, end_s)
        self._repertoire = Repertoire(self._asked, self._excerpt, self._fade, window)
        joints, columns = len(phrase.skeleton), self._excerpt.track.shape[1]
        self._request: tuple[Loop, float, int] | None = None
        self._clear_memory(joints, columns)
        self._begin()

    def another(self, name: str, start_s: float = 0.0) -> Playback:
        """Before the first tick: another playback of the same phrases, which both share; it starts with
        this phrase at this second, clamped. Raises ValueError.
        """
        other = copy(self)
        other._repertoire = self._repertoire.another()
        other._asked, loop = other._repertoire.find(name)
        other._excerpt = loop
        other._clear_memory(loop.poses.shape[1], loop.track.shape[1])
        other._begin(min(max((start_s - loop.start_s) * FPS, 0.0), loop.length - 1.0))
        return other

    def add(self, name: str, phrase: Recording, floor: Floor | None = None) -> None:
        """Add a phrase of the same skeleton before the first tick. Raises PhraseError."""
        self._repertoire.add(name, phrase, floor)

    @property
    def phrases(self) -> tuple[str, ...]:
        """Names of all phrases, the show's first phrase first."""
        return self._repertoire.names

    def loop_of(self, name: str) -> Loop:
        """The whole loop of a phrase. Raises ValueError."""
        return self._repertoire.find(name)[1]

    def make_by(self, make: Callable[[str], Loop]) -> None:
        """Set where the loops of recipes come from; it raises ValueError."""
        self._repertoire.make = make

    def made_by(self, recipe: str) -> Loop:
        """The loop of a recipe. Raises ValueError."""
        return self._repertoire.make(recipe)

    def window(self) -> FloatArray:
        """The next poses (window, J, 4) of the motion, without sign jumps; valid until advance()."""
        return self._stream.poses

    def roots(self) -> FloatArray:
        """The root's position (window, 3) in metres at the poses of the window."""
        return self._stream.roots

    @property
    def lift(self) -> float:
        """How far the phrase is above the floor (metres) at the window's first pose."""
        return self._stream.lift

    @property
    def rest_heights(self) -> FloatArray | None:
        """Heights (S,) in metres of the soles' points while they stand, at the window's first pose."""
        heights = self._stream.rest_heights
        return heights if len(heights) else None

    @property
    def phrase(self) -> str:
        """Name of the phrase of the window's first pose; in a crossfade the entering one."""
        return self._repertoire.name_of(self._stream.number)

    @property
    def number(self) -> int:
        """Number of the phrase or of what was made, of the window's first pose."""
        return self._stream.number

    @property
    def standing(self) -> tuple[float, float, float]:
        """The root on the stage at the window's first pose: x, z in metres, heading in radians."""
        return self._stream.standing

    @property
    def made(self) -> Made | None:
        """The motion made ahead that dances now or is about to; None: a phrase."""
        return self._repertoire.made(self._excerpt)

    @property
    def base(self) -> str:
        """Name of the phrase that was danced last, or dances."""
        return self._asked.name

    @property
    def position_s(self) -> float:
        """Position of the window's first pose in the phrase, seconds."""
        return self._stream.position_s

    @property
    def rate(self) -> float:
        """Speed: 1 as recorded, 0 standing, negative backwards. Set it; it is reached within a second."""
        return self._wanted_rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._wanted_rate = _checked_rate(rate)

    @property
    def excerpt_s(self) -> tuple[float, float]:
        """First and last second of the part of the phrase that plays or is about to."""
        loop = self._excerpt if self.made is None else self._repertoire.find(self.base)[1]
        return loop.start_s, loop.start_s + loop.length / FPS

    @property
    def going_on(self) -> tuple[str, float, int]:
        """Where a restarted playback continues: phrase, second, and the number of what was made, else 0."""
        made = self.made
        number = 0 if made is None else made.number
        if self._request is not None:
            loop, position, _ = self._request
        elif self._on_the_way:
            loop, position = self._head.loop, self._entered_at
        else:
            return (self.phrase if made is None else self.base), self.position_s, number
        return self._asked.name, loop.start_s + position / FPS, number

    def jump(self, to_s: float) -> None:
        """Continue at another second of the phrase, clamped to the excerpt, with a crossfade.

        During a crossfade it waits until that one is over, and hurries a long one; of several that wait the
        last counts.
        """
        loop = self._excerpt
        self._request = loop, min(max((to_s - loop.start_s) * FPS, 0.0), loop.length - 1.0), self._fade

    def excerpt(self, start_s: float, end_s: float | None = None) -> None:
        """Play another part of the phrase from its start, with a crossfade. Raises PhraseError."""
        self._excerpt = self._asked.cut(start_s, end_s)
        self._request = self._excerpt, 0.0, self._fade

    def play(self, name: str, fade_s: float | None = None) -> bool:
        """Switch to another phrase within fade_s (None: the show's crossfade). Raises ValueError.

        It begins at its start (backwards: at its end); one that plays already goes on where it is, told by
        False. An excerpt that was chosen meanwhile is forgotten: the phrase is what it was at the beginning.
        """
        phrase, loop = self._repertoire.find(name)
        if loop is self._excerpt:
            return False
        begin = loop.length - 1.0 if self._wanted_rate < 0 else 0.0
        if self.made is not None and self.made.phrase == name:
            begin = self._in_step(loop)
        self._asked, self._excerpt = phrase, loop
        self._request = loop, begin, self._fade if fade_s is None else max(0, round(fade_s * FPS))
        return True

    def enter(self, recipe: str, loop: Loop, fade_s: float) -> None:
        """Switch within fade_s to a loop that was made ahead: in step with the phrase that it follows or the
        loop that it goes on from, else from its start. Raises ValueError for no recipe.
        """
        made = self._repertoire.take(recipe, loop)
        here, position, _ = self._request or (self._head.loop, self._head.position, 0)
        begin = self._in_step(loop) if made.phrase == self.base else made.begin_after(here, position)
        self._excerpt, self._request = loop, (loop, begin, max(0, round(fade_s * FPS)))

    def _in_step(self, loop: Loop) -> float:
        """The frame of a loop at the second that is reached, also by what is still to come."""
        here, position, _ = self._request or (self._head.loop, self._head.position, 0)
        frame = (here.start_s - loop.start_s) * FPS + position
        return min(max(frame, 0.0), loop.length - 1.0)

    def start_with(self, name: str) -> None:
        """Before the first tick: start with this phrase instead, without a crossfade. Raises ValueError."""
        self.play(name)
        self._begin()

    def start_at(
        self,
        name: str,
        excerpt_s: tuple[float, float],
        position_s: float,
        rate: float,
        standing: tuple[float, float, float],
        made: tuple[str, Loop] | None = None,
    ) -> None:
        """Before the first tick: continue another playback from its going_on, excerpt_s and standing.

        made: recipe and loop that it danced, if they were made ahead. Without a crossfade, at once at this
        rate. Raises ValueError for what this show does not have.
        """
        phrase, loop = self._repertoire.find(name)
        whole_s = loop.start_s, loop.start_s + loop.length / FPS
        if max(abs(one - other) for one, other in zip(whole_s, excerpt_s, strict=True)) > 0.5 / FPS:
            loop = phrase.cut(*excerpt_s)
        self._rate = self._wanted_rate = _checked_rate(rate)
        if made is not None:
            loop = self._repertoire.take(*made).loop
        self._asked, self._excerpt = phrase, loop
        position = round((position_s - loop.start_s) * FPS, _FRAME_DIGITS)
        self._begin(min(max(position, 0.0), loop.length - 1.0), standing)

    def return_home(self, from_m: float) -> None:
        """Stand in the middle of the stage, where a walk has led farther away than from_m metres."""
        x, z, _ = self.standing
        if not math.hypot(x, z) > from_m:
            return
        for head in filter(None, (self._head, self._crossfade.leaving)):
            place = head.placement
            head.placement = Placement(place.yaw, place.x - x, place.z - z)
        self._stream.tracks[:, [X, Z]] -= np.array((x, z), np.float32)

    def advance(self) -> None:
        """Advance by one tick. `jumped`: whether a jump began in it."""
        self.jumped = False
        leaving = self._crossfade.leaving
        if self._request is not None and leaving is None:
            (loop, position, fade), self._request = self._request, None
            self._cross_over(loop, position, fade)
            self.jumped = True
        elif self._request is not None:
            self._crossfade.hurry(self._fade)
        elif self._rate < 0 and leaving is None and self._head.position < self._head.loop.fade:
            # Backwards out of the first frames, before the first loop: the end does not lead here by itself.
            loop = self._head.loop
            self._cross_over(loop, self._head.position + loop.period, self._fade)
        self._rate += min(max(self._wanted_rate - self._rate, -RATE_CHANGE_PER_TICK), RATE_CHANGE_PER_TICK)
        self._push()

    def state(self) -> dict[str, Any]:
        """The loops and heads that later poses depend on, as plain values and arrays."""
        repertoire, request, leaving = self._repertoire, self._request, self._crossfade.leaving
        return {
            "asked": self._asked.name,
            "excerpt": repertoire.named(self._excerpt),
            "head": repertoire.head_state(self._head),
            "leaving": None if leaving is None else repertoire.head_state(leaving),
            "fade": self._crossfade.times,
            "request": None if request is None else [repertoire.named(request[0]), *request[1:]],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a state, with the same phrases. Raises KeyError, ValueError."""
        repertoire = self._repertoire
        self._asked, _ = repertoire.find(state["asked"])
        self._excerpt = repertoire.loop(state["excerpt"])
        self._head = repertoire.head(state["head"])
        leaving, request = state["leaving"], state["request"]
        left = repertoire.head(leaving) if leaving is not None else None
        self._crossfade = Crossfade.restored(left, state["fade"])
        self._request = None if request is None else (repertoire.loop(request[0]), *request[1:])

    def _clear_memory(self, joints: int, columns: int) -> None:
        self._reader, self._between_heads = Reader(joints), Slerp(joints, short=False)
        self._entering_track = np.empty(columns, dtype=np.float32)
        self._stream = Stream(joints, columns, self._window)

    def _begin(self, position: float = 0.0, standing: tuple[float, float, float] | None = None) -> None:
        """Stand at a frame of the phrase, with a full window; `standing`: there on the stage."""
        self._head = Playhead(self._excerpt, position, self._excerpt.poses[int(position)].copy())
        if standing is not None:
            self._reader.read(self._head, self._entering_track)
            x, z = self._entering_track[[X, Z]].tolist()
            w, _, y, _ = self._head.pose[0].tolist()
            self._head.placement = Placement.bringing((x, z, 2 * math.atan2(y, w)), standing)
        self._on_the_way, self._entered_at = 0, position
        self._crossfade, self._request = Crossfade(), None
        self.jumped = False
        self._stream.clear()
        for _ in range(self._window):
            self._push()

    def _push(self) -> None:
        """Append one pose to the played motion and move the heads."""
        self._on_the_way = max(0, self._on_the_way - 1)
        pose, track = self._stream.next_row()
        leaving = self._crossfade.leaving
        if leaving is None:
            self._reader.read(self._head, track)
            pose[:] = self._head.pose
        else:
            share = self._crossfade.advance()
            self._reader.read(leaving, track)
            self._reader.read(self._head, self._entering_track)
            self._between_heads(leaving.pose, self._head.pose, share, pose)
            track += share * (self._entering_track - track)
            track[NUMBER:] = self._entering_track[NUMBER:]
            leaving.move(self._rate)
            self._crossfade.end_if_over()
        self._head.move(self._rate)
        self._stream.append()

    def _cross_over(self, loop: Loop, position: float, fade: int) -> None:
        """Start a crossfade of `fade` ticks to another position of a loop, placed where the figure stands."""
        leaving = self._head
        entering = Playhead(loop, position, leaving.pose.copy())
        entering.placement = Placement.bringing(entering.standing, leaving.standing)
        self._head, self._crossfade = entering, Crossfade(leaving, fade)
        self._on_the_way, self._entered_at = self._window, position


def _checked_rate(rate: float) -> float:
    if not -MAX_RATE <= rate <= MAX_RATE:
        raise ValueError(f"The rate is {rate:g}; playback can run from {-MAX_RATE:g} to {MAX_RATE:g} times.")
    return rate


class Crossfade:
    """leaving: the head that is left; None: there is no crossfade."""

    def __init__(self, leaving: Playhead | None = None, fade: int = 0) -> None:
        """fade: ticks; 0: the leaving head is gone at once."""
        self.leaving = leaving if fade else None
        self._tick, self._length = 0.0, fade + 1.0

    def advance(self) -> float:
        """A tick on: how much of the entering head is there, 0 to 1."""
        self._tick += 1.0
        return ease(self._tick / self._length)

    def end_if_over(self) -> None:
        """Drop the leaving head after the last tick of the crossfade."""
        if self._tick > self._length - 1.5:
            self.leaving = None

    def hurry(self, fade: int) -> None:
        """End a long crossfade sooner, from its present state: the next change, of `fade` ticks, waits."""
        soon = max(_HURRY, fade + 1.0)
        if self._length - self._tick > soon:
            self._length *= soon / (self._length - self._tick)
            self._tick = self._length - soon

    @property
    def times(self) -> list[float]:
        """For `restored`."""
        return [self._tick, self._length]

    @staticmethod
    def restored(leaving: Playhead | None, times: list[float]) -> Crossfade:
        """The crossfade of a snapshot: its leaving head, and `times`."""
        crossfade = Crossfade()
        crossfade.leaving, (crossfade._tick, crossfade._length) = leaving, times
        return crossfade


class Stream:
    """Poses (J, 4) and tracks (C,) of the next `window` ticks, this tick first."""

    SNAPSHOT = ("poses", "tracks")

    def __init__(self, joints: int, columns: int, window: int) -> None:
        self._window, self._end = window, 0
        self._poses = np.zeros((_ROWS, joints, 4), dtype=np.float32)
        self._poses[..., 0] = 1.0
        self._tracks = np.zeros((_ROWS, columns), dtype=np.float32)

    def clear(self) -> None:
        """Empty the stream: append `window` rows before reading."""
        self._end = 0

    def next_row(self) -> tuple[FloatArray, FloatArray]:
        """The arrays for the next pose and its track; `append` then makes them the newest row."""
        if self._end == len(self._poses):
            self._move_to_start()
        return self._poses[self._end], self._tracks[self._end]

    def append(self) -> None:
        """Append what was written into next_row."""
        self._end += 1

    @property
    def poses(self) -> FloatArray:
        """The window's poses (window, J, 4); valid until the next row is appended."""
        return self._poses[self._end - self._window : self._end]

    @property
    def tracks(self) -> FloatArray:
        """The window's tracks (window, C); valid as long."""
        return self._tracks[self._end - self._window : self._end]

    @property
    def roots(self) -> FloatArray:
        """The window's roots (window, 3) in metres."""
        return self.tracks[:, :3]

    @property
    def lift(self) -> float:
        """How far the first pose is above the floor, metres."""
        return float(self._tracks[self._end - self._window, LIFT])

    @property
    def rest_heights(self) -> FloatArray:
        """Heights (S,) in metres of the soles' points at the first pose while they stand; (0,) for none."""
        heights: FloatArray = self._tracks[self._end - self._window, STANDING:NUMBER]
        return heights

    @property
    def number(self) -> int:
        """Number of the phrase that the first pose comes from."""
        return round(float(self._tracks[self._end - self._window, NUMBER]))

    @property
    def position_s(self) -> float:
        """Second in the phrase that the first pose comes from."""
        return float(self._tracks[self._end - self._window, AT])

    @property
    def standing(self) -> tuple[float, float, float]:
        """The root at the first pose: x, z in metres, heading in radians."""
        first = self._end - self._window
        x, z = self._tracks[first, [X, Z]].tolist()
        w, _, y, _ = self._poses[first, 0].tolist()
        return x, z, 2 * math.atan2(y, w)

    def _move_to_start(self) -> None:
        kept = self._window
        self._poses[:kept] = self._poses[-kept:]
        self._tracks[:kept] = self._tracks[-kept:]
        self._end = kept
