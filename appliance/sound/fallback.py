"""The sound's fallbacks: when the card, its time or the stage is away."""

from __future__ import annotations

from appliance.box.fallback import Fallback

CARD_AWAY = Fallback(
    "sound-card-away",
    "The sound card is away: the strings are silent, and sound again as soon as it is back. Plug it in, or "
    "give another `sound: {device: ...}` in the box file.",
    "The sound card {about} is away: the strings are silent, and sound again as soon as it is back. Plug it "
    "in, or give another `sound: {{device: ...}}` in the box file.",
)
NO_CARD = Fallback(
    "no-sound-card",
    "This system has no sound at all: the strings are silent until it has. Install the Debian package "
    "libportaudio2, which brings libasound2-data, or remove `sound:` from the box file.",
)
DROPOUTS = Fallback(
    "sound-dropouts",
    "The sound card got its samples too late, and crackled. After some of these it gets longer blocks, which "
    "answer later. If it goes on, give `sound: {block: ...}` a larger number in the box file.",
)
STAGE_UNSEEN = Fallback(
    "sound-rests",
    "No frame came from the stage for half a second: the strings fade out, and sound again as soon as it "
    "dances. See what the stage says.",
)
OF_THE_SOUND = (CARD_AWAY, NO_CARD, DROPOUTS, STAGE_UNSEEN)
