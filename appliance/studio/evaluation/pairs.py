"""Phrases and hands to measure an answer with: recordings of different takes; what is left as reference."""

from __future__ import annotations

import math
from collections.abc import Sequence

from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, WINDOW, Dataset, Take
from appliance.studio.evaluation.measurement import TICKS, Pair
from appliance.studio.evaluation.pictures import longest_sound
from appliance.studio.studio_error import StudioError

LONGEST_S = (TICKS + WINDOW - 1) / FPS
SHORTEST_S = 3.0  # a shorter stretch says nothing: an answer is a mean over many poses


def pair_up(phrases: Sequence[Take], hands: Sequence[Take]) -> list[Pair]:
    """As many pairs as there are phrases or hands, whichever are more; each hand is of another take.

    Of each recording the beginning of the longest stretch without a capture error is taken. Raises
    StudioError where no hand is of another take, or everything is too short.
    """
    pairs: dict[tuple[str, str], Pair] = {}
    for number in range(max(len(phrases), len(hands))):
        phrase = phrases[number % len(phrases)]
        others = [hands[(number + k) % len(hands)] for k in range(len(hands))]
        hand = next((hand for hand in others if hand.take != phrase.take), None)
        if hand is None:
            continue
        excerpts = _beginning(phrase), _beginning(hand)
        if min(excerpt.seconds for excerpt in excerpts) >= SHORTEST_S:
            pairs.setdefault((phrase.name, hand.name), Pair(*excerpts, phrase.name, hand.name))
    if pairs:
        return list(pairs.values())
    if all(hand.take == phrase.take for hand in hands for phrase in phrases):
        raise StudioError(
            f"The hand ({hands[0].name}) is of the same take as the phrase ({phrases[0].name}): it would ask "
            "for what the phrase does anyway. Give --hands a recording of another take."
        )
    raise StudioError(
        f"No recording has {SHORTEST_S:g} s without a capture error, too little to measure an answer on. "
        "Give longer or cleaner ones, or --all-frames."
    )


def apart_from(dataset: Dataset, takes: Sequence[Take]) -> tuple[Take, ...]:
    """The training takes without those that are, or were danced together with, one of these takes."""
    names = {take.name for take in takes}
    known = (*dataset.training, *dataset.held_out)
    given = {take.take for take in known if take.name in names} | {take.take for take in takes}
    return tuple(take for take in dataset.training if take.take not in given)


def _beginning(take: Take) -> Recording:
    """The first 1,200 ticks of the longest stretch without a capture error."""
    return longest_sound(take, math.inf).excerpt(0.0, LONGEST_S)
