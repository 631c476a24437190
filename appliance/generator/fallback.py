"""The generator's fallbacks."""

from __future__ import annotations

from appliance.box.fallback import Fallback

NOT_MADE = Fallback(
    "motion-not-made",
    "A source of motion gave nothing sound: the last phrase plays on. Its sentence says why; copy the show "
    "again if a network is damaged.",
    "{about} gave nothing sound: the last phrase plays on. Its sentence says why; copy the show again if a "
    "network is damaged.",
)
NOT_SAVED = Fallback(
    "motion-not-kept",
    "A motion that was to be kept is not on the disk: it can be called until the box is switched off. Look "
    "at the disk: bunraku doctor.",
    "A motion that was to be kept is not on {about}: it can be called until the box is switched off. Look at "
    "the disk: bunraku doctor.",
)
OF_THE_GENERATOR = (NOT_MADE, NOT_SAVED)
