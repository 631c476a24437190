"""What was found in a folder of recordings, in sentences, before anything is learned from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.studio.data.dataset import FPS, Dataset, Take, window_starts

MASKED_PICTURE = "pictures/masked.png"


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
        *_masked(takes),
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


def _masked(takes: Sequence[Take]) -> list[str]:
    """How much, where and at which joints; how people see it and say that it is none."""
    counts = {take.name: int(np.count_nonzero(~take.sound)) for take in takes}
    total, frames = sum(counts.values()), sum(len(take.sound) for take in takes)
    if not total:
        return ["No frame had to be masked."]
    worst = sorted((take for take in takes if counts[take.name]), key=lambda take: -counts[take.name])
    named = _few([f"{take.name} ({counts[take.name]:,}: {_joints(take)})" for take in worst])
    return [
        f"Masked as capture errors: {total:,} of {frames:,} frames ({100 * total / frames:.1f} %) in "
        f"{_count(len(worst), 'recording')}: {named}.",
        f"{MASKED_PICTURE} shows the worst. What is no error: --keep '{worst[0].name}', or keep: with its "
        "seconds in catalogue.yaml.",
    ]


def _joints(take: Take) -> str:
    """The joints at fault, those first that are so for longest."""
    seconds: dict[str, float] = {}
    for error in take.errors:
        name = error.joint or "by the catalogue"
        seconds[name] = seconds.get(name, 0.0) + error.end_s - error.start_s
    return _few(sorted(seconds, key=lambda name: -seconds[name]), 2)


def _few(names: Sequence[str], most: int = 4) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _minutes(takes: Sequence[Take]) -> float:
    return sum(take.recording.seconds for take in takes) / 60


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" + ("" if number == 1 else "s")
