"""Findings in a folder of recordings, in sentences, before training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.pose.body_facts import height_m, sampled_positions
from appliance.pose.counted import counted
from appliance.studio.data.dataset import FPS, WINDOW, Dataset, DatasetError, Take, window_starts
from appliance.studio.inspection import doubts, zero_pose

MASKED_PICTURE = "pictures/masked.png"
FEW_S = 120.0  # a dance shorter than this teaches little
_ENOUGH = f"{FEW_S / 60:g} minutes of dance are enough to begin with, ten for a stage"


def findings(dataset: Dataset) -> list[str]:
    """Files, rates, what is held out, what is masked, which joints stand still, whether it is much."""
    takes = dataset.takes
    names, moving = dataset.skeleton.names, dataset.moving_names
    still = [name for name in names if name not in moving]
    files, performances = len({take.file for take in takes}), len({take.take for take in takes})
    why_not = dataset.asymmetry
    images = " (their mirror images besides)" if not why_not else ""
    learned = counted(learned_windows(dataset), "window")
    apart = sum(len(window_starts(take)) for take in dataset.held_out)
    return [
        f"{counted(files, 'recording')} of {counted(performances, 'take')}, "
        f"{_minutes(takes):.1f} minutes, resampled to {FPS:g} poses a second.",
        *([f"Only BVH files are read, left out: {dataset.left_out}."] if dataset.left_out else []),
        f"{len(moving)} of {len(names)} joints move: {', '.join(moving)}."
        + (f" The others never turn and stay as they are: {', '.join(still)}." if still else ""),
        *_body(dataset),
        *_rates(takes),
        *_notes(takes),
        *_masked(takes),
        _kept_apart(dataset),
        f"{learned} of {WINDOW} poses to learn from{images}, {apart:,} kept apart.",
        *([f"Not learned from the mirror's side too: {why_not}."] if why_not else []),
        *few_data(dataset),
    ]


def learned_windows(dataset: Dataset, window: int = WINDOW) -> int:
    """The number of sound training windows, without mirror images."""
    return sum(len(window_starts(take, window=window)) for take in dataset.training)


def require_windows(dataset: Dataset, least: int, window: int = WINDOW) -> None:
    """Raises DatasetError if fewer training windows are left than one training step uses."""
    found = learned_windows(dataset, window)
    if found >= least:
        return
    masked = sum(int(np.count_nonzero(~take.sound)) for take in dataset.training) / FPS
    why = f" {masked:.1f} s are masked as capture errors ({MASKED_PICTURE})." if masked else ""
    raise DatasetError(
        f"Only {counted(found, 'window')} of {window} sound poses (about {found / FPS:.1f} s) to learn from: "
        f"too few to learn anything. At least {least} are needed (about {least / FPS:.0f} s in a row); "
        f"{_ENOUGH}.{why} Bring more or longer recordings."
    )


def _kept_apart(dataset: Dataset) -> str:
    if not dataset.held_out and len({take.take for take in dataset.takes}) > 1:
        return "Nothing is kept apart: the network learned from all of these takes."
    if not dataset.held_out:
        return "Nothing is kept apart: there is only one short take, so the learning cannot be measured."
    held = ", ".join(sorted(take.name for take in dataset.held_out))
    alone = {take.take for take in dataset.training} & {take.take for take in dataset.held_out}
    how = "the end of the only take" if alone else "by take"
    return f"Kept apart to measure on, {how}: {held} ({_minutes(dataset.held_out):.1f} minutes)."


def few_data(dataset: Dataset) -> list[str]:
    """Expectations from little dance, and how much would be enough; nothing if there is enough."""
    seconds = sum(int(np.count_nonzero(take.sound)) for take in dataset.training) / FPS
    if seconds >= FEW_S:
        return []
    return [
        f"Only {seconds:.0f} s of dance to learn from: expect a dancer that knows these few moves, and that "
        f"answers a hand far from all of them with the nearest one. {_ENOUGH}: the show that comes along "
        "learned from 11."
    ]


def _body(dataset: Dataset) -> list[str]:
    """The body's height, what its joints are taken for, and what has to be asked."""
    take = max(dataset.takes, key=lambda take: len(take.recording))
    height = height_m(dataset.skeleton, sampled_positions(take.recording))
    taken = [f"{role} {dataset.skeleton.names[joint]}" for role, joint in dataset.skeleton.roles.items()]
    return [
        f"A body {height:.2f} m tall, {zero_pose(dataset.skeleton)} at rest. Taken for: {', '.join(taken)}. "
        "More: bunraku inspect.",
        *doubts(dataset.skeleton, height),
    ]


def _notes(takes: Sequence[Take]) -> list[str]:
    """Repairs made to files, and to how many."""
    files: dict[str, list[str]] = {}
    for take in takes:
        for note in take.notes:
            files.setdefault(note, []).append(take.file)
    return [f"{_few(sorted(set(names)))}: {note}." for note, names in files.items()]


def _rates(takes: Sequence[Take]) -> list[str]:
    """Files whose header lies about the rate, by pairs of rates."""
    pairs: dict[tuple[float, float], list[str]] = {}
    for take in takes:
        if abs(take.true_fps - take.header_fps) > 0.01:
            pairs.setdefault((round(take.header_fps, 2), take.true_fps), []).append(take.name)
    return [
        f"{counted(len(names), 'file')} read at {true:g} poses a second where the header says {header:g}: "
        f"{_few(sorted(names))}."
        for (header, true), names in pairs.items()
    ]


def _masked(takes: Sequence[Take]) -> list[str]:
    """How much, where and at which joints; how to recognise it and how to overrule it."""
    counts = {take.name: int(np.count_nonzero(~take.sound)) for take in takes}
    total, frames = sum(counts.values()), sum(len(take.sound) for take in takes)
    if not total:
        return ["No frame had to be masked."]
    worst = sorted((take for take in takes if counts[take.name]), key=lambda take: -counts[take.name])
    named = _few([f"{take.name} ({counts[take.name]:,}: {_joints(take)})" for take in worst])
    return [
        f"Masked as capture errors: {total:,} of {frames:,} frames ({100 * total / frames:.1f} %) in "
        f"{counted(len(worst), 'recording')}: {named}.",
        f"{MASKED_PICTURE} shows the worst. To keep one: --keep '{worst[0].file}', or keep: with its seconds "
        "in catalogue.yaml.",
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
