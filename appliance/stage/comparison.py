"""Compares frames that were danced again with the recorded ones: the first that differs, and the worst."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from appliance.recorder.record import RESENT

if TYPE_CHECKING:
    from appliance.stage.tick import Tick

METRES_PER_DEGREE = 0.01  # how far the root may be off where joints may be off by a degree


@dataclass(frozen=True)
class Difference:
    """A tick that came out otherwise than it was recorded: `joint` is off the most, by `degrees`; the root by
    `metres`. message: what else is another.
    """

    tick: int
    at_s: float  # since the start of the run
    joint: str
    degrees: float
    metres: float
    message: str = ""

    def sentence(self) -> str:
        off = f"{self.joint} is off by {self.degrees:.3g} degrees, the root by {1000 * self.metres:.3g} mm"
        return f"tick {self.tick}, at {self.at_s:.2f} s: {self.message or off}."


class Comparison:
    """Looks at each tick after it was run. tolerance_degrees 0: every bit must be the same.

    ticks: how many were looked at; first: the first difference beyond the tolerance; worst: the largest one.
    """

    def __init__(self, begun: float, tolerance_degrees: float) -> None:
        """begun: frame time of the run's first tick."""
        self.ticks = 0
        self.first: Difference | None = None
        self.worst: Difference | None = None
        self._begun, self._tolerance = begun, tolerance_degrees
        self._message = ""

    def look(self, recorded: Any, tick: Tick) -> None:
        """Compare a record with the frame that the tick has just made of it."""
        self.ticks += 1
        message = self._message or _other(recorded, tick)
        self._message = ""
        root, pose = (
            (recorded[name], np.stack([getattr(frame, name) for frame in tick.frame.puppets]))
            for name in ("root", "pose")
        )
        if all(then.tobytes() == here.tobytes() for then, here in (root, pose)) and not message:
            return
        degrees = _degrees_between(*pose)
        joint = int(degrees.argmax()) % len(tick.parts.skeleton)
        metres = float(np.linalg.norm(root[0] - root[1], axis=-1).max())
        found = Difference(
            int(recorded["tick"]),
            float(recorded["frame_time"]) - self._begun,
            tick.parts.skeleton.names[joint],
            float(degrees.max()),
            metres,
            message,
        )
        if self.worst is None or _size(found) > _size(self.worst):
            self.worst = replace(found, message="")
        if self.first is None and (message or self._is_beyond(found)):
            self.first = found

    def note_order(self, name: str, done_then: bool, done_here: bool) -> None:
        """An order was carried out again before the next tick."""
        if done_then != done_here:
            then, here = ("carried out", "refused") if done_then else ("refused", "carried out")
            self._message = f"before it the order '{name}' was {then} then, and is {here} here"

    def _is_beyond(self, found: Difference) -> bool:
        if not self._tolerance:
            return True
        return _size(found) > self._tolerance


def _size(found: Difference) -> float:
    return max(found.degrees, found.metres / METRES_PER_DEGREE)


def _other(recorded: Any, tick: Tick) -> str:
    """Differences from the recording other than the pose, in words."""
    was_late, sequence = bool(recorded["flags"] & RESENT), tick.frame.sensor_sequence
    if was_late != tick.late:
        return "it was late then and is in time here" if was_late else "it was in time then and is late here"
    for puppet, had_failed, then in zip(
        tick.parts.puppets, recorded["failed"].tolist(), recorded["iterations"].tolist(), strict=True
    ):
        if had_failed != puppet.network_failed:
            return "the network failed then" if had_failed else "the network gives no sound poses here"
        here = [puppet.iterations.coding, puppet.iterations.interaction]
        if then != here:
            return f"iterations were {then[0]}/{then[1]}, and are {here[0]}/{here[1]}"
    if int(recorded["sensor_sequence"]) != sequence:
        return f"reading {int(recorded['sensor_sequence'])} went into it then, {sequence} here"
    return ""


def _degrees_between(one: Any, other: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Angles (P, J) between orientations (P, J, 4), exact for small ones."""
    a, b = np.asarray(one, np.float64), np.asarray(other, np.float64)
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    degrees: np.ndarray[Any, np.dtype[np.float64]] = np.degrees(4.0 * np.arcsin(np.clip(chord / 2, 0, 1)))
    return degrees
