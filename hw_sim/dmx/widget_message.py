"""Messages of a DMX USB Pro: 7E, label, length in two octets (low first), payload, E7."""

from __future__ import annotations

START, END = 0x7E, 0xE7
HEAD = 4
LONGEST = 600


def framed(label: int, payload: bytes) -> bytes:
    """One message."""
    return bytes((START, label, len(payload) % 256, len(payload) // 256)) + payload + bytes((END,))


class Deframer:
    """Messages out of a stream of bytes; after one that is broken it looks for the next start."""

    def __init__(self) -> None:
        self._waiting = bytearray()
        self.broken = 0

    def feed(self, received: bytes) -> list[tuple[int, bytes]]:
        """Label and payload of each message that is now whole."""
        self._waiting += received
        messages: list[tuple[int, bytes]] = []
        while True:
            start = self._waiting.find(START)
            if start < 0:
                self._waiting.clear()
                return messages
            del self._waiting[:start]
            if len(self._waiting) < HEAD:
                return messages
            length = self._waiting[2] + 256 * self._waiting[3]
            if length > LONGEST:
                self._skip()
            elif len(self._waiting) <= HEAD + length:
                return messages
            elif self._waiting[HEAD + length] != END:
                self._skip()
            else:
                messages.append((self._waiting[1], bytes(self._waiting[HEAD : HEAD + length])))
                del self._waiting[: HEAD + length + 1]

    def _skip(self) -> None:
        self.broken += 1
        del self._waiting[0]
