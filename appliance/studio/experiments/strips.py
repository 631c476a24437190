"""The filmstrips of the experiments, as the paper's Figures 2 to 5: what draw_strips needs for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from appliance.pictures.filmstrip import Strip, held_throughout
from appliance.studio.data.dataset import FPS
from appliance.studio.experiments.excerpts import FRAMES, LEAD, Excerpt
from appliance.studio.experiments.families import (
    AS_IN_THE_PAPER,
    FIXED_DEGREES,
    TURNS_S,
    WITH_SENSOR,
    Condition,
    Trial,
)

COLUMNS = 8
FIGURES = (
    ("coding iterations alone", "once", tuple(Condition("coding", (count, 0)) for count in (1, 2, 5, 10))),
    (
        "the joint kept where the recording has it",
        "once",
        tuple(Condition("kept", each) for each in AS_IN_THE_PAPER),
    ),
    *(
        (
            f"the joint turning, {seconds:g} s a turn",
            "looped",
            tuple(Condition("turning", each, f"{seconds:g}s") for each in AS_IN_THE_PAPER),
        )
        for seconds in TURNS_S
    ),
    ("the joint led by a sensor", "looped", tuple(Condition("sensor", each) for each in WITH_SENSOR)),
    (
        "the joint held still",
        "looped",
        tuple(Condition("fixed", (10, 9), f"{degrees}deg") for degrees in FIXED_DEGREES),
    ),
)


def strip_of_excerpts(path: Path, excerpts: Sequence[Excerpt]) -> tuple[Any, ...]:
    """The input of draw_strips for the paper's Figure 2."""
    strips = [
        Strip(part.poses, part.roots, f"{one.name}: {one.take} from {one.first / FPS:.1f} s; {one.why}")
        for one in excerpts
        for part in [one.recording.excerpt(min(LEAD, one.first) / FPS, (min(LEAD, one.first) + FRAMES) / FPS)]
    ]
    return path, excerpts[0].recording.skeleton, strips, FPS, "The excerpts, as recorded", COLUMNS


def strips_of_trial(trial: Trial, folder: Path, network: str) -> list[tuple[Any, ...]]:
    """The input of draw_strips for each of the FIGURES: the recording, and the conditions under it."""
    skeleton = trial.excerpt.recording.skeleton
    wanted: list[tuple[Any, ...]] = []
    for number, (text, base, conditions) in enumerate(FIGURES, 1):
        rehearsal = trial.once if base == "once" else trial.looped
        recorded = rehearsal.recording
        held = [skeleton.index(joint) for joint in trial.held_joints(conditions[0])]
        strips = [Strip(recorded.poses, recorded.roots, "recorded")]
        for condition in conditions:
            danced = trial.whole(trial.dances[condition])
            holds = held_throughout(danced.poses, held)
            strips.append(Strip(danced.poses, danced.roots, condition.label, holds=holds))
        path = folder / f"{number}_{conditions[0].family}.png"
        title = f"{trial.excerpt.name}: {text} ({network})"
        wanted.append((path, skeleton, strips, FPS, title, COLUMNS))
    return wanted
