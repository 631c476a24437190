"""The fallbacks of timecode and MIDI."""

from __future__ import annotations

from appliance.box.fallback import Fallback

TIMECODE_AWAY = Fallback(
    "timecode-away",
    "The timecode stays away: the dance goes on at the show's own speed, and cues wait for a GO by hand. "
    "Check the machine that sends it, its network or its cable.",
)
TIMECODE_UNHEARD = Fallback(
    "timecode-unheard",
    "No timecode can be heard: the show runs by hand.",
)
MIDI_AWAY = Fallback(
    "midi-away",
    "A MIDI device is away: what is in force stays in force. Plug it in, or remove it under midi: devices: "
    "in the box file.",
    "The MIDI device {about} is away: what is in force stays in force. Plug it in, or remove it under midi: "
    "devices: in the box file.",
)
OF_THE_REMOTE = (TIMECODE_AWAY, TIMECODE_UNHEARD, MIDI_AWAY)
