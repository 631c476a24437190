"""The paper's findings, (a) to (g): each with a measure, figures by excerpt, bounds, and whether it holds.

The paper's words give no numbers: the bounds say when a figure is taken to agree with them, and a margin by
how much it does. Where a null network passes too, a verdict says nothing of what a network has learned.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from appliance.studio.experiments import claim_figures as measures
from appliance.studio.experiments.claim_figures import OWN_POSE, PAUSE_SHARE
from appliance.studio.experiments.families import NUDGE_DEGREES, Trial
from appliance.studio.experiments.null_networks import Copy, Paste

STILL = "still"
MOST = 99.0  # margins are cut there: a figure of nothing has no end of it
RIGHTLY = (Copy.name, Paste.name)


@dataclass(frozen=True)
class Bound:
    """The bound of a figure: at most or at least `limit`; text: 'degrees from the excerpt'."""

    figure: str
    text: str
    limit: float
    at_least: bool = False

    def margin(self, row: Mapping[str, float]) -> float:
        """How many times over the figure keeps the bound: 1 just so, less where it does not; 0 for NaN."""
        value = row[self.figure]
        if not math.isfinite(value):
            return 0.0
        if self.at_least:
            return min(max(value, 0.0) / self.limit, MOST)
        return min(self.limit / max(value, 1e-9), MOST)

    def __str__(self) -> str:
        """For people: 'degrees from the excerpt at most 3'."""
        return f"{self.text} {'at least' if self.at_least else 'at most'} {self.limit:g}"


@dataclass(frozen=True)
class Claim:
    """letter and text of the paper; measure: what the figures are; figures: by excerpt and name.

    about: the excerpts that the claim speaks of. rightly: null networks that pass it as they should, because
    the claim is that nothing changes.
    """

    letter: str
    text: str
    measure: str
    bounds: tuple[Bound, ...]
    figures: Mapping[str, Mapping[str, float]]
    about: tuple[str, ...]
    rightly: tuple[str, ...] = ()

    @property
    def margins(self) -> dict[str, float]:
        """By excerpt: how many times over its weakest figure keeps its bound."""
        return {name: min(bound.margin(self.figures[name]) for bound in self.bounds) for name in self.about}

    @property
    def holds(self) -> dict[str, bool]:
        """By excerpt."""
        return {name: margin >= 1 for name, margin in self.margins.items()}

    @property
    def margin(self) -> float:
        """On the whole: what more than half of the excerpts reach."""
        ordered = sorted(self.margins.values(), reverse=True)
        return ordered[len(ordered) // 2] if ordered else 0.0

    @property
    def holds_on_the_whole(self) -> bool:
        """In more than half of the excerpts that it is about."""
        return self.margin >= 1

    def as_json(self) -> dict[str, object]:
        """For the report."""
        figures = {
            name: {key: round(value, 3) if math.isfinite(value) else None for key, value in row.items()}
            for name, row in self.figures.items()
        }
        return {
            "claim": self.text,
            "measure": self.measure,
            "bounds": [str(bound) for bound in self.bounds],
            "figures": figures,
            "holds": self.holds,
            "margins": {name: round(margin, 2) for name, margin in self.margins.items()},
            "holds_on_the_whole": self.holds_on_the_whole,
            "margin": round(self.margin, 2),
        }


def claims(trials: Sequence[Trial]) -> list[Claim]:
    """All seven, from trials; (b) is about the excerpt that is named `still`, (c) about the others."""
    still = [one for one in trials if one.excerpt.name == STILL]
    moving = [one for one in trials if one.excerpt.name != STILL] or list(trials)
    return [
        _claim(
            "a",
            "One pass reproduces the recording faithfully.",
            "degrees from the excerpt after one pass; the same as a share of the way from the excerpt to the "
            "dancer's mean pose",
            (Bound("degrees", "degrees", 3.0), Bound("way_to_mean", "share of the way to the mean", 0.2)),
            _each(partial(measures.faithfulness, passes=1), trials),
            trials,
            rightly=RIGHTLY,
        ),
        _claim(
            "b",
            "A static excerpt stays as it is, at ten passes as well.",
            "the same after ten passes; the other excerpts for comparison",
            (Bound("degrees", "degrees", 5.0), Bound("way_to_mean", "share of the way to the mean", 0.33)),
            _each(partial(measures.faithfulness, passes=10), trials),
            still,
            rightly=RIGHTLY,
        ),
        _claim(
            "c",
            "Above one pass smooth motion becomes intermittent: it pauses on poses, mostly of the excerpt, "
            "and jumps.",
            f"pauses: share of the time below {PAUSE_SHARE:.0%} of the dance's own mean speed, in the "
            "recording, after one and after ten passes, and by how much ten have more than both; half in: "
            "share of the time, the quickest, in which half of the motion happens; sharper: in how much less "
            "than in recording and one pass; jumps: the speed in that time by the excerpt's in its own; "
            "median length of the jumps in ticks; own poses: share of the pauses within "
            f"{OWN_POSE:g} degrees of a pose of the excerpt",
            (
                Bound("more_pauses", "more pauses", 0.1, at_least=True),
                Bound("sharper", "sharper", 2.0, at_least=True),
                Bound("jumps", "jumps", 0.5, at_least=True),
                Bound("own_poses", "own poses", 0.5, at_least=True),
            ),
            _each(measures.intermittency, moving),
            moving,
        ),
        _claim(
            "d",
            "The held orientation shows only when all passes are interaction iterations.",
            "degrees between the joint and a hand at five seconds a turn, at 1/1, 10/5 and 10/10 (blending "
            "follows such a hand by 2 degrees)",
            (
                Bound("1/1", "degrees at 1/1", 3.0),
                Bound("10/10", "at 10/10", 3.0),
                Bound("10/5", "at 10/5", 6.0, at_least=True),
            ),
            _each(measures.holding, trials),
            trials,
        ),
        _claim(
            "e",
            "The influence on the other joints is very small at 1/1 and grows with the passes and with the "
            "distance of the hand from the recording.",
            "degrees that the others are moved by a hand at five seconds a turn, at 1/1 and 10/10; the "
            "second by the first; correlation of the second with the hand's distance from the recorded "
            "orientation over the ticks",
            (
                Bound("1/1", "degrees at 1/1", 2.0),
                Bound("10/10", "at 10/10", 4.0, at_least=True),
                Bound("growth", "growth", 3.0, at_least=True),
                Bound("correlation", "correlation", 0.3, at_least=True),
            ),
            _each(measures.influence, trials),
            trials,
        ),
        _claim(
            "f",
            "The speed of the turning joint sets the pace of the whole skeleton, also of a static excerpt; "
            "slow turns make larger motion.",
            "speed of the others at 10/10 in degrees a second without a hand, at five seconds and at one "
            "second a turn; how far they range at both (degrees from their mean pose); faster: the quick "
            "turn's speed by the slow one's; larger: the slow turn's range by the quick one's",
            (
                Bound("faster", "faster", 1.5, at_least=True),
                Bound("larger", "larger", 1.1, at_least=True),
            ),
            _each(measures.pace, trials),
            trials,
        ),
        _claim(
            "g",
            "Fast recordings make the answer unpredictable.",
            "degrees that the others differ by for each degree that the hand is ahead (by "
            f"{NUDGE_DEGREES:g}), at one second a turn and 10/10; growth: the faster half of the excerpts by "
            "the slower half; chance: how often excerpts in random order agree as well with their speeds "
            "(permutation test on ranks)",
            (Bound("chance", "chance", 0.05), Bound("growth", "growth", 1.5, at_least=True)),
            measures.sensitivity(trials),
            trials,
        ),
    ]


def _each(
    measure: Callable[[Trial], Mapping[str, float]], trials: Sequence[Trial]
) -> dict[str, Mapping[str, float]]:
    """Figures by excerpt."""
    return {one.excerpt.name: measure(one) for one in trials}


def _claim(
    letter: str,
    text: str,
    measure: str,
    bounds: tuple[Bound, ...],
    figures: Mapping[str, Mapping[str, float]],
    about: Sequence[Trial],
    rightly: tuple[str, ...] = (),
) -> Claim:
    names = tuple(one.excerpt.name for one in about)
    return Claim(letter, text, measure, bounds, figures, names, rightly)


def verdict(claim: Claim) -> str:
    """For people: 'holds (1.3 times, 4 of 5)'."""
    held = f"{sum(claim.holds.values())} of {len(claim.about)}"
    return f"{'holds' if claim.holds_on_the_whole else 'does not hold'} ({times(claim.margin)}, {held})"


def times(margin: float) -> str:
    """A margin in words: '1.3 times'."""
    return f"over {MOST:g} times" if margin >= MOST else f"{margin:.2g} times"


def passed_by(claim: Claim, nulls: Mapping[str, Sequence[Claim]]) -> list[str]:
    """Names of the null networks that pass a claim."""
    return [
        name
        for name, found in nulls.items()
        if any(one.letter == claim.letter and one.holds_on_the_whole for one in found)
    ]


def worth(claim: Claim, nulls: Mapping[str, Sequence[Claim]]) -> str:
    """The meaning of a verdict on a claim, in words, by the null networks that pass it."""
    passed = passed_by(claim, nulls)
    idle = [name for name in passed if name not in claim.rightly]
    if idle:
        return f"says nothing of what was learned: {' and '.join(idle)} pass{'es' * (len(idle) == 1)} too"
    if passed:
        return f"{' and '.join(passed)} pass{'es' * (len(passed) == 1)}, rightly: nothing is to change"
    return "no null network passes"
