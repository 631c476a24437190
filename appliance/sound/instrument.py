"""The instrument: poses in, sound out: strings, their harmony, attacks, master, limiter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.motion_features import TurnFeatures
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.show.light_rules import HAND_RANGES
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.onsets import Floats, Onsets
from appliance.sound.strings import STEP, Samples, Strings, around

FULL_M_S = 3.0  # speed of a bone's end against its start at which its string is bowed fully
FULL_RAD_S = HAND_RANGES["qom"][1]  # a hand that turns as fast bows all strings fully
LONGEST_S = 0.1  # between two poses; a longer gap has no speed
CEILING = 0.9
_RECOVERS_S = 0.5  # in which the limiter lets go
_FOLLOWS_S = 0.03  # in which the bowing follows the dance
# Strings that decay in three seconds grow and fall slowly. So their loudness follows the dance: up within
# the first of these, down within the second, to the share at which a string at rest still sounds.
_RISES_S, _FALLS_S, _RINGS = 0.015, 0.06, 0.12
_DOWN, _UP = 0.6, 0.7  # height of the root on the floor, and up again; shares of the tallest so far


class Instrument:
    """Strings of one skeleton on the loudspeakers of one box. Deterministic: the same poses give the same
    samples. level may come from another thread than dance() and render().

    joints: of the poses that it plays to; of: whose motion that is, see StringsConfig. level: 0..1, master
    and fades; reached within one block, evenly; 0 stops the strings. cue: place of the present cue among
    those of the show, which chooses the harmony.
    """

    def __init__(self, skeleton: Skeleton, strings: StringsConfig, sound: SoundConfig) -> None:
        self._harmonies = [Strings(skeleton, strings, sound.rate, scale=scale) for scale in strings.harmonies]
        self.level, self.cue, self.joints, self.of = 0.0, 0, len(skeleton), strings.of
        self._tallest_m, self._is_down = 0.0, False
        self._rate = sound.rate
        self._pan = around(self.strings.places, sound.channels)
        self._onsets = Onsets(skeleton, self.strings.bones)
        count = len(self.strings.bones)
        self._wanted, self._drive, self._loud, self._strikes = np.zeros((4, count))
        self._level_now, self._limit = 0.0, 1.0
        self._bones: Samples = np.zeros((count, 3))
        self._time, self._hand = -np.inf, TurnFeatures()

    @property
    def strings(self) -> Strings:
        """The strings of the present harmony."""
        return self._harmonies[(self.cue + self._is_down) % len(self._harmonies)]

    def dance(self, positions: Array, seconds: float) -> None:
        """A pose's positions (J, 3), metres, at a time."""
        ends, starts = self.strings.bones[:, 1], self.strings.bones[:, 0]
        bones = positions[ends].astype(float) - positions[starts]
        if elapsed_s := self._elapsed_s(seconds):
            speed: Floats = np.linalg.norm(bones - self._bones, axis=1) / elapsed_s
            self._bow(speed, seconds, elapsed_s, positions)
        self._bones = bones
        height_m = float(positions[0, 1])
        self._tallest_m = max(self._tallest_m, height_m)
        self._is_down = height_m < (_UP if self._is_down else _DOWN) * self._tallest_m

    def turn(self, orientation: Array, seconds: float) -> None:
        """A hand's orientation (4,) at a time, zeros: unknown."""
        elapsed_s = self._elapsed_s(seconds)
        if self._hand.take_frame(orientation, seconds) and elapsed_s:
            speed = FULL_M_S / FULL_RAD_S * float(self._hand.numbers["qom"][0])
            self._bow(np.full(len(self._wanted), speed), seconds, elapsed_s)

    def couple(self, shares: Array, seconds: float) -> None:
        """How closely each joint (J,) is coupled at a time, 0..1; a coupling that sets in is struck."""
        if elapsed_s := self._elapsed_s(seconds):
            speed: Floats = FULL_M_S * shares[self.strings.bones[:, 1]].astype(float)
            self._bow(speed, seconds, elapsed_s)

    def _elapsed_s(self, seconds: float) -> float:
        """Since the call before; 0 after a gap."""
        elapsed_s, self._time = seconds - self._time, seconds
        return elapsed_s if 0.0 < elapsed_s <= LONGEST_S else 0.0

    def _bow(self, speed: Floats, seconds: float, elapsed_s: float, positions: Array | None = None) -> None:
        """Bow and strike the strings by speeds (B,), metres a second; positions: of feet, which land."""
        self._wanted = np.minimum(speed / FULL_M_S, 1.0) ** 1.5
        where: Array = np.zeros((self.joints, 3)) if positions is None else positions
        self._strikes = self._strikes + self._onsets.strikes(speed, where, seconds, elapsed_s)

    def rest(self) -> None:
        """No pose comes: the strings ring out."""
        self._wanted, self._time = np.zeros_like(self._wanted), -np.inf
        self._onsets.begin_anew()

    def render(self, frames: int) -> NDArray[np.float32]:
        """The next samples (frames, channels), within -1..1; frames: a multiple of STEP."""
        steps, level, played = frames // STEP, self.level, self.strings
        strikes, self._strikes = self._strikes, np.zeros_like(self._strikes)
        if strikes.any():
            played.strike(strikes)
        drive, loud = self._follow(steps, strikes)
        sound = played.render(drive, self._pan, loud)
        for other in self._harmonies:
            if other is not played and other.rings:  # a harmony that was left rings out
                sound += other.render(np.zeros_like(drive), self._pan, loud)
        sound *= np.linspace(self._level_now, level, frames + 1)[1:, None]
        if level == 0.0 and self._level_now == 0.0:
            for each in self._harmonies:
                each.still()
        self._level_now = level
        peak = float(np.abs(sound).max(initial=0.0))
        before, wanted = self._limit, min(1.0, CEILING / max(peak, 1e-9))
        self._limit = min(wanted, before + frames / (_RECOVERS_S * self._rate))
        sound *= np.linspace(before, self._limit, frames + 1)[1:, None]
        return np.clip(sound, -1.0, 1.0).astype(np.float32)

    def _follow(self, steps: int, strikes: Samples) -> tuple[Samples, Samples]:
        """How strongly strings are bowed (steps, B) and how loud they are (steps + 1, B), after the dance."""
        times = (_FOLLOWS_S, _RISES_S, _FALLS_S)
        bows, rises, falls = (1.0 - np.exp(-STEP / (time_s * self._rate)) for time_s in times)
        drive = np.empty((steps, len(self._drive)))
        loud = np.empty((steps + 1, len(self._drive)))
        loud[0] = self._loud
        struck = strikes > 0.0
        for step in range(steps):
            self._drive = self._drive + bows * (self._wanted - self._drive)
            drive[step] = self._drive
            wanted = _RINGS + (1.0 - _RINGS) * np.minimum(np.sqrt(self._wanted) * 1.5, 1.0)
            wanted = np.where(struck, 1.0, wanted)
            self._loud = self._loud + np.where(wanted > self._loud, rises, falls) * (wanted - self._loud)
            loud[step + 1] = self._loud
        return drive, loud
