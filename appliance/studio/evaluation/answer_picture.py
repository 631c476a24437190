"""answer.png: the phrase, the phrase with the hand's arm pasted on, and the dancer's answer."""

from __future__ import annotations

from pathlib import Path

from appliance.pictures.filmstrip import Strip, draw_strips, held_throughout
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.measurement import Iterations, Measurement

COLUMNS = 7


def draw_answer(path: Path, measurement: Measurement, joint: str, iterations: Iterations) -> Path:
    """Three strips, one below the other: do more joints than the held one differ from the ghost behind them?

    The ghost is the dance without the hand: the phrase behind the pasted arm, and behind the answer the same
    iterations without a hand, since many iterations change a phrase by themselves. The instants are evenly
    spaced over the whole dance, not chosen.
    """
    rehearsal, body = measurement.rehearsal, measurement.body
    danced, turns = rehearsal.held(*iterations, measurement.hand(joint))
    pasted = rehearsal.phrase.copy()
    pasted[:, rehearsal.coder.joints.index(joint)] = turns
    free, pair = rehearsal.free(iterations[0]), measurement.pair
    skeleton = rehearsal.recording.skeleton

    def strip(poses: Poses, label: str, behind: Strip | None = None) -> Strip:
        whole, roots = body.grounded(rehearsal.whole(poses), joint)
        holds = None if behind is None else held_throughout(whole, [skeleton.index(joint)])
        return Strip(whole, roots, label, behind, holds)

    phrase = strip(rehearsal.phrase, f"The phrase: {pair.phrase_name}")
    caption = "The dancer's answer; behind it, in grey, the same dance without a hand"
    strips = (
        phrase,
        strip(pasted, f"Pasted on: {joint} as in {pair.hand_name}; all else is the phrase", phrase),
        strip(danced, caption, strip(free, "")),
    )
    answer = measurement.answer(joint, danced, free)
    title = (
        f"A hand on {joint} at {iterations[0]}/{iterations[1]} moves the other joints by {answer:.1f} degrees"
    )
    return draw_strips(path, skeleton, strips, FPS, title, COLUMNS)
