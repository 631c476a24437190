"""Phrases and hands to measure an answer with: recordings of different takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, WINDOW, Dataset, Take, window_starts
from appliance.studio.evaluation.measurement import TICKS, Pair
from appliance.studio.evaluation.pictures import longest_sound
from appliance.studio.studio_error import StudioError

LONGEST_S = (TICKS + WINDOW - 1) / FPS
HALVES_S = 12.0  # a held-out take of this length is phrase and hand; a shorter one borrows the hand
SHORTEST_S = 3.0  # a shorter stretch says nothing: an answer is a mean over many poses


def pair_up(phrases: Sequence[Take], hands: Sequence[Take]) -> list[Pair]:
    """As many pairs as there are phrases or hands, whichever are more; each hand is from another take.

    Each recording contributes the beginning of its longest stretch without a capture error. Raises
    StudioError if no hand is from another take, or everything is too short.
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
    """The training takes except these takes and those that were danced together with them."""
    names = {take.name for take in takes}
    known = (*dataset.training, *dataset.held_out)
    given = {take.take for take in known if take.name in names} | {take.take for take in takes}
    return tuple(take for take in dataset.training if take.take not in given)


def _beginning(take: Take) -> Recording:
    """The first 1,200 ticks of the longest stretch without a capture error."""
    return longest_sound(take, math.inf).excerpt(0.0, LONGEST_S)


@dataclass(frozen=True)
class OwnTakes:
    """Pairs of phrase and hand, the takes of the reference, and a description."""

    pairs: list[Pair]
    reference: Sequence[Take]
    description: str


def own_takes(dataset: Dataset) -> OwnTakes:
    """The dances on which a training measures its own dancer: held-out takes, else parts of one take.

    Raises StudioError if the recordings are too few or too short.
    """
    apart = _longest_of_each([take for take in dataset.held_out if len(window_starts(take))])
    if len(apart) > 1:
        return OwnTakes(pair_up(apart, apart), dataset.training, "on takes that it never saw")
    if apart:
        return _on_one_apart(apart[0], dataset)
    return _on_thirds(_longest_of_each(dataset.training)[0])


def _on_one_apart(apart: Take, dataset: Dataset) -> OwnTakes:
    """A held-out take as phrase; the hand is its other half, or a training take."""
    training = _longest_of_each(dataset.training)
    if apart.recording.seconds >= HALVES_S:
        phrase, hand = _part(apart, 0, 2), _part(apart, 1, 2)
        description = f"on two halves of {apart.name}, never seen"
        return OwnTakes(pair_up([phrase], [hand]), dataset.training, description)
    if len(training) == 1:
        hand, rest = (_part(training[0], number, 2) for number in range(2))
        description = f"on {apart.name}, never seen, with the hand of {hand.name}, which it learned"
        return OwnTakes(pair_up([apart], [hand]), [rest], description)
    description = f"on {apart.name}, never seen, with hands of {training[0].name}"
    return OwnTakes(pair_up([apart], training[:1]), apart_from(dataset, training[:1]), description)


def _on_thirds(take: Take) -> OwnTakes:
    """A single take: its beginning as phrase, its end as hand, the middle as reference."""
    if take.recording.seconds < 3 * SHORTEST_S:
        raise StudioError(
            f"{take.name} is {take.recording.seconds:.0f} s long, too short to be phrase, hand and "
            "what the dancer did besides. Record more."
        )
    phrase, rest, hand = (_part(take, number, 3) for number in range(3))
    description = f"on thirds of {take.name}, which it learned: the figures flatter it, keep a take apart"
    return OwnTakes(pair_up([phrase], [hand]), [rest], description)


def _longest_of_each(takes: Sequence[Take]) -> list[Take]:
    """Among several recordings of a take the one with the most sound poses; the longest take first."""
    best: dict[str, Take] = {}
    for take in sorted(takes, key=lambda take: int(take.sound.sum()), reverse=True):
        best.setdefault(take.take, take)
    return list(best.values())


def _part(take: Take, number: int, parts: int) -> Take:
    """Part `number` of `parts` equal parts of a take, as a separate take."""
    first, last = (len(take.recording) * k // parts for k in (number, number + 1))
    return replace(
        take,
        name=f"{take.name}, part {number + 1} of {parts}",
        take=f"{take.take}, part {number + 1} of {parts}",
        recording=take.recording.excerpt(first / FPS, last / FPS),
        sound=take.sound[first:last],
    )
