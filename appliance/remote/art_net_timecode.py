"""Art-Net timecode: 19 bytes with the operation code 0x9700 (Art-Net 4, 'ArtTimeCode packet definition')."""

from __future__ import annotations

import errno
import socket
import struct

from appliance.outputs.dmx.art_net import ID, PORT, PROTOCOL_VERSION
from appliance.remote.timecode import RATES, Timecode
from appliance.sensor.transports.udp import bind_early

_OP_TIMECODE = 0x9700
_HEAD = struct.pack("<8sH", ID, _OP_TIMECODE)
_LENGTH = 19
_STREAM = 13  # place of StreamId, which was a filler of 0 before Art-Net 4 had it


def packed(label: Timecode) -> bytes:
    numbers = label.frames, label.seconds, label.minutes, label.hours, RATES.index(label.rate)
    return _HEAD + bytes([0, PROTOCOL_VERSION, 0, 0, *numbers])


def label_in(packet: bytes) -> Timecode | None:
    """The label of a packet; None: it is another one, or of another stream than the master, which is 0.

    Raises ValueError for a label that does not exist.
    """
    if len(packet) < _LENGTH or not packet.startswith(_HEAD) or packet[_STREAM] != 0:
        return None
    frames, seconds, minutes, hours, kind = packet[14:_LENGTH]
    if kind >= len(RATES):
        raise ValueError(f"Art-Net timecode has no type {kind}.")
    return Timecode(hours, minutes, seconds, frames, RATES[kind])


def open_port(host: str, port: int = PORT) -> socket.socket:
    """The port, shared with this box's own Art-Net wires, which send from it. Raises OSError.

    Those are connected to their nodes, so that whatever comes from other machines comes here; of a machine
    that is such a node only broadcasts do.
    """
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        try:
            bind_early(one, (host, port))
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            # Another user's program has it: with this option both hear broadcasts, which most desks send.
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            bind_early(one, (host, port))
    except OSError:
        one.close()
        raise
    return one
