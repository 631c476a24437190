"""The wire: round trips, what is refused, and nothing generated that is stale."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from hashlib import blake2s
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from appliance.sensor import wire
from tools import generate_wire

KEY = bytes(range(16))
TAGGER = wire.Tagger(KEY)
READING = wire.Reading(5, 6, 0, 7, 8, (1.0, 0.0, 0.0, 0.0), 0x3C, 90, 23, 1, 2, 0)


def tagger_of(device_id: int) -> wire.Tagger | None:
    return TAGGER if device_id in (5, generate_wire.SIGN[0]) else None


@pytest.mark.parametrize("packet", generate_wire.EXAMPLES, ids=lambda packet: type(packet).__name__)
def test_every_packet_comes_back_as_it_went(packet: wire.Packet) -> None:
    data = wire.pack(packet, wire.Tagger(generate_wire.KEY))
    back = wire.unpack(data, tagger_of)
    if isinstance(packet, wire.Reading):
        assert isinstance(back, wire.Reading)
        assert back.orientation == pytest.approx(packet.orientation, abs=0.5 / wire.Q14)
        back = replace(back, orientation=packet.orientation)
    assert back == packet


def test_a_reading_is_what_the_documentation_says_byte_for_byte() -> None:
    data = wire.pack(READING, TAGGER)
    signed = struct.pack(
        "<HBBIIIII4hBBHBBB", 0x4B42, 1, 3, 5, 6, 0, 7, 8, 16384, 0, 0, 0, 0x3C, 90, 23, 1, 2, 0
    )
    assert data == signed + blake2s(signed, key=KEY, digest_size=8).digest()
    assert len(data) == wire.READING.size == 47


@pytest.mark.parametrize("path", generate_wire.generated(), ids=lambda path: path.name)
def test_generated_files_are_fresh(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == generate_wire.generated()[path], (
        "stale: run python -m tools.generate_wire"
    )


def test_the_golden_vectors_unpack() -> None:
    golden = json.loads(generate_wire.VECTORS.read_text(encoding="utf-8"))
    assert golden["wire_hash"] == wire.WIRE_HASH
    tagger = wire.Tagger(bytes.fromhex(golden["key"]))
    for vector in golden["packets"]:
        packet = wire.unpack(bytes.fromhex(vector["datagram"]), lambda _: tagger)
        assert type(packet).__name__ == vector["packet"]
        assert packet.sequence == vector["fields"]["sequence"]


@pytest.mark.parametrize(
    ("reason", "damage"),
    [
        ("length", lambda data: data[:10]),
        ("length", lambda data: data + b"\x00"),
        ("magic", lambda data: b"XX" + data[2:]),
        ("version", lambda data: data[:2] + b"\x09" + data[3:]),
        ("kind", lambda data: data[:3] + b"\x63" + data[4:]),
        ("device", lambda data: data[:4] + b"\x99" + data[5:]),
        ("tag", lambda data: data[:-1] + bytes([data[-1] ^ 1])),
        ("tag", lambda data: data[:20] + bytes([data[20] ^ 128]) + data[21:]),
    ],
)
def test_refused_with_the_reason(reason, damage) -> None:
    with pytest.raises(wire.WireError) as caught:
        wire.unpack(damage(wire.pack(READING, TAGGER)), tagger_of)
    assert caught.value.reason == reason


def test_another_key_does_not_do() -> None:
    with pytest.raises(wire.WireError, match="tag"):
        wire.unpack(wire.pack(READING, wire.Tagger(bytes(16))), tagger_of)


def test_the_hash_follows_the_declaration(monkeypatch: pytest.MonkeyPatch) -> None:
    before = wire.declaration()
    monkeypatch.setattr(wire.READING, "fields", wire.READING.fields[::-1])
    assert wire.declaration() != before


def test_a_value_that_does_not_fit_is_an_error_and_never_a_wrong_packet() -> None:
    with pytest.raises(struct.error):
        wire.pack(replace(READING, battery=256), TAGGER)
    with pytest.raises(struct.error):
        wire.pack(replace(READING, orientation=(2.0, 0.0, 0.0, 0.0)), TAGGER)


def test_a_short_key_is_refused() -> None:
    with pytest.raises(ValueError, match="16 bytes"):
        wire.Tagger(b"short")


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_but_a_wire_error(data: bytes) -> None:
    with pytest.raises(wire.WireError):
        wire.unpack(data, tagger_of)
