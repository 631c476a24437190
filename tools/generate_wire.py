"""Writes what is made from the wire's declaration: wire.h, the tables in docs/wire.md, the golden vectors.

`python -m tools.generate_wire` in the repository regenerates them; a test fails when one is stale.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

from appliance.sensor import framing, wire
from tools.wire_header import header

REPOSITORY = Path(__file__).parents[1]
TABLES = REPOSITORY / "docs" / "wire.md"
HEADER = REPOSITORY / "firmware" / "wearable" / "src" / "core" / "wire.h"
VECTORS = REPOSITORY / "tests" / "golden" / "wire.json"
FRAMES = REPOSITORY / "tests" / "golden" / "wire_framing.json"
BEGIN, END = "<!-- generated: begin -->\n", "<!-- generated: end -->\n"
KEY = bytes(range(wire.KEY_BYTES))
SIGN = (0x1A2B3C4D, 0xDEADBEEF, 7, 258)  # device id, boot nonce, session, sequence
HALF = 0.5**0.5
EXAMPLES: tuple[wire.Packet, ...] = (
    wire.Hello(
        *SIGN, wire.WIRE_HASH, 1, 2, 3, battery=87, flags=wire.HAS_PROFILE, imu_id=bytes(range(0x50, 0x60))
    ),
    wire.Assignment(*SIGN, hello_sequence=3, hand=1, rate_hz=50, led=1),
    wire.Reading(*SIGN, 0xFFFFFFFF, (1.0, 0.0, 0.0, 0.0), 0xFF, 87, 23, 0, 0, wire.HAS_PROFILE),
    wire.Reading(*SIGN, 20_000, (HALF, 0.0, -HALF, 0.0), 0, 255, wire.ROUND_TRIP_UNKNOWN, 1, 2, 0),
    wire.Reading(*SIGN, 0, (-0.5, 0.5, -0.5, 0.5), 0x3C, 0, 0, 255, 255, wire.IS_NDOF),
    wire.Heartbeat(*SIGN, echo_sequence=0xFFFFFFFF, echo_held_us=1234, led=wire.LED_STROBE),
    wire.Call(*SIGN),
    wire.Profile(*SIGN, imu_id=bytes(range(0x50, 0x60)), offsets=bytes(range(0xE0, 0xF6))),
    wire.Restore(*SIGN, imu_id=bytes(range(0x50, 0x60)), offsets=bytes(22)),
)
PAYLOADS = (
    b"\x01",
    b"\x00",
    b"\x00\x00\x00",
    b"\x01\x02\x00\x03",
    bytes(range(50)),
    bytes(wire.READING.size),
)


def main() -> None:
    for path, text in generated().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        print(f"wrote {path.relative_to(REPOSITORY)}")


def generated() -> dict[Path, str]:
    """Each file and what it should hold."""
    before, _, rest = TABLES.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    return {
        TABLES: before + BEGIN + tables() + END + after,
        HEADER: header(),
        VECTORS: vectors(),
        FRAMES: frames(),
    }


def tables() -> str:
    """Every packet as a table of offset, bytes, type, field and meaning, in Markdown."""
    text = f"\nMagic `{wire.MAGIC:#06x}`, version {wire.VERSION}, wire hash `{wire.WIRE_HASH:#010x}`.\n"
    for layout in wire.LAYOUTS.values():
        text += f"\n### {layout.name}: kind {layout.kind}, {layout.direction}, {layout.size} bytes\n\n"
        text += f"{layout.meaning}\n\n| offset | bytes | type | field | meaning |\n|---|---|---|---|---|\n"
        rows = [
            ("magic", wire.U16, 'the bytes "BK"'),
            ("version", wire.U8, "of this wire"),
            ("kind", wire.U8, f"{layout.kind}"),
            *layout.fields,
        ]
        offset = 0
        for name, coding, meaning in rows:
            c_type = coding.c_type + (f"[{coding.count}]" if coding.count > 1 else "")
            text += f"| {offset} | {coding.size} | `{c_type}` | {name} | {meaning} |\n"
            offset += coding.size
        tag = wire.TAG_BYTES
        text += f"| {offset} | {tag} | `uint8_t[{tag}]` | tag | keyed BLAKE2s of all before |\n"
    return text + "\n"


def vectors() -> str:
    """One line of JSON for each example packet: its fields, its key, its bytes."""
    tagger = wire.Tagger(KEY)
    packets = [
        {
            "packet": type(packet).__name__,
            "fields": {field.name: _plain(getattr(packet, field.name)) for field in fields(packet)},
            "datagram": wire.pack(packet, tagger).hex(),
        }
        for packet in EXAMPLES
    ]
    return _json({"wire_hash": wire.WIRE_HASH, "key": KEY.hex(), "packets": packets})


def frames() -> str:
    """Payloads and their frames on a serial line."""
    return _json({"frames": [{"payload": p.hex(), "frame": framing.frame(p).hex()} for p in PAYLOADS]})


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.hex()
    return list(value) if isinstance(value, tuple) else value


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1) + "\n"


if __name__ == "__main__":
    main()
