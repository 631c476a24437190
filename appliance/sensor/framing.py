"""Packets on a serial line: COBS, a CRC-16, and a zero byte between frames.

COBS: S. Cheshire and M. Baker, Consistent Overhead Byte Stuffing, 1999. The checksum is CRC-16/XMODEM
(polynomial 0x1021, start 0), little-endian, behind the packet and inside the stuffing: it distinguishes a
damaged line from a wrong key.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import Counter

from appliance.sensor import wire

END = b"\x00"
CRC_BYTES = 2
LONGEST_FRAME = wire.LARGEST + CRC_BYTES + 1  # COBS adds one byte to anything under 254


def frame(packet: bytes) -> bytes:
    """The bytes to write for one packet, zero byte at the end included."""
    return cobs_encode(packet + crc_hqx(packet, 0).to_bytes(CRC_BYTES, "little")) + END


class Deframer:
    """Finds packets in a stream that may start anywhere and be damaged; keeps at most one frame.

    Damage is counted in `counts`: frame_length, frame_stuffing, frame_crc.
    """

    def __init__(self, counts: Counter[str]) -> None:
        self.counts = counts
        self._rest = b""
        self._overlong = False

    def feed(self, received: bytes) -> list[bytes]:
        """The packets completed by `received`."""
        *complete, self._rest = (self._rest + received).split(END)
        packets = []
        for stuffed in complete:
            packet = None if self._overlong else self._unframe(stuffed)
            self._overlong = False
            if packet is not None:
                packets.append(packet)
        if len(self._rest) > LONGEST_FRAME:
            if not self._overlong:
                self.counts["frame_length"] += 1
            self._rest = b""
            self._overlong = True
        return packets

    def _unframe(self, stuffed: bytes) -> bytes | None:
        if not stuffed:
            return None  # two zero bytes in a row: an idle line, or a sender that starts with one
        if len(stuffed) > LONGEST_FRAME:
            self.counts["frame_length"] += 1
            return None
        data = cobs_decode(stuffed)
        if data is None or len(data) <= CRC_BYTES:
            self.counts["frame_stuffing"] += 1
            return None
        packet, crc = data[:-CRC_BYTES], data[-CRC_BYTES:]
        if crc_hqx(packet, 0) != int.from_bytes(crc, "little"):
            self.counts["frame_crc"] += 1
            return None
        return packet


def cobs_encode(data: bytes) -> bytes:
    """`data` without any zero byte in it."""
    stuffed = bytearray()
    for block in data.split(END):
        while len(block) >= 254:
            stuffed.append(255)
            stuffed += block[:254]
            block = block[254:]
        stuffed.append(len(block) + 1)
        stuffed += block
    return bytes(stuffed)


def cobs_decode(stuffed: bytes) -> bytes | None:
    """The inverse of `cobs_encode`; None for bytes that it cannot have made."""
    data = bytearray()
    at = 0
    while at < len(stuffed):
        code = stuffed[at]
        block = stuffed[at + 1 : at + code]
        if code == 0 or len(block) != code - 1 or 0 in block:
            return None
        data += block
        at += code
        if code < 255 and at < len(stuffed):
            data.append(0)
    return bytes(data)
