"""Serial framing: any payload comes through, damage costs one frame, a stream may start anywhere."""

from __future__ import annotations

import json
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from appliance.sensor import framing, wire
from tools import generate_wire

payloads = st.binary(min_size=1, max_size=wire.LARGEST)


@given(st.binary(max_size=800))
def test_stuffing_leaves_no_zero_and_loses_nothing(data: bytes) -> None:
    stuffed = framing.cobs_encode(data)
    assert 0 not in stuffed
    assert framing.cobs_decode(stuffed) == data


@given(st.lists(payloads, max_size=6), st.integers(1, 40))
def test_packets_come_through_in_any_portions(packets: list[bytes], portion: int) -> None:
    stream = b"".join(framing.frame(packet) for packet in packets)
    deframer = framing.Deframer(Counter())
    came = [p for at in range(0, len(stream), portion) for p in deframer.feed(stream[at : at + portion])]
    assert came == packets
    assert not deframer.counts


@given(st.binary(max_size=300), payloads)
def test_garbage_before_a_frame_costs_at_most_that_frame(garbage: bytes, packet: bytes) -> None:
    deframer = framing.Deframer(Counter())
    deframer.feed(garbage)
    deframer.feed(framing.frame(packet))
    assert deframer.feed(framing.frame(packet)) == [packet]


@given(payloads, st.data())
def test_a_flipped_bit_never_passes(packet: bytes, data: st.DataObject) -> None:
    frame = bytearray(framing.frame(packet))
    bit = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    assert packet not in framing.Deframer(Counter()).feed(bytes(frame) + b"\x00")


def test_an_endless_line_without_a_zero_keeps_no_memory_and_is_counted_once() -> None:
    counts: Counter[str] = Counter()
    deframer = framing.Deframer(counts)
    for _ in range(1000):
        assert deframer.feed(b"\x55" * 100) == []
    assert len(deframer._rest) <= framing.LONGEST_FRAME
    deframer.feed(b"\x00")
    assert counts == {"frame_length": 1}
    assert deframer.feed(framing.frame(b"after")) == [b"after"]


def test_every_kind_of_damage_has_its_counter() -> None:
    counts: Counter[str] = Counter()
    deframer = framing.Deframer(counts)
    deframer.feed(b"\x00\x00\x00")
    assert not counts
    deframer.feed(b"\x09\x01\x00")
    deframer.feed(framing.cobs_encode(b"payload??") + b"\x00")
    deframer.feed(b"\x01" * 200 + b"\x00")
    assert counts == {"frame_stuffing": 1, "frame_crc": 1, "frame_length": 1}


def test_the_golden_frames() -> None:
    golden = json.loads(generate_wire.FRAMES.read_text(encoding="utf-8"))
    for vector in golden["frames"]:
        frame = bytes.fromhex(vector["frame"])
        assert framing.Deframer(Counter()).feed(frame) == [bytes.fromhex(vector["payload"])]
    # By hand: CRC-16/XMODEM of 0x01 is 0x1021; 01 21 10 holds no zero, so COBS puts 04 in front.
    assert framing.frame(b"\x01") == b"\x04\x01\x21\x10\x00"
