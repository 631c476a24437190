"""What a training measures its own dancer's answer on: takes kept apart, else parts of one take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from appliance.studio.data.dataset import FPS, Dataset, Take
from appliance.studio.evaluation.measurement import Pair
from appliance.studio.evaluation.pairs import SHORTEST_S, apart_from, pair_up
from appliance.studio.studio_error import StudioError

HALVES_S = 12.0  # a take kept apart of that length is phrase and hand; a shorter one borrows the hand


@dataclass(frozen=True)
class OwnTakes:
    """Pairs of phrase and hand, the takes that are the reference, and what they are in a sentence."""

    pairs: list[Pair]
    reference: Sequence[Take]
    words: str


def own_takes(dataset: Dataset) -> OwnTakes:
    """The best that there is. Raises StudioError where the recordings are too few or too short."""
    apart, training = dataset.held_out, dataset.training
    if len({take.take for take in apart}) > 1:
        return OwnTakes(pair_up(apart, apart), training, "on takes that it never saw")
    if apart:
        longest = max(apart, key=lambda take: len(take.recording))
        if longest.recording.seconds >= HALVES_S:
            phrase, hand = _part(longest, 0, 2), _part(longest, 1, 2)
            return OwnTakes(
                pair_up([phrase], [hand]), training, f"on two halves of {longest.name}, never seen"
            )
        if len({take.take for take in training}) == 1:
            hand, rest = (_part(training[0], number, 2) for number in range(2))
            words = f"on {longest.name}, never seen, with the hand of {hand.name}, which it learned"
            return OwnTakes(pair_up([longest], [hand]), [rest], words)
        return OwnTakes(
            pair_up([longest], training[:1]),
            apart_from(dataset, training[:1]),
            f"on {longest.name}, never seen, with hands of {training[0].name}",
        )
    longest = max(training, key=lambda take: len(take.recording))
    if longest.recording.seconds < 3 * SHORTEST_S:
        raise StudioError(
            f"{longest.name} is {longest.recording.seconds:.0f} s long, too short to be phrase, hand and "
            "what the dancer did besides. Record more."
        )
    phrase, rest, hand = (_part(longest, number, 3) for number in range(3))
    return OwnTakes(
        pair_up([phrase], [hand]),
        [rest],
        f"on thirds of {longest.name}, which it learned: the figures flatter it, keep a take apart",
    )


def _part(take: Take, number: int, parts: int) -> Take:
    """One of so many equal parts of a take, as a take of its own."""
    first, last = (len(take.recording) * k // parts for k in (number, number + 1))
    return replace(
        take,
        name=f"{take.name}, part {number + 1} of {parts}",
        take=f"{take.take}, part {number + 1} of {parts}",
        recording=take.recording.excerpt(first / FPS, last / FPS),
        sound=take.sound[first:last],
    )
