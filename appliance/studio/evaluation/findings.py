"""What was found in a folder of recordings, in sentences, before anything is learned from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.studio.data.dataset import FPS, Dataset, Take, window_starts


def findings(dataset: Dataset) -> list[str]:
    """Files, rates, what is held out, what is masked, which joints stand still."""
    takes = [*dataset.training, *dataset.held_out]
    names, moving = dataset.skeleton.names, dataset.moving_names
    still = [name for name in names if name not in moving]
    training = sum(len(window_starts(take)) for take in dataset.training)
    apart = sum(len(window_starts(take)) for take in dataset.held_out)
    lines = [
        f"{_count(len(takes), 'recording')} of {len({take.take for take in takes})} takes, "
        f"{_minutes(takes):.1f} minutes, resampled to {FPS:g} poses a second.",
        f"{len(moving)} of {len(names)} joints move: {', '.join(moving)}."
        + (f" Still everywhere, kept as they stand: {', '.join(still)}." if still else ""),
        *_rates(takes),
        _masked(takes),
    ]
    if dataset.held_out:
        held = ", ".join(sorted(take.name for take in dataset.held_out))
        lines.append(f"Kept apart to measure on, by take: {held} ({_minutes(dataset.held_out):.1f} minutes).")
    else:
        lines.append("Nothing is kept apart: one take alone is here, so what is learned cannot be measured.")
    lines.append(
        f"{training:,} windows of 8 poses to learn from (their mirror images besides), {apart:,} kept apart."
    )
    return lines


def _rates(takes: Sequence[Take]) -> list[str]:
    """Files whose header lies about the rate, by pairs of rates."""
    pairs: dict[tuple[float, float], list[str]] = {}
    for take in takes:
        if abs(take.true_fps - take.header_fps) > 0.01:
            pairs.setdefault((round(take.header_fps, 2), take.true_fps), []).append(take.name)
    return [
        f"{_count(len(names), 'file')} read at {true:g} poses a second where the header says {header:g}: "
        f"{_few(sorted(names))}."
        for (header, true), names in pairs.items()
    ]


def _masked(takes: Sequence[Take]) -> str:
    counts = {take.name: int(np.count_nonzero(~take.sound)) for take in takes}
    total, frames = sum(counts.values()), sum(len(take.sound) for take in takes)
    if not total:
        return "No frame had to be masked."
    most = sorted((name for name in counts if counts[name]), key=lambda name: -counts[name])
    named = _few([f"{name} ({counts[name]})" for name in most])
    return (
        f"Masked as capture errors: {total:,} of {frames:,} frames ({100 * total / frames:.1f} %): {named}."
    )


def _few(names: Sequence[str], most: int = 4) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _minutes(takes: Sequence[Take]) -> float:
    return sum(take.recording.seconds for take in takes) / 60


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" + ("" if number == 1 else "s")
