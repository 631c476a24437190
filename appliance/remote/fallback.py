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
PROJECTOR_AWAY = Fallback(
    "projector-unswitched",
    "A projector is not switched by the opening hours. Switch it by hand; check its power, its network and "
    "its PJLink password.",
    "The projector {about}. Opening hours do not switch it: do it by hand; check its power, its network and "
    "its PJLink password.",
)
CLOCK_NOT_SET = Fallback(
    "clock-not-set",
    "The box does not know the time: its clock was never set. It is open all the time, and the dance goes "
    "on. Connect it to a network with a time server, or give it a battery for its clock.",
)
OF_THE_REMOTE = (TIMECODE_AWAY, TIMECODE_UNHEARD, MIDI_AWAY, PROJECTOR_AWAY, CLOCK_NOT_SET)
