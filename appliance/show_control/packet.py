"""OSC packets as plain messages, both ways; anything else raises ValueError, and nothing else."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from pythonosc.osc_message_builder import BuildError, OscMessageBuilder
from pythonosc.parsing import osc_types

Message = tuple[str | int | float, ...]  # an OSC address and its arguments
MOST_MESSAGES = 1024  # parts of a bundle; programs of motion capture send all bones and faces in one
DEEPEST_BUNDLE = 8
BUNDLE = b"#bundle\0"  # how a bundle begins
URGENT = ("/panic", "/blackout", "/stop", "/go")

_NOW = bytes([0, 0, 0, 0, 0, 0, 0, 1])  # time tag
_HEAD_BYTES = len(BUNDLE + _NOW)
_NUMBERS = {tag: struct.Struct(f">{packed}") for tag, packed in zip("ifhd", "ifqd", strict=True)}
_CONSTANTS = {"T": True, "F": False}
_TRIGGERS = "IN"  # OSC's impulse and nil: a trigger, and no value
_URGENT = re.compile(rb"(%s)(?=[\0\s,]|\Z)" % "|".join(URGENT).encode())
_NO_OSC = "This is no OSC."


class Unread(NamedTuple):
    """Stands for the first argument that was not read; tag: its type, empty where the message is damaged."""

    tag: str = ""


def messages_in(received: bytes) -> list[tuple[str, list[object]]]:
    """Addresses and arguments of a datagram, bundles flattened in their order, time tags taken as 'now'.

    Each step goes forward in the datagram, so its length bounds time and memory. (python-osc's parser turns
    for ever at an element of -4 bytes.) An argument of a type that no command takes, or that cannot be read,
    is Unread, and the last one: /panic is heard whatever comes with it, and URGENT ones however they are
    filled up. Raises ValueError for what is no OSC, and for bundles of more than MOST_MESSAGES or deeper than
    DEEPEST_BUNDLE.
    """
    messages: list[tuple[str, list[object]]] = []
    for element in _elements(received, 0):
        if len(messages) == MOST_MESSAGES:
            raise ValueError(f"A bundle may hold at most {MOST_MESSAGES} messages. Split it.")
        messages.append(_message(element))
    return messages


def urgent_address(received: bytes) -> bytes:
    """Which of URGENT a datagram begins with, also one that no program of OSC has filled up; else empty."""
    found = _URGENT.match(received)
    return found[1] if found else b""


def datagram(*messages: Message) -> bytes:
    """One OSC message, several in a bundle: address, then whole numbers, fractions and texts. Raises
    ValueError for others.
    """
    try:
        packed = [_packed(one) for one in messages]
    except (BuildError, osc_types.BuildError, ValueError, OverflowError) as error:  # a fraction above 3.4e38
        raise ValueError(f"This is no OSC: {error}") from None
    if len(packed) == 1:
        return packed[0]
    return b"".join((BUNDLE, _NOW, *(part for one in packed for part in (struct.pack(">i", len(one)), one))))


def _packed(message: Message) -> bytes:
    builder = OscMessageBuilder(str(message[0]))
    for argument in message[1:]:
        builder.add_arg(argument)
    return bytes(builder.build().dgram)


def readable(text: str) -> str:
    """The text without control characters, safe to show on a terminal."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def is_readable(values: Sequence[object]) -> bool:
    """Whether the texts among them have no control characters in them."""
    return all(value.isprintable() for value in values if isinstance(value, str))


def _elements(packet: bytes, depth: int) -> Iterator[bytes]:
    """The messages of a packet, in their order, unread."""
    if not packet.startswith(BUNDLE):
        yield packet
        return
    if len(packet) < _HEAD_BYTES or depth == DEEPEST_BUNDLE:
        raise ValueError(_NO_OSC)
    at = _HEAD_BYTES
    while at < len(packet):
        size = int.from_bytes(packet[at : at + 4], "big", signed=True)
        at += 4
        if size <= 0 or size % 4 or at + size > len(packet):
            raise ValueError(_NO_OSC)
        yield from _elements(packet[at : at + size], depth + 1)
        at += size


def _message(packet: bytes) -> tuple[str, list[object]]:
    if urgent := urgent_address(packet):
        behind = packet[len(urgent) :].lstrip(b"\0\r\n ")
        return urgent.decode(), list(_arguments(behind.ljust(4, b"\0") if behind else behind, 0))
    try:
        address, at = _text(packet, 0)
    except ValueError:
        raise ValueError(_NO_OSC) from None
    if not address.startswith("/"):
        raise ValueError(_NO_OSC)
    return address, list(_arguments(packet, at))


def _arguments(packet: bytes, at: int) -> Iterator[object]:
    tag = ""
    if at == len(packet):  # some senders leave the type tags out where there are no arguments
        return
    try:
        tags, at = _text(packet, at)
        if not tags.startswith(","):
            raise ValueError(_NO_OSC)
        for tag in tags[1:]:
            if tag in _TRIGGERS:
                continue
            if tag in _CONSTANTS:
                yield _CONSTANTS[tag]
            else:
                value, at = _value(packet, at, tag)
                yield value
    except (ValueError, struct.error):
        yield Unread()
    except KeyError:
        yield Unread(tag)


def _value(packet: bytes, at: int, tag: str) -> tuple[object, int]:
    """An argument of this type, and the place behind it. Raises ValueError, KeyError, struct.error."""
    if tag in "sS":
        return _text(packet, at)
    number = _NUMBERS[tag]
    packed = packet[at : at + number.size]
    if tag == "f":
        packed = packed.ljust(number.size, b"\0")  # Reaktor leaves out zeros at the end
    return number.unpack(packed)[0], at + number.size


def _text(packet: bytes, at: int) -> tuple[str, int]:
    """A text, and the place behind the zeros that fill it up. Raises ValueError."""
    end = packet.index(0, at)
    behind = end + 4 - (end - at) % 4
    if behind > len(packet):
        raise ValueError(_NO_OSC)
    return packet[at:end].decode(), behind
