"""Datagrams that nobody should send: noise, damaged commands, bundles, nests, numbers out of all bounds.

`python -m tests.show_control.fuzz SEED COUNT` reads them under limits of time and memory.
"""

from __future__ import annotations

import math
import os
import random
import resource
import signal
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

from appliance.levers.addresses import FORMS
from appliance.show_control.packet import MOST_MESSAGES, messages_in

_NUMBERS = [0, 1, -1, 2, 65, 2**31 - 1, -(2**31)]
_FLOATS = [0.0, 1.0, 0.5, -1.0, 1e30, math.nan, math.inf, -math.inf, 60.1]
_TEXTS = ["", "storm", "ink", "lShldr", "x" * 300, "\x1b[2J", "雪", "/go", "\x00", "%s%n", "../../etc"]


def datagrams(seed: int, count: int) -> Iterator[bytes]:
    """The same ones for a seed."""
    rng = random.Random(seed)
    for _ in range(count):
        yield rng.choice(_KINDS)(rng)


def message(address: str, *arguments: object) -> bytes:
    """An OSC message, packed here: it also packs what a library refuses."""
    tags, body = ",", b""
    for argument in arguments:
        if isinstance(argument, bool):
            tags += "T" if argument else "F"
        elif isinstance(argument, int):
            tags, body = tags + "i", body + struct.pack(">i", argument)
        elif isinstance(argument, float):
            tags, body = tags + "f", body + struct.pack(">f", argument) if abs(argument) < 3e38 else body
            if len(body) % 4 or not math.isfinite(argument):
                body += struct.pack(">f", math.copysign(math.inf, argument))
        else:
            tags, body = tags + "s", body + _text(str(argument))
    return _text(address) + _text(tags) + body


def bundle(*elements: bytes) -> bytes:
    """What is in it is not looked at."""
    return (
        b"#bundle\0" + struct.pack(">Q", 1) + b"".join(struct.pack(">i", len(one)) + one for one in elements)
    )


def _text(text: str) -> bytes:
    packed = text.encode() + b"\0"
    return packed + b"\0" * (-len(packed) % 4)


def _some_command(rng: random.Random) -> bytes:
    """An address that there is, with arguments that may fit."""
    choices: list[object] = [*_NUMBERS, *_FLOATS, *_TEXTS, True, False]
    return message(
        rng.choice(list(FORMS)),
        *(rng.choice(choices) for _ in range(rng.choice([0, 0, 1, 1, 2, 3, 8]))),
    )


def _noise(rng: random.Random) -> bytes:
    return rng.randbytes(rng.choice([0, 1, 3, 4, 8, 33, 100, 1500]))


def _damaged(rng: random.Random) -> bytes:
    damaged = bytearray(_some_command(rng))
    for _ in range(rng.randrange(1, 6)):
        damaged[rng.randrange(len(damaged))] = rng.randrange(256)
    return bytes(damaged[: rng.randrange(len(damaged) + 1)] if rng.random() < 0.3 else damaged)


def _tags(rng: random.Random) -> bytes:
    """A command with type tags of all kinds, and no arguments to match, or nested arrays."""
    tags = "".join(rng.choice("ifsbhdtrmTFNIcS[]{}x") for _ in range(rng.choice([1, 5, 40, 2000])))
    if rng.random() < 0.2:
        tags = "[" * 1500 + "]" * rng.choice([0, 1500])
    return _text(rng.choice(list(FORMS))) + _text("," + tags) + rng.randbytes(rng.randrange(64))


def _bundle(rng: random.Random, depth: int = 0) -> bytes:
    bundle = b"#bundle\0" + rng.choice([struct.pack(">Q", 1), rng.randbytes(8)])
    for _ in range(rng.choice([0, 1, 2, 5, 70])):
        inner = _bundle(rng, depth + 1) if depth < 3 and rng.random() < 0.1 else _some_command(rng)
        size = len(inner) if rng.random() < 0.9 else rng.choice(_sizes(len(bundle)))
        bundle += struct.pack(">i", size) + inner
    return bundle


def _sizes(at: int) -> list[int]:
    """Of an element at this byte, untrue: back to itself, to the one before it, to all places before."""
    return [-4, -8, -12, -20, -24, -4 - at, 12 - at, -at, -1, 0, 3, 4, 2**31 - 1, -(2**31)]


def _returns(rng: random.Random) -> bytes:
    """A bundle of a few messages, and sizes that lead back into them."""
    bundle = b"#bundle\0" + struct.pack(">Q", 1)
    for _ in range(rng.randrange(4)):
        inner = _some_command(rng)
        bundle += struct.pack(">i", len(inner)) + inner
    return bundle + struct.pack(">i", rng.choice(_sizes(len(bundle))))


def _blobs(rng: random.Random) -> bytes:
    """Texts and blobs of untrue lengths, which lead back to the texts."""
    count = rng.choice([1, 10, 400])
    body = b"x" * rng.choice([0, 4, 1000]) + b"\0" * 4
    body += b"".join(struct.pack(">i", rng.choice(_sizes(len(body)))) for _ in range(count))
    return _text(rng.choice(list(FORMS))) + _text("," + "sb" * count) + body


def _nest(rng: random.Random) -> bytes:
    """Bundles in bundles, as deep as a datagram allows."""
    nest = _some_command(rng)
    for _ in range(rng.choice([5, 50, 190])):
        nest = b"#bundle\0" + struct.pack(">Qi", 1, len(nest)) + nest
    return nest


def _huge(rng: random.Random) -> bytes:
    return message(rng.choice(list(FORMS)), "x" * rng.choice([4000, 4096, 9000, 60000]))


_KINDS = (
    *(_some_command,) * 6,
    *(_damaged,) * 6,
    *(_noise,) * 4,
    *(_tags,) * 2,
    *(_bundle,) * 2,
    _returns,
    _blobs,
    _nest,
    _huge,
)


_WITHIN_S, _WITHIN_BYTES = 5, 64 << 20  # for one datagram; more than it has so far, for all


def _read_all(seed: int, count: int) -> None:
    """Ends the process with words about the datagram that takes too long, too much, or raises."""
    has_bytes = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (has_bytes + _WITHIN_BYTES,) * 2)
    received = b""

    def end(*_: object) -> None:
        print(f"seed {seed}: not read within {_WITHIN_S} s: {received.hex()}", flush=True)
        os._exit(1)

    signal.signal(signal.SIGALRM, end)
    for received in datagrams(seed, count):
        signal.alarm(_WITHIN_S)
        try:
            assert len(messages_in(received)) <= MOST_MESSAGES
        except ValueError:
            continue
        except BaseException as error:
            sys.exit(f"seed {seed}: {error!r}: {received.hex()}")
    print("all read")


if __name__ == "__main__":
    _read_all(int(sys.argv[1]), int(sys.argv[2]))
