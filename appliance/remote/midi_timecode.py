"""MIDI timecode: quarter frames and full messages (MIDI 1.0 Detailed Specification, MTC)."""

from __future__ import annotations

from typing import NamedTuple

from appliance.remote.timecode import RATES, Timecode

QUARTER_FRAME = 0xF1
_PIECES = 8
_AHEAD_FRAMES = 1.75  # the last of eight quarter frames leaves so much after the first, which the label is of


class CodeHeard(NamedTuple):
    """A whole label, and how many frames later than that the code is as it comes."""

    label: Timecode
    ahead_frames: float = 0.0


class MidiTimecode:
    """Puts labels together, also of a tape that runs backwards."""

    def __init__(self) -> None:
        self._pieces = [-1] * _PIECES
        self._before = -1

    def hear(self, message: bytes) -> CodeHeard | None:
        """The label that this message completes; None: it is another message, or the label is not whole."""
        if message[0] == QUARTER_FRAME:
            return self._quarter_frame(message[1] >> 4, message[1] & 0x0F)
        is_full = len(message) == 10 and message[1] == 0x7F and message[3:5] == b"\x01\x01"
        if not (is_full and message[0] == 0xF0):
            return None
        self._pieces = [-1] * _PIECES
        hours, minutes, seconds, frames = message[5:9]
        return _heard(hours, minutes, seconds, frames, 0.0)

    def _quarter_frame(self, piece: int, nibble: int) -> CodeHeard | None:
        step, self._before = (piece - self._before) % _PIECES, piece
        if piece >= _PIECES or step not in (1, _PIECES - 1):  # one was lost: its label is not whole
            self._pieces = [-1] * _PIECES
        if piece >= _PIECES:
            return None
        self._pieces[piece] = nibble
        forwards = step == 1 and piece == _PIECES - 1
        backwards = step == _PIECES - 1 and piece == 0
        if not (forwards or backwards) or -1 in self._pieces:
            return None
        low = self._pieces
        frames, seconds, minutes, hours = (low[at] | low[at + 1] << 4 for at in range(0, _PIECES, 2))
        self._pieces = [-1] * _PIECES
        return _heard(hours, minutes, seconds, frames, _AHEAD_FRAMES if forwards else 0.0)


def _heard(hours: int, minutes: int, seconds: int, frames: int, ahead_frames: float) -> CodeHeard | None:
    """Bits 5 and 6 of the hours are the rate."""
    try:
        return CodeHeard(
            Timecode(hours & 0x1F, minutes & 0x3F, seconds & 0x3F, frames & 0x1F, RATES[hours >> 5 & 3]),
            ahead_frames,
        )
    except ValueError:
        return None
