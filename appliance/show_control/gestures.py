"""Gestures that call cues: the hands in the shared frame are watched, and new gestures recorded."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import numpy as np

from appliance.box.block import BlockWriter
from appliance.outputs.shared_frame import Facts
from appliance.sensor.gesture_memory import (
    FILE_NAME,
    MOST,
    gesture_file,
    gesture_record,
    gestures_text,
    read_gestures,
)
from appliance.sensor.gestures import RATE_HZ, REPETITIONS, Floats, Gesture, Recogniser, Repetitions, learned
from appliance.show.config_error import did_you_mean
from appliance.show_control.stage_observer import StageObserver

_log = logging.getLogger(__name__)

LOOK_S = 0.08  # how long control sleeps at most while a hand may make a gesture
RECORD_S = 60.0  # within which the repetitions have to come
_EVERY = round(50 / RATE_HZ)  # frames of the stage from one look to the next
_MOST_MISSING = 10  # frames; after a longer gap the stream begins anew
_AT_ONCE = 40  # frames that are read at once
_BACKGROUND = round(600 * RATE_HZ)  # orientations of ordinary motion that are remembered


class _Recording(NamedTuple):
    name: str
    cue: str
    until: float
    repetitions: dict[str, Repetitions]  # by hand


class _Learning(Thread):
    """Compares with minutes of ordinary motion, for a second: commands are heard meanwhile.

    found: the gesture, or why there is none.
    """

    def __init__(self, show: str, learn: Callable[[], Gesture]) -> None:
        super().__init__(daemon=True)
        self.show, self._learn = show, learn
        self.found: Gesture | ValueError | None = None
        self.start()

    def run(self) -> None:
        try:
            self.found = self._learn()
        except ValueError as error:
            self.found = error


class _Hand:
    """A hand's stream: what it does usually, and its recogniser."""

    def __init__(self, row: int) -> None:
        self.row, self.recogniser = row, Recogniser()
        self.before: Floats | None = None
        self._usual = np.zeros((_BACKGROUND, 4), np.float32)
        self._count = 0

    def remember(self, orientation: Floats) -> None:
        self._usual[self._count % _BACKGROUND] = orientation
        self._count += 1

    @property
    def background(self) -> Floats:
        """(N, 4), oldest first."""
        if self._count <= _BACKGROUND:
            return self._usual[: self._count]
        return np.roll(self._usual, -(self._count % _BACKGROUND), axis=0)


class Gestures:
    """Watches the hands of the puppet that cues lead. call: calls a cue by its name.

    Gestures go into the runtime folder, which is memory; the keeper carries them to the disk.
    """

    def __init__(
        self,
        folder: Path,
        state: Path | None,
        observer: StageObserver,
        call: Callable[[str, float], None],
    ) -> None:
        """state: the folder on the disk; None: gestures last for this run."""
        self._observer, self._call = observer, call
        self._shows: dict[str, list[Gesture]] = {}
        self._writer: BlockWriter | None = None
        self._hands: dict[str, _Hand] = {}
        self._show, self._generation, self._tick = "", -1, -1
        self._recording: _Recording | None = None
        self._learning: _Learning | None = None
        self.message = ""  # about the newest recording
        if state is not None:
            self._read(folder, state)
            try:
                self._writer = gesture_record(state).writer(folder)
            except OSError as error:
                self._complain(f"{folder}: {error.strerror}")

    @property
    def sleeps_s(self) -> float:
        """How long nobody has to look."""
        return LOOK_S if self._recording or self._learning or self._shows.get(self._show) else float("inf")

    def look(self, now: float) -> None:
        """Read the frames that have come; call a cue, or take a repetition."""
        facts = self._observer.facts
        if facts is None:
            return
        if self._observer.generation != self._generation:
            self._generation, self._show, self._tick = self._observer.generation, facts.show_name, -1
            self._hands = {joint: _Hand(row) for joint, row in _hands_of(facts).items()}
            self._recording = None
            self._share_out()
        if self._learning is not None and not self._learning.is_alive():
            self._take_learned(self._learning)
        if not self._hands:
            return
        for frame in self._observer.frames(_AT_ONCE, now):
            if frame.tick <= self._tick or frame.tick % _EVERY or frame.late:
                continue
            if frame.tick - self._tick > _MOST_MISSING:
                self._begin_anew()
            self._tick = frame.tick
            for joint, hand in self._hands.items():
                self._take(joint, hand, frame.hands[hand.row], now)
        if self._recording is not None and now > self._recording.until:
            self._end(
                f"The gesture '{self._recording.name}' was not made {REPETITIONS} times: none is learned."
            )

    def record(self, name: str, cue: str, now: float) -> str:
        """Learn a gesture from the next repetitions; what to do, in a sentence. Raises ValueError."""
        facts = self._observer.facts
        cues = [] if facts is None else [str(one["name"]) for one in facts.cues]
        if cue not in cues:
            cure = did_you_mean(cue, cues) if cues else "It has none at all: show.yaml names them."
            raise ValueError(f"This show has no cue '{cue}'. {cure}")
        if not self._hands:
            raise ValueError("No hand of this show points a joint. Give it one under `hands` in show.yaml.")
        if len([one for one in self._own if one.name != name]) >= MOST:
            raise ValueError(f"This show has {MOST} gestures already. Forget one first: /gesture/forget.")
        self._recording = _Recording(
            name, cue, now + RECORD_S, {joint: Repetitions() for joint in self._hands}
        )
        self.message = (
            f"Make the gesture {REPETITIONS} times within {RECORD_S:g} s. Hold still before and after each."
        )
        return self.message

    def stop(self) -> str:
        """Learn nothing from what was made so far."""
        if self._recording is None:
            return "No gesture is being recorded."
        self._end(f"The gesture '{self._recording.name}' is not recorded.")
        return self.message

    def forget(self, name: str) -> str:
        """Raises ValueError for a name that this show does not have."""
        self._own.remove(self._named(name))
        self._share_out()
        self._write()
        return f"The gesture '{name}' is forgotten."

    def rename(self, name: str, new: str) -> str:
        """Raises ValueError for a name that this show does not have, and for one that is taken."""
        gesture = self._named(name)
        if any(one.name == new for one in self._own):
            raise ValueError(f"This show has a gesture '{new}' already.")
        gesture.name = new
        self._write()
        return f"The gesture '{name}' is called '{new}' now."

    def reported(self) -> dict[str, Any]:
        """For the page: list (name, cue, hand), recording (name, repetitions that have come), a sentence."""
        recording = self._recording
        return {
            "list": [{"name": one.name, "cue": one.cue, "hand": one.hand} for one in self._own],
            "recording": None
            if recording is None
            else {"name": recording.name, "come": self._come(recording)},
            "most": REPETITIONS,
            "message": self.message,
        }

    def close(self) -> None:
        """Let go of the file; its content stays."""
        if self._writer is not None:
            self._writer.close()

    @property
    def _own(self) -> list[Gesture]:
        """Those of the show that dances."""
        return self._shows.setdefault(self._show, [])

    def _named(self, name: str) -> Gesture:
        for one in self._own:
            if one.name == name:
                return one
        names = [one.name for one in self._own]
        cure = did_you_mean(name, names) if names else "It has none at all: /gesture/record learns one."
        raise ValueError(f"This show has no gesture '{name}'. {cure}")

    def _take(self, joint: str, hand: _Hand, orientation: Floats, now: float) -> None:
        if not orientation.any():
            return
        before, hand.before = hand.before, orientation.copy()
        if before is None:
            return
        if float(orientation @ before) < 0.0:
            orientation = -orientation
            hand.before = orientation.copy()
        if self._recording is not None:
            repetitions = self._recording.repetitions[joint]
            repetitions.take(orientation, before)
            if repetitions.is_done:
                self._learn(joint, repetitions.takes)
            return
        hand.remember(orientation)
        found = hand.recogniser.take(orientation, now)
        if found is not None:
            _log.info(f"The gesture '{found.name}' calls cue {found.cue}.")
            self._call(found.cue, now)

    def _learn(self, joint: str, takes: list[Floats]) -> None:
        assert self._recording is not None
        name, cue = self._recording.name, self._recording.cue
        usual = self._hands[joint].background.copy()
        self._recording = None
        self._learning = _Learning(self._show, lambda: learned(name, cue, joint, takes, usual))

    def _take_learned(self, learning: _Learning) -> None:
        self._learning = None
        if isinstance(learning.found, ValueError):
            self._end(str(learning.found))
        elif learning.found is not None and learning.show == self._show:
            new = learning.found
            self._shows[self._show] = [*(one for one in self._own if one.name != new.name), new]
            self._end(f"The gesture '{new.name}' of {new.hand} calls cue {new.cue} from now on.")
            self._share_out()
            self._write()

    def _end(self, message: str) -> None:
        self._recording, self.message = None, message
        _log.info(message)
        self._begin_anew()

    def _begin_anew(self) -> None:
        for hand in self._hands.values():
            hand.before = None
            hand.recogniser.begin_anew()

    def _share_out(self) -> None:
        """Each hand looks for its own gestures."""
        for joint, hand in self._hands.items():
            hand.recogniser.gestures = tuple(one for one in self._own if one.hand == joint)

    def _come(self, recording: _Recording) -> int:
        return max(len(one.takes) for one in recording.repetitions.values())

    def _write(self) -> None:
        if self._writer is None:
            return
        try:
            self._writer.write(gestures_text(self._shows))
        except ValueError as error:
            self._complain(str(error))

    def _complain(self, reason: str) -> None:
        _log.warning(f"Gestures cannot be kept ({reason}): they last until show control is started again.")

    def _read(self, folder: Path, state: Path) -> None:
        """The last show control's gestures in memory, or else those on the disk."""
        with closing(gesture_record(state).reader(folder)) as reader:
            text = reader.read()
        try:
            found = [text] if text else gesture_file(state).read()
            for one in found:
                self._shows = read_gestures(one)
        except (OSError, ValueError) as error:
            _log.warning(
                f"{state / FILE_NAME}: the gestures in it cannot be read ({error}). Record them again."
            )


def _hands_of(facts: Facts) -> dict[str, int]:
    """The hands that cues lead and that point a joint, and their rows in the frame."""
    found, row = {}, 0
    for puppet in facts.puppets:
        for hand in puppet.hands:
            if puppet.is_led and hand.by == "orientation" and hand.source not in ("springs", "kept", "fixed"):
                found[hand.joint] = row
            row += 1
    return found
