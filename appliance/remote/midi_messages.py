"""MIDI 1.0 as a stream of bytes: whole messages, with running status and real-time bytes between them."""

from __future__ import annotations

from collections.abc import Iterator

_DATA_BYTES = {0x80: 2, 0x90: 2, 0xA0: 2, 0xB0: 2, 0xC0: 1, 0xD0: 1, 0xE0: 2}
_SYSTEM_BYTES = {0xF1: 1, 0xF2: 2, 0xF3: 1, 0xF6: 0}
_SYSTEM_EXCLUSIVE, _END, _REAL_TIME = 0xF0, 0xF7, 0xF8
LONGEST = 512  # bytes of a system exclusive message; what is longer is left out


class MidiParser:
    """Cuts bytes as they come into messages; anything that is not whole is left out. Never raises."""

    def __init__(self) -> None:
        self._status = 0  # running status; 0: none
        self._data = bytearray()
        self._exclusive: bytearray | None = None

    def messages(self, received: bytes) -> Iterator[bytes]:
        """Each message that is complete with these bytes, its status byte first, real-time bytes left out."""
        for byte in received:
            if byte >= _REAL_TIME:
                continue
            if byte == _END:
                if self._exclusive is not None and len(self._exclusive) < LONGEST:
                    yield bytes(self._exclusive) + bytes([_END])
                self._exclusive = None
            elif byte >= 0x80:
                yield from self._begin(byte)
            elif self._exclusive is not None:
                if len(self._exclusive) < LONGEST:
                    self._exclusive.append(byte)
            elif self._status:
                yield from self._continue(byte)

    def _begin(self, status: int) -> Iterator[bytes]:
        self._data.clear()
        self._exclusive = bytearray([status]) if status == _SYSTEM_EXCLUSIVE else None
        self._status = status if status != _SYSTEM_EXCLUSIVE else 0
        if status >= _SYSTEM_EXCLUSIVE and _SYSTEM_BYTES.get(status, -1) <= 0:
            self._status = 0
            if status in _SYSTEM_BYTES:
                yield bytes([status])

    def _continue(self, byte: int) -> Iterator[bytes]:
        self._data.append(byte)
        status = self._status
        needed = _SYSTEM_BYTES[status] if status >= _SYSTEM_EXCLUSIVE else _DATA_BYTES[status & 0xF0]
        if len(self._data) == needed:
            yield bytes([status, *self._data])
            self._data.clear()
            if status >= _SYSTEM_EXCLUSIVE:  # system messages end the running status
                self._status = 0
