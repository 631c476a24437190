"""A choreographer's view of a newly trained dancer, and what to do about it: a sentence each.

The advice follows from the cause. A dancer that was hardly trained needs training whatever else is wrong with
it; one that learned long enough needs recordings, or another liveliness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

ANSWERS, ANSWERS_A_LITTLE = 8.0, 4.0  # degrees
UNLEARNED, ROUGH = 10.0, 4.0  # degrees after one pass; the default show's dancer 1.9, one of 103 steps 22
STANDS = 0.3  # free energy: a statue
CALM, RESTLESS = 0.75, 1.35  # energy of a limb; 0.69 of the legs' speed is seen as legs that nearly stand
NARROW = 0.7  # spread of a limb: it stays near its average pose
ROUGHNESS = 1.5
PLAUSIBLE = 1.1  # the phrase has 1; release 0.1.0, the arm more or less pasted on, 1.1 to 1.25
TOLD = 0.9  # a critic's area under the curve: nine times in ten it tells the dance from the dancer
OFF_HAND = 15.0  # degrees
FEW_STEPS = 2000  # the default show's dancer made some tens of thousands, in several trainings
ENOUGH_MINUTES = 8.0  # the default show's dancer answers with what it learned in 11
MOST_NAMED = 2  # things that are wrong, in one sentence

LIMBS = {"legs": "the legs", "trunk": "the trunk", "arms": "the free arms", "held_limb": "the held limb"}
SINGULAR = ("trunk", "held_limb")


@dataclass(frozen=True)
class Seen:
    """The measurements; None or left out: not measured.

    error: degrees off the recordings after one pass without a hand. answer: degrees that a hand moves the
    others by. energy, spread: by limb (LIMBS; 'whole' for all that nobody holds), the phrase's own is 1.
    free_energy: of the dance without a hand. roughness, plausibility: the phrase's own is 1. critic: area
    under its curve, 0.5 where it cannot tell the dance from the dancer. fits: whether the dance is nearer
    than the bare phrase to what the dancer did with that joint. off_hand: degrees from the held joint to the
    hand.
    """

    answer: float
    error: float | None = None
    energy: Mapping[str, float | None] = field(default_factory=dict)
    spread: Mapping[str, float | None] = field(default_factory=dict)
    free_energy: float | None = None
    roughness: float | None = None
    plausibility: float | None = None
    critic: float | None = None
    fits: bool | None = None
    off_hand: float | None = None


@dataclass(frozen=True)
class Learned:
    """The training of a dancer: steps, None: unknown; minutes of dance in how many takes."""

    minutes: float
    takes: int
    steps: int | None = None


@dataclass(frozen=True)
class Verdict:
    """cause: one word for the first thing that is wrong, or 'good'; advice '': there is nothing to do."""

    cause: str
    verdict: str
    advice: str


def judge(seen: Seen, learned: Learned) -> Verdict:
    """The verdict and what follows from it."""
    cause, text = _seen(seen)
    return Verdict(cause, text, _advice(cause, seen, learned))


def _seen(seen: Seen) -> tuple[str, str]:
    """Cause and sentence: what cannot dance comes first, then what does not answer, then how it answers."""
    if seen.free_energy is not None and seen.free_energy < STANDS:
        return "statue", (
            f"The dancer stands still without a hand (energy {seen.free_energy:.2f}): it is a statue."
        )
    if seen.error is not None and seen.error > UNLEARNED:
        return "unlearned", (
            f"The dancer has not learned the dance: one pass without a hand is {seen.error:.0f} degrees off "
            "the recordings."
        )
    if seen.answer < ANSWERS_A_LITTLE:
        return "copies", (
            "The dancer does not answer: with a hand on it, the rest of the body dances on as without "
            f"({seen.answer:.1f} degrees)."
        )
    wrong = _reservations(seen)
    much = "answers" if seen.answer >= ANSWERS else "answers a little"
    if wrong:
        named = " and ".join(list(dict.fromkeys(text for _, text in wrong))[:MOST_NAMED])
        return wrong[0][0], f"The dancer {much} ({seen.answer:.0f} degrees), but {named}."
    if much != "answers":
        return "little", f"The dancer answers a little: a hand moves the rest by {seen.answer:.1f} degrees."
    alive = "stays alive" if seen.energy or seen.critic is not None else "nothing speaks against it"
    critic = "" if seen.critic is None else f"; a critic tells it from the dancer in {_of_100(seen.critic)}"
    return (
        "good",
        f"The dancer answers, and {alive}: a hand moves the rest by {seen.answer:.0f} degrees{critic}.",
    )


def _reservations(seen: Seen) -> list[tuple[str, str]]:
    """The faults of an answer, as cause and message, the worst first."""
    found = []
    if _above(seen.plausibility, PLAUSIBLE):
        found.append(("foreign", f"its poses are not the dancer's (plausibility {seen.plausibility:.2f})"))
    elif seen.fits is False:
        found.append(("foreign", "it does nothing that the dancer did with that joint"))
    if _above(seen.roughness, ROUGHNESS):
        found.append(("trembles", f"it trembles (roughness {seen.roughness:.1f}, the dancer's is 1)"))
    speeds, spread = _known(seen.energy), _known(seen.spread)
    slowest, narrowest = (min(each, key=each.__getitem__, default="") for each in (speeds, spread))
    quickest = max(speeds, key=speeds.__getitem__, default="")
    if slowest and speeds[slowest] < CALM:
        does = "comes nearly to rest" if slowest == "whole" else _of(slowest, "nearly stands", "nearly stand")
        found.append(("average", f"{_limb(slowest)} {does} ({speeds[slowest]:.2f} of the dancer's speed)"))
    if narrowest and spread[narrowest] < NARROW:
        stays = f"{_limb(narrowest)} {_of(narrowest, 'stays', 'stay')} near the average pose"
        found.append(("average", f"{stays} ({spread[narrowest]:.2f} of the spread)"))
    if quickest and speeds[quickest] > RESTLESS:
        restless = f"{_limb(quickest)} {_of(quickest, 'is', 'are')} restless"
        found.append(("trembles", f"{restless} ({speeds[quickest]:.2f} of the dancer's speed)"))
    if _above(seen.free_energy, RESTLESS):
        found.append(("trembles", f"without a hand it is restless ({seen.free_energy:.2f} of the speed)"))
    if _above(seen.off_hand, OFF_HAND):
        found.append(("off", f"the held joint stays {seen.off_hand:.0f} degrees off the hand"))
    if not found and _above(seen.critic, TOLD):
        found.append(("told", f"a critic tells it from the dancer in {_of_100(seen.critic)}"))
    return found


def _advice(cause: str, seen: Seen, learned: Learned) -> str:
    """The remedies, first for what is missing in the recordings, then for the cause."""
    still = cause in ("statue", "unlearned")
    rough = seen.error is None or seen.error > ROUGH or still
    if learned.steps is not None and learned.steps < FEW_STEPS and rough and cause != "good":
        return (
            f"Train longer (--minutes): it made {learned.steps:,} steps, the default show's dancer tens of "
            "thousands. Nothing else can be judged before."
        )
    few = learned.minutes < ENOUGH_MINUTES
    learned_from = f"it learned from {learned.minutes:.1f} minutes of dance"
    if learned.takes == 1:
        return (
            f"Bring more takes: {learned_from} in a single one, and knows one way on from each pose. Several "
            "takes in which each limb does different things help most."
        )
    if few and cause == "good":
        return (
            f"More recordings give it more to answer with: {learned_from}, the default show's dancer from 11."
        )
    if few:
        return f"More recordings help most: {learned_from}, the default show's dancer from 11."
    return _CURES[cause]


_WHERE = "recordings in which the held joint goes where a hand will take it"
_CURES = {
    "good": "",
    "statue": "Steps and recordings are enough: train anew with another --seed.",
    "unlearned": "Train longer (--minutes), or with a larger network (--width).",
    "copies": f"Add {_WHERE}, and train longer (--minutes).",
    "foreign": f"Train longer (--minutes), or add {_WHERE}.",
    "trembles": "Lower liveliness or coding_iterations in show.yaml, or train longer (--minutes).",
    "average": "Raise liveliness in show.yaml if it is below 1; else train longer (--minutes).",
    "off": "Raise interaction_iterations in show.yaml: all but the last of the coding iterations.",
    "told": "Compare it with the phrase by eye (bunraku play), and train longer (--minutes).",
    "little": "Raise coding_iterations in show.yaml, or add recordings in which the arms do more.",
}


def _known(figures: Mapping[str, float | None]) -> dict[str, float]:
    """Those that were measured, limb by limb where there are limbs: a mean hides a restless one."""
    known = {name: value for name, value in figures.items() if value is not None and math.isfinite(value)}
    limbs = {name: value for name, value in known.items() if name in LIMBS}
    return limbs or {name: value for name, value in known.items() if name == "whole"}


def _limb(name: str) -> str:
    return LIMBS.get(name, "it")


def _of(limb: str, one: str, several: str) -> str:
    """The verb that goes with a limb."""
    return one if limb in ("whole", *SINGULAR) else several


def _above(value: float | None, limit: float) -> bool:
    return value is not None and math.isfinite(value) and value > limit


def _of_100(critic: float | None) -> str:
    return f"{100 * (critic or 0.5):.0f} of 100 cases"
