"""Labels, clock, and each way in which a timecode comes."""

from __future__ import annotations

import ctypes
import random
import struct
from collections.abc import Iterator

import numpy as np
import pytest

from appliance.remote import art_net_timecode
from appliance.remote.code_clock import CodeClock
from appliance.remote.linear_timecode import SAMPLE_RATE, LtcDecoder, _Label
from appliance.remote.midi_messages import MidiParser
from appliance.remote.midi_timecode import CodeHeard, MidiTimecode
from appliance.remote.timecode import BY_NAME, DAY_S, RATES, Rate, Timecode, at, time_of
from tests.fake_clock import FakeTime

TV = BY_NAME["25"]
HOUR = Timecode(1, 0, 0, 0, TV)


@pytest.mark.parametrize("rate", RATES, ids=[rate.name for rate in RATES])
def test_each_frame_of_ten_minutes_has_its_label(rate: Rate) -> None:
    """Null: without the numbers that 29.97 leaves out, ten minutes differ from the clock by 0.6 s."""
    labels = [at(float(count / rate.per_second), rate) for count in range(int(600 * rate.per_second) + 1)]
    assert [label.count for label in labels] == list(range(len(labels)))
    assert abs(labels[-1].time_s - 600.0) < 0.034
    assert str(labels[-1]) == ("00:10:00;00" if rate.drops else "00:10:00:00")
    left_out = {(label.minutes, label.frames) for label in labels if label.seconds == 0 and label.frames < 2}
    assert rate.drops == ((1, 0) not in left_out)


def test_labels_as_people_write_them() -> None:
    assert time_of("01:00:10:05", TV) == pytest.approx(3610.2)
    assert time_of("1:00:10", TV) == 3610.0
    assert time_of("00:01:00:00", BY_NAME["29.97"]) == pytest.approx(60.06, abs=0.01)  # the number left out
    for wrong in ("01:60:00:00", "24:00:00:00", "soon", "01:00:00:30"):
        with pytest.raises(ValueError, match="is no timecode"):
            time_of(wrong, TV)


def test_art_net_as_the_standard_has_it() -> None:
    label = Timecode(23, 59, 58, 24, TV)
    packet = art_net_timecode.packed(label)
    assert packet == b"Art-Net\0\x00\x97\x00\x0e\x00\x00" + bytes([24, 58, 59, 23, 1])
    assert art_net_timecode.label_in(packet) == label
    assert art_net_timecode.label_in(b"Art-Net\0\x00\x50" + bytes(20)) is None  # ArtDmx
    assert art_net_timecode.label_in(packet[:13] + b"\1" + packet[14:]) is None  # StreamId: not the master
    assert art_net_timecode.label_in(packet[:12] + b"\1" + packet[13:]) == label  # a filler is not looked at
    with pytest.raises(ValueError, match="no timecode"):
        art_net_timecode.label_in(packet[:14] + bytes([25, 58, 59, 23, 1]))


def fed(
    clock: CodeClock, time: FakeTime, seconds: float, code_s: float, speed: float = 1.0, jitter_s: float = 0.0
) -> float:
    """Labels of a code that begins at code_s; where it ends."""
    chance = random.Random(1)
    began, last_s = time.now, code_s
    for count in range(int(seconds * 25 * speed)):
        time.now = began + count / (25 * speed) + chance.random() * jitter_s
        last_s = code_s + count / 25
        clock.hear(at(last_s, TV), time.now)
    time.now = began + seconds
    return code_s + seconds * speed


def test_the_clock_is_steady_where_labels_come_late() -> None:
    """Null: the newest label alone is off by up to 20 ms and by a frame."""
    clock, time = CodeClock(), FakeTime()
    fed(clock, time, 20.0, 3600.0, jitter_s=0.02)
    began = time.now
    errors = []
    for count in range(250):
        time.now = began + count / 25 + 0.02 * ((count * 7) % 5) / 5
        clock.hear(at(3620.0 + count / 25, TV), time.now)
        found = clock.time_s(time.now)
        assert found is not None
        errors.append(found - (3620.0 + time.now - began))
    assert np.ptp(errors) < 0.006
    assert clock.jumps == 0


def test_a_drift_of_a_second_in_an_hour_is_followed() -> None:
    """Null: a clock that keeps to its first label is 0.17 s off after these ten minutes."""
    clock, time = CodeClock(), FakeTime()
    speed = 1.0 + 1.0 / 3600
    end_s = fed(clock, time, 600.0, 0.0, speed)
    assert clock.jumps == 0
    assert clock.time_s(time.now) == pytest.approx(end_s, abs=0.005)
    assert clock.speed == pytest.approx(speed, abs=3e-5)


def test_one_wrong_label_is_nothing_and_two_are_a_jump() -> None:
    clock, time = CodeClock(), FakeTime()
    end_s = fed(clock, time, 2.0, 10.0)
    clock.hear(at(500.0, TV), time.now)
    time.now += 0.04
    assert clock.time_s(time.now) == pytest.approx(end_s + 0.04, abs=0.02)
    fed(clock, time, 1.0, end_s + 0.04)
    assert clock.jumps == 0
    end_s = fed(clock, time, 1.0, 500.0)
    assert (clock.jumps, clock.state(time.now)) == (1, "running")
    assert clock.time_s(time.now) == pytest.approx(end_s, abs=0.02)


def test_a_code_of_the_day_counts_on_at_midnight() -> None:
    clock, time = CodeClock(), FakeTime()
    end_s = fed(clock, time, 4.0, DAY_S - 2.0)
    assert (clock.jumps, clock.state(time.now)) == (0, "running")
    assert clock.time_s(time.now) == pytest.approx(end_s, abs=0.02)
    assert str(clock.label(time.now))[:8] == "00:00:02"
    for _ in range(10):
        clock.hear(at(2.0, TV), time.now)
        time.now += 0.04
    assert clock.state(time.now) == "standing"
    assert clock.time_s(time.now) == DAY_S + 2.0
    fed(clock, time, 1.0, 500.0)
    assert clock.jumps == 1
    assert clock.time_s(time.now) == pytest.approx(501.0, abs=0.02)


def test_it_goes_on_for_a_while_and_is_absent_then() -> None:
    clock, time = CodeClock(freewheel_s=2.0), FakeTime()
    assert clock.state(time.now) == "absent"
    end_s = fed(clock, time, 2.0, 10.0)
    time.now += 1.5
    assert clock.state(time.now) == "freewheeling"
    assert clock.time_s(time.now) == pytest.approx(end_s + 1.5, abs=0.02)
    time.now += 2.0
    assert (clock.state(time.now), clock.time_s(time.now)) == ("absent", None)
    clock.hear(at(10.0, TV), time.now)
    assert clock.time_s(time.now) is None  # one label is not yet a code
    end_s = fed(clock, time, 1.0, 13.0)
    assert clock.time_s(time.now) == pytest.approx(end_s, abs=0.02)


def test_a_machine_that_is_paused_stands() -> None:
    clock, time = CodeClock(), FakeTime()
    fed(clock, time, 2.0, 10.0)
    for _ in range(25):
        clock.hear(at(12.0, TV), time.now)
        time.now += 0.04
    assert (clock.state(time.now), clock.time_s(time.now)) == ("standing", 12.0)
    end_s = fed(clock, time, 1.0, 12.0)
    assert clock.state(time.now) == "running"
    assert clock.time_s(time.now) == pytest.approx(end_s, abs=0.03)


def quarter_frames(label: Timecode) -> list[bytes]:
    hours = label.hours | RATES.index(label.rate) << 5
    parts = [label.frames, label.seconds, label.minutes, hours]
    nibbles = [part >> 4 * half & 0x0F for part in parts for half in range(2)]
    return [bytes([0xF1, place << 4 | nibble]) for place, nibble in enumerate(nibbles)]


def heard(messages: list[bytes]) -> list[CodeHeard]:
    code = MidiTimecode()
    return [found for one in messages if (found := code.hear(one)) is not None]


def test_midi_timecode_forwards_backwards_and_with_a_lost_piece() -> None:
    first, second = Timecode(1, 2, 3, 4, TV), Timecode(1, 2, 3, 6, TV)
    assert heard(quarter_frames(first) + quarter_frames(second)) == [
        CodeHeard(first, 1.75),
        CodeHeard(second, 1.75),
    ]
    assert heard(quarter_frames(first)[:3] + quarter_frames(first)[4:]) == []
    backwards = quarter_frames(second)[::-1] + quarter_frames(first)[::-1]
    assert heard(backwards)[-1] == CodeHeard(first)
    full = b"\xf0\x7f\x7f\x01\x01" + bytes([1 | 1 << 5, 2, 3, 4]) + b"\xf7"
    assert heard([full]) == [CodeHeard(first)]


def test_midi_bytes_in_any_pieces_are_the_same_messages() -> None:
    """With running status, real-time bytes in the midst, an unfinished message and a system exclusive one."""
    wanted = [
        b"\x90\x3c\x40",
        b"\x90\x3e\x41",
        b"\xb0\x07\x7f",
        b"\xf0\x7f\x01\x02\xf7",
        b"\xf1\x25",
        b"\xc3\x05",
    ]
    stream = b"\x12\x90\x3c\xf8\x40\x3e\x41\xb0\x07\x7f\xb0\x07\xf0\x7f\x01\xfe\x02\xf7\xf1\x25\x05\xc3\x05"
    for size in (1, 2, 5, len(stream)):
        parser = MidiParser()
        pieces = (stream[begin : begin + size] for begin in range(0, len(stream), size))
        assert [one for piece in pieces for one in parser.messages(piece)] == wanted


def track(first: Timecode, frames: int, noise: float = 0.0, level: float = 0.5) -> np.ndarray:
    """A track that libltc's own encoder makes."""
    library = ctypes.CDLL("libltc.so.11")
    library.ltc_encoder_create.restype = ctypes.c_void_p
    library.ltc_encoder_create.argtypes = (ctypes.c_double, ctypes.c_double, ctypes.c_int, ctypes.c_int)
    encoder = ctypes.c_void_p(
        library.ltc_encoder_create(SAMPLE_RATE, float(first.rate.per_second), 1 if first.rate is TV else 0, 0)
    )
    label = _Label(b"+0000", 0, 1, 1, first.hours, first.minutes, first.seconds, first.frames)
    library.ltc_encoder_set_timecode(encoder, ctypes.byref(label))
    buffer = (ctypes.c_ubyte * library.ltc_encoder_get_buffersize(encoder))()
    found = []
    for _ in range(frames):
        library.ltc_encoder_encode_frame(encoder)
        count = library.ltc_encoder_copy_buffer(encoder, buffer)
        found.append(np.frombuffer(bytes(buffer[:count]), np.uint8).astype(np.float32) / 128 - 1)
        library.ltc_encoder_inc_timecode(encoder)
    library.ltc_encoder_free(encoder)
    samples = np.concatenate(found)
    return (level * samples + np.random.default_rng(1).normal(0, noise, len(samples))).astype(np.float32)


def labels_of(samples: np.ndarray, block: int = 256) -> Iterator[tuple[Timecode, float]]:
    """Each label and the second of the track at which it ended."""
    decoder = LtcDecoder()
    for begin in range(0, len(samples), block):
        piece = samples[begin : begin + block]
        for found, before_s in decoder.labels(piece):
            yield found.label, (begin + len(piece)) / SAMPLE_RATE - before_s
    decoder.close()


@pytest.mark.parametrize("noise", [0.0, 0.08], ids=["clean", "noisy"])
def test_an_audio_track_gives_its_labels_and_when_they_ended(noise: float) -> None:
    found = list(labels_of(track(HOUR, 50, noise)))
    assert len(found) >= 45
    for label, ended_s in found:
        assert label.count - HOUR.count == round(25 * ended_s) - 1
        assert ended_s == pytest.approx((label.count - HOUR.count + 1) / 25, abs=0.001)


def test_noise_alone_is_no_timecode() -> None:
    assert list(labels_of(np.random.default_rng(1).normal(0, 0.3, SAMPLE_RATE).astype(np.float32))) == []


def test_struct_of_libltc_is_as_long_as_in_its_header() -> None:
    from appliance.remote.linear_timecode import _Frame

    assert ctypes.sizeof(_Frame) == struct.calcsize("@12xqqi80f2Bd")
