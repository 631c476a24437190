"""Stretches of recordings that were masked as capture errors, and a picture of the worst."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from appliance.pictures.filmstrip import draw_rows, held_throughout
from appliance.pictures.filmstrip_stage import Row
from appliance.studio.data.capture_errors import REASONS, CaptureError
from appliance.studio.data.takes import FPS, Take

COLUMNS, ROWS, ROWS_A_TAKE = 6, 6, 2
BESIDE_S = 0.2  # the frame before and the one after
TOGETHER_S = 0.1


@dataclass(frozen=True)
class MaskedStretch:
    """Adjacent errors of one take."""

    take: Take
    errors: tuple[CaptureError, ...]

    @property
    def start_s(self) -> float:
        return min(error.start_s for error in self.errors)

    @property
    def end_s(self) -> float:
        return max(error.end_s for error in self.errors)

    @property
    def worst(self) -> CaptureError:
        """The longest error; among equals, the one that is furthest off."""
        return max(self.errors, key=lambda error: (round(error.end_s - error.start_s, 1), error.degrees))

    def sentence(self) -> str:
        """'salsa_07, 20.95 to 34.47 s: head stands as it does at no other time (163 degrees); also neck'."""
        worst = self.worst
        message = f"{worst.joint} {REASONS[worst.reason]}".strip()
        if worst.degrees:
            message += f" ({worst.degrees:.0f} degrees)"
        others = sorted({error.joint for error in self.errors} - {worst.joint, ""})
        also = f"; also {', '.join(others)}" if others else ""
        start_s, end_s = self.take.begins_s + self.start_s, self.take.begins_s + self.end_s
        return f"{self.take.file}, {start_s:.2f} to {end_s:.2f} s: {message}{also}"


def masked_stretches(takes: Sequence[Take]) -> list[MaskedStretch]:
    """All stretches, the longest first; equally long ones by how far they are off."""
    found = []
    for take in takes:
        together: list[CaptureError] = []
        for error in sorted(take.errors, key=lambda error: error.start_s):
            if together and error.start_s > max(one.end_s for one in together) + TOGETHER_S:
                found.append(MaskedStretch(take, tuple(together)))
                together = []
            together.append(error)
        if together:
            found.append(MaskedStretch(take, tuple(together)))
    return sorted(found, key=lambda one: (-round(one.end_s - one.start_s, 1), -one.worst.degrees))


def draw_masked(path: Path, takes: Sequence[Take]) -> Path:
    """The worst stretches as strips: an instant before each, four in it, one after, its joints coloured."""
    shown: list[MaskedStretch] = []
    for stretch in masked_stretches(takes):
        if sum(one.take is stretch.take for one in shown) < ROWS_A_TAKE and len(shown) < ROWS:
            shown.append(stretch)
    title = "Masked as capture errors: the worst"
    skeleton, rows = takes[0].recording.skeleton, [_row(stretch) for stretch in shown]
    return draw_rows(path, skeleton, rows, FPS, title, "masked between 'before' and 'after'")


def _row(stretch: MaskedStretch) -> Row:
    recording = stretch.take.recording
    start, end, last = stretch.start_s, stretch.end_s, (len(recording) - 1) / FPS
    inside = np.linspace(start, min(end, last), COLUMNS - 2)
    seconds = [start - BESIDE_S, *inside, end + BESIDE_S]
    labels = ["before, ", *[""] * len(inside), "after, "]
    there = [(at, word) for at, word in zip(seconds, labels, strict=True) if 0 <= at <= last]
    chosen = np.round(np.array([at for at, _ in there]) * FPS).astype(np.int64)
    names = {error.joint for error in stretch.errors if error.joint}
    return Row(
        recording.poses,
        recording.roots,
        np.minimum(chosen, len(recording) - 1),
        stretch.sentence(),
        holds=held_throughout(recording.poses, [recording.skeleton.index(name) for name in names]),
        stamps=tuple(f"{word}{stretch.take.begins_s + at:.2f} s" for at, word in there),
    )
