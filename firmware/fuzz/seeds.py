"""Writes the seeds of the fuzzing corpus from the golden vectors and from the console's commands.

`python firmware/fuzz/seeds.py` in the repository regenerates them; inputs found by fuzzing are in the same
folders.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
CORPUS = Path(__file__).parent / "corpus"
COMMANDS = (
    "id",
    "set device 1a2b3c4d\nset key 000102030405060708090a0b0c0d0e0f\nset name left-wrist\nset network stage\n"
    "set password break a leg\nset port 9750\nset fusion ndof\nset axes 24 00\nsave\nshow",
    "prove 0001020304050607",
    "status",
    "strobe",
    "calibration save",
    "forget",
    "restart",
    "help",
    "nonsense",
)
RAW, SIGNED, CABLE, SEND, READING, LANE, PROFILE, WAIT = 1, 2, 0x80, 4, 5, 6, 7, 0  # as in fuzz_packets.cpp
HEAD = 12  # magic, version, kind, device id, boot nonce: what a signed packet of the script leaves out
TAG = 8


def packet_scripts() -> list[bytes]:
    golden = [
        bytes.fromhex(vector["datagram"])
        for vector in json.loads((REPOSITORY / "tests/golden/wire.json").read_text())["packets"]
    ]
    up = bytes([LANE, 1, CABLE | LANE, 1, SEND])
    raw = [up + bytes([RAW, len(packet)]) + packet for packet in golden]
    signed = {packet[3]: bytes([SIGNED, packet[3] - 1]) + packet[HEAD:-TAG] for packet in golden}
    hello_sequence = (1).to_bytes(4, "little")
    assignment = bytes([SIGNED, 1]) + bytes([7, 0, 0, 0, 1, 0, 0, 0]) + hello_sequence + bytes([0, 50, 1])
    evening = up + assignment + bytes([READING, WAIT, 1]) + b"".join(signed.values()) + bytes([PROFILE, SEND])
    return [
        *raw,
        *(up + script for script in signed.values()),
        evening,
        evening + bytes([LANE, 0, WAIT, 200, SEND]),
    ]


def cable_inputs() -> list[bytes]:
    frames = json.loads((REPOSITORY / "tests/golden/wire_framing.json").read_text())["frames"]
    packets = [b"\0" + bytes.fromhex(vector["frame"]) for vector in frames]
    lines = [f"{command}\n".encode() for command in COMMANDS]
    return [*packets, *lines, lines[0] + packets[0] + lines[3], b"x" * 140 + b"\n" + lines[0]]


def imu_inputs() -> list[bytes]:
    """A hub that starts and reports, and a raw chip that does, as fuzz_imus.cpp reads them."""

    def cargo(channel: int, *payload: int) -> bytes:
        return bytes([channel, len(payload), *payload])

    record = (0x16, 0, 0, 1, 2, 3, 4, 0, 0, 0, 0)
    start = (
        cargo(1, 1)
        + cargo(0)
        + cargo(2, 0xF8, 1, 3, 12, *range(12))
        + cargo(2, 0xF3, *record, 0x4B, 0x4B, 0, 0)
    )
    start += cargo(2, 0xF3, *record, 0x1F, 0x1F, 0, 0) + cargo(2, 0xFC, 0x08, 0, 0, 0, 0x88, 0x13, *[0] * 10)
    rotation = (0x08, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0x40)
    reports = cargo(3, 0xFB, 1, 0, 0, 0, *rotation, 0x04, 0, 3, 0, 10, 0, 20, 0, 30, 0)
    word = bytes([0x08, 1, 0, 2, 0, 3, 0, 0x10, 0, 0, 0, 0, 0, 0x10])
    return [b"\0" + start + reports * 12, b"\1" + bytes([0x70, 3]) + (bytes([2, 0]) + word) * 24]


def main() -> None:
    targets = {"fuzz_packets": packet_scripts(), "fuzz_cable": cable_inputs(), "fuzz_imus": imu_inputs()}
    for target, seeds in targets.items():
        folder = CORPUS / target
        folder.mkdir(parents=True, exist_ok=True)
        for seed in seeds:
            (folder / f"seed-{hashlib.sha1(seed).hexdigest()[:12]}").write_bytes(seed)
        print(f"wrote {len(seeds)} seeds to {folder.relative_to(REPOSITORY)}")


if __name__ == "__main__":
    main()
