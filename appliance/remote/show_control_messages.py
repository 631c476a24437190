"""MIDI Show Control: GO, STOP and their like as commands of the box (MMA RP-002/RP-014)."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.show_control.packet import Message

ALL_DEVICES = 0x7F
_LIGHTING, _VIDEO, _ALL_FORMATS = 0x01, 0x30, 0x7F  # 0x30 and above: projection and video
_GO, _STOP, _RESUME, _TIMED_GO = 0x01, 0x02, 0x03, 0x04
_ALL_OFF, _RESTORE, _RESET, _GO_OFF = 0x08, 0x09, 0x0A, 0x0B
_TIME_BYTES = 5
_PLAIN: dict[int, Message] = {
    _STOP: ("/stop",),
    _GO_OFF: ("/stop",),
    _RESUME: ("/go",),
    _ALL_OFF: ("/blackout", 1),
    _RESTORE: ("/blackout", 0),
}


def command_of(message: bytes, device: int, cues: Sequence[str]) -> Message | None:
    """The command in a system exclusive message for this device number; None: there is none for the box.

    GO names the cue by its number (`name: "12"` in the show), else its place in the list; without a number it
    is the next one. RESET is the first cue. A timed GO fades as the cue says.
    """
    if len(message) < 7 or message[:2] != b"\xf0\x7f" or message[3] != 0x02:
        return None
    if message[2] not in (device, ALL_DEVICES):
        return None
    kind, what, data = message[4], message[5], message[6:-1]
    if not (kind in (_LIGHTING, _ALL_FORMATS) or kind >> 4 == _VIDEO >> 4):
        return None
    if what in _PLAIN:
        return _PLAIN[what]
    if what == _RESET:
        return ("/cue", cues[0]) if cues else None
    if what not in (_GO, _TIMED_GO):
        return None
    number = data[_TIME_BYTES if what == _TIMED_GO else 0 :].partition(b"\0")[0].decode("ascii", "replace")
    return ("/cue", cue_named(number, cues)) if number else ("/cue",)


def cue_named(number: str, cues: Sequence[str]) -> str:
    """The cue with this name, else at this place, 1 first; else the name, which show control refuses."""
    if number in cues or not number.isdigit():
        return number
    place = int(number) - 1
    return cues[place] if 0 <= place < len(cues) else number
