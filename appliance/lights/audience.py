"""Which fixtures shine into the audience's eyes while the phrase dances."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from appliance.lights.beams import beams_of
from appliance.lights.head import Array
from appliance.lights.patch import Patch
from appliance.lights.phrase_run import passes
from appliance.pose.recording import Recording
from appliance.show.lights import LightsConfig

# Where people sit: this far in front of the foremost place of the phrase, on seats that rise no steeper.
DISTANCE_M, DEPTH_M = 2.5, 20.0
LOW_M, HIGH_M, RISE = 0.8, 2.0, 0.45  # eyes of the first row, seated to standing; metres up a metre back
DARK = 0.02  # a level that dazzles nobody
_EVERY_S = 0.1


def dazzling(config: LightsConfig, patch: Patch, phrase: Recording) -> list[str]:
    """A sentence for each fixture and mapping whose light meets the audience's eyes in the phrase."""
    edge = float(phrase.roots[:, 2].max()) + DISTANCE_M
    step, sentences = max(round(_EVERY_S * phrase.fps), 1), []
    for mapping in config.mappings:
        seconds: dict[str, list[float]] = {}
        danced = 0
        for one in passes(config, patch, phrase, mapping.name, 0, len(phrase), step):
            danced += 1
            beams = [beam for beam in beams_of(patch, one.values) if beam.level > DARK]
            if not beams:
                continue
            places, ways = np.array([beam.place for beam in beams]), np.array([b.direction for b in beams])
            for at in np.flatnonzero(meets_eyes(places, ways, edge)):
                seconds.setdefault(beams[at].fixture.name, []).append(one.second)
        for name, when in seconds.items():
            share = math.ceil(100 * len(set(when)) / danced)
            sentences.append(
                f"'{name}' shines into the audience's eyes in {share} % of the phrase with the mapping "
                f"'{mapping.name}', first at {when[0]:.1f} s. Hang it elsewhere, aim it at another place, or "
                "give it pan_limits and tilt_limits."
            )
    return sentences


def meets_eyes(places: Array, directions: Array, edge: float) -> NDArray[np.bool_]:
    """Whether beams (B, 3) from places (B, 3) pass where eyes are, from z = edge metres on."""
    forwards = directions[:, 2] > 1e-6
    slope = directions[:, 1] / np.where(forwards, directions[:, 2], 1.0)  # metres up a metre towards the back
    starts = np.maximum(edge, places[:, 2])
    height = places[:, 1] + slope * (starts - places[:, 2])
    back = starts - edge
    within = (height >= LOW_M) & (height <= HIGH_M + RISE * back)
    with np.errstate(divide="ignore", invalid="ignore"):
        rises = back + (LOW_M - height) / slope  # metres behind the edge where it comes up to the eyes
        falls = (height - HIGH_M - slope * back) / (RISE - slope)  # where it comes down to them
    later = ((height < LOW_M) & (slope > 0) & (rises <= DEPTH_M)) | (
        (height > HIGH_M + RISE * back) & (slope < RISE) & (falls <= DEPTH_M)
    )
    return forwards & (within | later)
