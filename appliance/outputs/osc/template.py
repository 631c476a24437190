"""OSC datagrams laid out once, so that a tick only writes numbers into them (OSC 1.0)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_DATAGRAM = 1468  # bytes: the last multiple of 4 under Ethernet's 1500 less IP and UDP headers
BUNDLE_HEADER = b"#bundle\0" + struct.pack(">Q", 1)  # time tag 1: immediately
_FORBIDDEN_IN_ADDRESS = str.maketrans(dict.fromkeys(' #*,/?[]{}"', "_"))


@dataclass(frozen=True)
class Message:
    """One message; its last arguments are `floats` numbers that change in every tick."""

    packed: bytes
    floats: int


def message(address: str, *fixed: str | int, floats: int = 0) -> Message:
    """A message with fixed strings and 32-bit integers first and then `floats` numbers, zero for now."""
    tags = "".join("s" if isinstance(argument, str) else "i" for argument in fixed)
    parts = [osc_string(address), osc_string("," + tags + "f" * floats)]
    parts += [
        osc_string(argument) if isinstance(argument, str) else struct.pack(">i", argument)
        for argument in fixed
    ]
    return Message(b"".join(parts) + bytes(4 * floats), floats)


def osc_string(text: str) -> bytes:
    """ASCII, ended by zeros up to a multiple of four bytes."""
    raw = text.encode("ascii", "replace")
    return raw + bytes(4 - len(raw) % 4)


def address_part(name: str) -> str:
    """A joint's name as one part of an address: characters that OSC reserves become underscores."""
    return name.translate(_FORBIDDEN_IN_ADDRESS).encode("ascii", "replace").decode().replace("?", "_")


class Template:
    """Datagrams in one buffer; `numbers[places[i]] = ...` writes the floats of message i.

    datagrams: views to hand to the socket, always in the same order; numbers: the buffer as big-endian
    floats; places: for each message the indexes of its floats in `numbers`.
    """

    def __init__(self, datagrams: Sequence[Sequence[Message]], bundled: bool) -> None:
        layout = bytearray()
        ends = []
        self.places: list[NDArray[np.intp]] = []
        for messages in datagrams:
            layout += BUNDLE_HEADER if bundled else b""
            for item in messages:
                layout += struct.pack(">i", len(item.packed)) if bundled else b""
                layout += item.packed
                end = len(layout) // 4
                self.places.append(np.arange(end - item.floats, end))
            ends.append(len(layout))
        self.numbers: NDArray[np.float32] = np.frombuffer(layout, ">f4")
        starts = [0, *ends[:-1]]
        whole = memoryview(layout)
        self.datagrams = tuple(whole[start:end] for start, end in zip(starts, ends, strict=True))


def bundles(messages: Sequence[Message]) -> Template:
    """The messages in as few bundles as fit an Ethernet frame each, in their order."""
    datagrams: list[list[Message]] = [[]]
    size = len(BUNDLE_HEADER)
    for item in messages:
        if datagrams[-1] and size + 4 + len(item.packed) > MAX_DATAGRAM:
            datagrams.append([])
            size = len(BUNDLE_HEADER)
        datagrams[-1].append(item)
        size += 4 + len(item.packed)
    return Template(datagrams, bundled=True)


def single(messages: Sequence[Message]) -> Template:
    """Each message as a separate datagram."""
    return Template([[item] for item in messages], bundled=False)
