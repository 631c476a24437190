"""A stage whose frames show a body that turns."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.bundles import FIGURE


class StageDouble:
    """Gives the frames of a body that turns."""

    def __init__(self, directory: Path) -> None:
        cues = ({"name": "strings", "fade_s": 2.0},)
        self.facts, self.generation = (
            SimpleNamespace(show_directory=directory, cues=cues, led_in=lambda frame: frame),
            1,
        )
        self.number, self.lives = 0, True

    def newest(self, now: float) -> Any:
        self.number += self.lives
        positions = np.random.default_rng(self.number).normal(size=(len(FIGURE), 3)).astype(np.float32)
        return SimpleNamespace(tick=self.number, left=now, frame_time=0.02 * self.number, positions=positions)
