"""How the recordings of a trained network were read: kept in its checkpoint and in its show's report."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from appliance.pose.bvh import BvhError, read_bvh
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.skeleton import Skeleton
from appliance.studio.data.catalogue import READ_FROM_FILES, Catalogue
from appliance.studio.data.takes import FPS

KEY = "recordings_read"  # key of report.json
SAME_BONE_M = 1e-4


@dataclass(frozen=True)
class Remembered:
    """How a training read its recordings, and their skeleton in the stage's frame; None: not known."""

    options: ReadingOptions = AS_THE_FILES_SAY
    skeleton: Skeleton | None = None

    def options_for(self, file: Path, asked: ReadingOptions) -> ReadingOptions:
        """The options that were asked for, then those of the training.

        That does not hold for what Bunraku made (a phrase, a variation): it is in the stage's frame already.
        Raises OSError.
        """
        if self.options == AS_THE_FILES_SAY or self._is_made_by_us(file):
            return asked
        return asked.over(self.options)

    def _is_made_by_us(self, file: Path) -> bool:
        """Whether a file has the rate of phrases, and bone for bone the skeleton of the training."""
        if self.skeleton is None:
            return False
        try:
            found = read_bvh(file)
        except BvhError:  # perhaps only until what was asked for is applied
            return False
        return (
            bool(np.isclose(found.fps, FPS))
            and found.skeleton.same_joints(self.skeleton)
            and bool(np.allclose(found.skeleton.offsets, self.skeleton.offsets, atol=SAME_BONE_M))
        )


NOTHING = Remembered()


def reading_facts(catalogue: Catalogue) -> dict[str, Any]:
    """A show's record of how its recordings were read: only what was said, by pattern."""
    names = (*READ_FROM_FILES, "all_frames")
    return {name: value for name in names if (value := getattr(catalogue.reading, name))}


def remembered_reading(network: Path) -> Remembered:
    """Read from a show folder, a network in one, or a checkpoint; nothing if none of them has it."""
    folder = network if network.is_dir() else network.parent
    if network.suffix.casefold() == ".pt":
        from appliance.studio.evaluation.coders import load_state

        origin = load_state(network).get("origin") or {}
        options = Catalogue(**(origin.get("catalogue") or {})).reading
    else:
        options = _options_in(folder / "report.json")
    try:
        return Remembered(options, read_bvh(folder / "skeleton.bvh").skeleton)
    except (OSError, BvhError):
        return Remembered(options)


def _options_in(report: Path) -> ReadingOptions:
    try:
        facts = json.loads(report.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return AS_THE_FILES_SAY
    known = facts.get(KEY) if isinstance(facts, dict) else None
    if not isinstance(known, Mapping):
        return AS_THE_FILES_SAY
    by_pattern: dict[str, Any] = {name: dict(known.get(name) or {}) for name in READ_FROM_FILES}
    return ReadingOptions(**by_pattern, all_frames=bool(known.get("all_frames")))
