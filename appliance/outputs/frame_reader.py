"""The readers' end of the shared frame: the newest frames, whole or not at all, whatever the stage does."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.shared_frame import Facts

State = Literal["absent", "fresh", "stale"]
STALE_S = 0.5


@dataclass(frozen=True, slots=True)
class SeenFrame:
    """A joint frame as it was; the arrays are this reader's own and cannot be written."""

    tick: int
    frame_time: float  # seconds on the monotonic clock
    late: bool
    sensor_sequence: int  # -1 without a sensor
    sensor_arrival: float  # seconds on the monotonic clock
    pose: NDArray[np.float32]  # (J, 4) w, x, y, z local to the parent joint
    world: NDArray[np.float32]  # (J, 4) w, x, y, z
    positions: NDArray[np.float32]  # (J, 3) world, metres
    root: NDArray[np.float32]  # (3,) world, metres


class FrameReader:
    """Reads the shared frame of whichever stage runs; never waits, never raises, never disturbs the stage.

    facts: of the newest stage, None before the first one. generation: a number that changes with each new
    stage. complaint: why a file cannot be read, in a sentence; else empty.
    """

    def __init__(self, folder: Path) -> None:
        self.facts: Facts | None = None
        self.generation = 0
        self.complaint = ""

    def newest(self, now: float) -> SeenFrame | None:
        """The newest whole frame, however old it is; None before the first one."""
        raise NotImplementedError

    def frames(self, count: int, now: float) -> list[SeenFrame]:
        """The newest frames of this stage, at most `count`, newest last."""
        raise NotImplementedError

    def health(self) -> dict[str, Any] | None:
        """What the stage last said about itself; None before it did."""
        raise NotImplementedError

    def state(self, now: float) -> State:
        """absent: no stage; stale: its newest frame is older than STALE_S, or it died; else fresh."""
        raise NotImplementedError

    def is_alive(self, now: float) -> bool:
        """Whether the process that writes the frames lives (it may hang)."""
        raise NotImplementedError

    def close(self) -> None:
        """Let go of the file."""
