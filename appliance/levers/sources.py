"""Names that cues and commands know beside those that a show gives: sources of motion, no card."""

from __future__ import annotations

from typing import NamedTuple

MAIN = "main"  # the phrase that the show starts with
LIVE = "live"  # a live dancer's motion capture, in place of a phrase
VARY, GRANULAR, PATH, IMPROVISE = "vary", "granular", "path", "improvise"  # made ahead by the generator
MADE = (VARY, GRANULAR, PATH, IMPROVISE)
NO_CARD = "none"  # takes a card off
SEEDS = 2**31  # seeds of the noise in the answer are 0 to SEEDS - 1: an OSC integer holds them
KEPT = "kept"  # source of a recipe: a motion that was kept under a name


class Parameter(NamedTuple):
    """A number of a source, as show.yaml, cues and `/motion/SOURCE/NAME` take it."""

    meaning: str
    default: float
    least: float
    most: float
    is_whole: bool = False


_SEED = Parameter(
    "Its random seed: another number, another dance. `/motion/again` counts on.", 1, 0, 999_999, True
)
PARAMETERS: dict[str, dict[str, Parameter]] = {
    VARY: {
        "sigma": Parameter(
            "How far from the phrase, in standard deviations: 0.5 is subtle, 1 to 2 invents, 3 may break.",
            0.7,
            0,
            4,
        ),
        "seed": _SEED,
    },
    GRANULAR: {
        "speed": Parameter("How often a second the dance changes, at most.", 0.4, 0.05, 5),
        "spread": Parameter("How far from the usual: 1 as the dancer is; 0 one pose.", 1.0, 0, 3),
        "mix": Parameter("How much of the phrase `to`, 0 to 1; only with `from`.", 0.5, 0, 1),
        "from_start_s": Parameter("Where the excerpt of `from` begins, in seconds.", 0, 0, 3600),
        "to_start_s": Parameter("Where the excerpt of `to` begins, in seconds.", 0, 0, 3600),
        "seconds": Parameter("How long both excerpts are; 0: the whole phrases.", 0, 0, 60),
        "offset": Parameter("Moves the path between phrases, in standard deviations.", 0.0, -3, 3),
        "seed": _SEED,
    },
    PATH: {
        "wobble": Parameter("How far a path or a point wobbles, in standard deviations of poses.", 0.3, 0, 2),
        "frequency": Parameter("How often a second it does so.", 0.5, 0.05, 4),
        "seed": _SEED,
    },
    IMPROVISE: {
        "temperature": Parameter(
            "How freely it draws: 1 as it learned, 0 always the likeliest, above 1 wilder.", 1.0, 0, 2
        ),
        "seconds": Parameter("How long it dances on from one prompt; then it goes on from there.", 20, 5, 60),
        "seed": _SEED,
    },
}
MOST_POINTS = 16  # most points in a stroke over the map
POINTS = "points"  # the part of the show state that holds them
