"""Phrase: a recording prepared at the start, so that switching to it costs the tick nothing."""

from __future__ import annotations

import numpy as np

from appliance.dancer.grounding import Floor
from appliance.dancer.loop import Loop
from appliance.pose.recording import Recording

FPS = 50.0
# Columns of a track: the root in metres, how far the figure is lifted off the floor, heights of the points
# of its soles while they stand (as many as the skeleton has), the phrase's number and the second in it.
X, Y, Z, LIFT, STANDING = range(5)
NUMBER, AT = -2, -1
SHARED = 48  # frames that an improvisation has in common with the loop that it goes on from


class PhraseError(ValueError):
    """A phrase, or the excerpt of it, that has fewer poses than a window, or other joints."""


class Phrase:
    """A recording at the tick's rate: poses (N, J, 4) and track (N, C), float32, from which loops are cut.

    The track carries the phrase's floor through loops and crossfades, like the root's position.
    """

    def __init__(
        self, number: int, name: str, recording: Recording, floor: Floor | None, fade: int, window: int
    ) -> None:
        """floor None: figures stay where the phrase has them. fade: frames; window: the fewest poses."""
        source = recording.resampled(FPS)
        self.name = name
        self.skeleton = source.skeleton
        self._fade, self._window = fade, window
        self._poses = np.ascontiguousarray(source.poses, dtype=np.float32)
        soles = 0 if floor is None else len(floor.rest_heights)
        self._track = np.zeros((len(source), STANDING + soles + 2), dtype=np.float32)
        self._track[:, :LIFT] = source.roots
        self._track[:, NUMBER] = number
        if floor is not None:
            self._track[:, LIFT] = floor.lifts
            self._track[:, STANDING:NUMBER] = floor.rest_heights

    def cut(self, start_s: float, end_s: float | None) -> Loop:
        """A part of the phrase, in seconds, as an endless loop. Raises PhraseError."""
        count = len(self._poses)
        first = round(start_s * FPS)
        last = count if end_s is None else min(round(end_s * FPS), count)
        if first < 0 or last - first < self._window:
            part = f"from {start_s:g} s to {end_s if end_s is not None else count / FPS:g} s"
            raise PhraseError(
                f"The phrase has {count} poses ({count / FPS:.2f} s); the part {part} leaves "
                f"{max(last - first, 0)}, and the puppet needs {self._window}. "
                "Nothing can be danced. Choose a longer part or a longer phrase."
            )
        return Loop(self._poses[first:last], self._track[first:last], self._fade, first / FPS)
