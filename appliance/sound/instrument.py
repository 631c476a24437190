"""The instrument: poses in, sound out: strings, master, limiter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.strings import STEP, Samples, Strings, around

FULL_M_S = 3.0  # speed of a bone's end against its start at which its string is bowed fully
LONGEST_S = 0.1  # between two poses; a longer gap has no speed
CEILING = 0.9
_RECOVERS_S = 0.5  # in which the limiter lets go
_FOLLOWS_S = 0.03  # in which the bowing follows the dance


class Instrument:
    """Strings of one skeleton on the loudspeakers of one box. Deterministic: the same poses give the same
    samples. dance() and level may come from another thread than render().

    level: 0..1, master and fades; reached within one block, evenly. 0 stops the strings.
    """

    def __init__(self, skeleton: Skeleton, strings: StringsConfig, sound: SoundConfig) -> None:
        self.strings = Strings(skeleton, strings, sound.rate)
        self.level = 0.0
        self._rate = sound.rate
        self._pan = around(self.strings.places, sound.channels)
        self._wanted = np.zeros(len(self.strings.bones))
        self._drive = self._wanted.copy()
        self._level_now, self._limit = 0.0, 1.0
        self._before: tuple[float, Samples] | None = None

    def dance(self, positions: Array, seconds: float) -> None:
        """A pose's positions (J, 3), metres, at a time."""
        ends, starts = self.strings.bones[:, 1], self.strings.bones[:, 0]
        bones = positions[ends].astype(float) - positions[starts]
        if self._before is not None and 0.0 < seconds - self._before[0] <= LONGEST_S:
            speed = np.linalg.norm(bones - self._before[1], axis=1) / (seconds - self._before[0])
            self._wanted = np.minimum(speed / FULL_M_S, 1.0) ** 1.5
        self._before = seconds, bones

    def rest(self) -> None:
        """No pose comes: the strings ring out."""
        self._wanted, self._before = np.zeros_like(self._wanted), None

    def render(self, frames: int) -> NDArray[np.float32]:
        """The next samples (frames, channels), within -1..1; frames: a multiple of STEP."""
        steps, level = frames // STEP, self.level
        share = 1.0 - np.exp(-STEP / (_FOLLOWS_S * self._rate))
        drive = np.empty((steps, len(self._drive)))
        for step in range(steps):
            self._drive = self._drive + share * (self._wanted - self._drive)
            drive[step] = self._drive
        sound = self.strings.render(drive, self._pan)
        sound *= np.linspace(self._level_now, level, frames + 1)[1:, None]
        if level == 0.0 and self._level_now == 0.0:
            self.strings.still()
        self._level_now = level
        peak = float(np.abs(sound).max(initial=0.0))
        before, wanted = self._limit, min(1.0, CEILING / max(peak, 1e-9))
        self._limit = min(wanted, before + frames / (_RECOVERS_S * self._rate))
        sound *= np.linspace(before, self._limit, frames + 1)[1:, None]
        return np.clip(sound, -1.0, 1.0).astype(np.float32)
