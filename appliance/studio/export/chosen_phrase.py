"""The phrase of a new show: the recorded stretch that loops best, made endless."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Dataset
from appliance.studio.improviser.naturalness import Naturalness, Yardstick, measure
from appliance.studio.improviser.phrase import SEAM_S, STAGE_M, closed_loop, faultiness, on_stage
from appliance.studio.improviser.stretches import best_stretches

LONGEST_S, SHORTEST_S = 60.0, 10.0
CHOICE = 0.6  # fraction of the longest stretch: the rest is room to choose in
FINALISTS = 4
_SPARE_S = 0.5


@dataclass(frozen=True)
class ChosenPhrase:
    """A phrase that loops, where in which recording it was danced, and how natural it is."""

    phrase: Recording
    recording: str
    from_s: float
    to_s: float
    candidates: int
    natural: Naturalness

    def as_json(self) -> dict[str, Any]:
        """For the report."""
        return {
            "recording": self.recording,
            "seconds_of_it": [round(self.from_s, 2), round(self.to_s, 2)],
            "chosen_from": self.candidates,
            "naturalness": self.natural.as_json(),
        }


def choose_phrase(dataset: Dataset) -> ChosenPhrase | None:
    """The best of the stretches whose end meets their beginning; None where no take is long enough.

    Each is closed by a crossfade, brought to the middle of the stage and measured against the recordings:
    pace, smoothness, range, feet.
    """
    parts = [
        (take, first, take.recording.excerpt(first / FPS, end / FPS))
        for take in dataset.takes
        for first, end in take.sound_runs
    ]
    room_s = max((part.seconds for _, _, part in parts), default=0.0) - SEAM_S - _SPARE_S
    if room_s < SHORTEST_S:
        return None
    seconds = min(LONGEST_S, max(SHORTEST_S, CHOICE * room_s))
    yardstick = Yardstick.of(dataset.takes, dataset.moving)
    dances = [part for _, _, part in parts]
    stretches = best_stretches(dances, yardstick, seconds, STAGE_M, SEAM_S, FINALISTS)
    found = []
    for stretch in stretches:
        take, first, part = parts[stretch.dance]
        phrase = on_stage(closed_loop(part, stretch.first, stretch.last))
        natural = measure(phrase, yardstick)
        begins_s, ends_s = ((first + frame) / FPS + take.begins_s for frame in (stretch.first, stretch.last))
        chosen = ChosenPhrase(phrase, take.file, begins_s, ends_s, len(stretches), natural)
        found.append((faultiness(natural) + stretch.cost, chosen))
    return min(found, key=lambda one: one[0])[1] if found else None
