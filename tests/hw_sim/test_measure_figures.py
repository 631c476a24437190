"""Figures of a run whose truth is known: invented readings and frames with a latency put in by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hw_sim.latency import Frame, Reading, missing_frames, percentiles, response_ms, steps, transport
from hw_sim.measure import figures_of, table, verdict
from hw_sim.motions import about
from hw_sim.probe import Run

AXIS = (0.0, 1.0, 0.0)
STEP_S = 0.6
HALF = np.radians(40.0)
RECORD = np.dtype([("sections_ms", "<f4", (2,)), ("flags", "<u4")])


def readings(count: int, lost: tuple[int, ...] = ()) -> list[Reading]:
    """Every 20 ms, turning back and forth by 40 degrees every 0.6 s; 3 ms of network."""
    return [
        Reading(
            n, 10.003 + 0.02 * n, 10.0 + 0.02 * n, about(AXIS, HALF * (int(0.02 * n / STEP_S + 1e-9) % 2))
        )
        for n in range(count)
        if n not in lost
    ]


def frames(sent: list[Reading], latency_s: float = 0.0025, response_s: float = 0.08) -> list[Frame]:
    """A frame for each reading; the joint follows each step after `response_s`, in the middle of a ramp."""
    result, moments = [], steps(sent)
    for tick, reading in enumerate(sent):
        at = reading.sent_at + latency_s
        done = [np.clip((at - moment - response_s) / 0.06 + 0.5, 0.0, 1.0) for moment in moments]
        angle = HALF * sum(share if number % 2 == 0 else -share for number, share in enumerate(done))
        result.append(Frame(at, 100 + tick, reading.sequence, False, np.array(about(AXIS, angle))))
    return result


def run(sent: list[Reading], received: list[Frame]) -> Run:
    ticks = np.zeros(len(received), RECORD)
    ticks["sections_ms"] = (0.5, 1.0)
    return Run(received, sent, ticks, ("drain", "puppet"), 80.0, 0.9, 0.0)


def test_transport_is_from_sending_to_the_first_frame_with_the_reading() -> None:
    sent = readings(100)
    received = frames(sent)
    received.insert(50, received[49]._replace(arrived_at=received[49].arrived_at + 0.02, tick=999))
    way = transport(sent, received)
    np.testing.assert_allclose(way.latency_ms, 2.5, atol=1e-6)
    assert way.overtaken == 0


def test_an_overtaken_reading_counts_with_the_frame_of_the_newer_one_and_the_end_does_not() -> None:
    sent = readings(100)
    received = [frame for frame in frames(sent) if frame.sensor_sequence not in (40, 41, 98, 99)]
    way = transport(sent, received)
    assert way.overtaken == 2
    assert len(way.latency_ms) == 98
    np.testing.assert_allclose(way.latency_ms[[39, 40, 41, 42]], [2.5, 42.5, 22.5, 2.5], atol=1e-6)


def test_frames_before_the_first_reading_carry_nothing() -> None:
    silent = [Frame(9.0 + 0.02 * n, n, -1, False, np.array([1.0, 0, 0, 0])) for n in range(10)]
    assert len(transport(readings(5), silent).latency_ms) == 0
    assert transport([], []).overtaken == 0


def test_missing_frames_are_holes_in_the_numbering() -> None:
    received = frames(readings(20))
    assert missing_frames(received) == 0
    assert missing_frames(received[:5] + received[8:]) == 3
    assert missing_frames([]) == 0


def test_steps_are_found_in_the_log_although_readings_are_lost() -> None:
    assert steps(readings(120)) == pytest.approx([10.6, 11.2, 11.8])
    assert len(steps(readings(120, lost=(30, 31)))) == 3


def test_the_response_is_the_time_to_half_of_the_step() -> None:
    sent = readings(300)
    found = response_ms(steps(sent), frames(sent, response_s=0.08))
    assert len(found) >= 7
    assert np.median(found) == pytest.approx(80.0, abs=20.0)  # one frame is 20 ms


def test_a_joint_that_does_not_follow_has_no_response() -> None:
    sent = readings(300)
    still = [frame._replace(joint=np.array([1.0, 0, 0, 0])) for frame in frames(sent)]
    assert len(response_ms(steps(sent), still)) == 0
    assert percentiles(np.zeros(0), {"p50": 50.0}) == {"p50": None}


def test_the_figures_have_exactly_the_documented_names() -> None:
    sent = readings(400)
    figures = figures_of(run(sent, frames(sent)), run(sent, frames(sent, latency_s=0.012)))
    documented: dict[str, set[str]] = {
        "transport_ms": {"p50", "p99", "p999", "max"},
        "response_ms": {"p50"},
        "tick_ms": {"p50", "p99", "max"},
        "free_running_transport_ms": {"p50", "p99"},
    }
    for name, keys in documented.items():
        assert set(figures[name]) == keys
    for name in ("ticks", "late_ticks", "missing_frames", "rss_mb", "start_to_first_frame_s"):
        assert name in figures
    assert figures["transport_ms"]["p50"] == pytest.approx(2.5)
    assert figures["free_running_transport_ms"]["p50"] == pytest.approx(12.0)
    assert figures["tick_ms"]["p50"] == pytest.approx(1.5)


def healthy() -> dict[str, Any]:
    sent = readings(400)
    return figures_of(run(sent, frames(sent)), run(sent, frames(sent, latency_s=0.012)))


def test_a_healthy_box_passes() -> None:
    assert all(limit.holds for limit in verdict(healthy()))
    assert not any("FAIL" in line for line in table(healthy(), verdict(healthy())))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"transport_ms": {"p50": 3.5, "p99": 4.0, "p999": 4.0, "max": 4.0}}, "transport, median"),
        ({"transport_ms": {"p50": None, "p99": None, "p999": None, "max": None}}, "nothing came"),
        ({"free_running_transport_ms": {"p50": 6.0, "p99": 20.0}}, "against free running"),
        ({"tick_ms": {"p50": 2.2, "p99": 5.0, "max": 9.0}}, "tick, median"),
        ({"tick_ms": {"p50": 1.0, "p99": 6.5, "max": 9.0}}, "tick, p99"),
        ({"late_ticks": 1}, "late ticks"),
        ({"missing_frames": 3}, "missing frames"),
        ({"rss_mb": 140.0}, "memory"),
        ({"start_to_first_frame_s": 2.0}, "start to first frame"),
    ],
)
def test_each_limit_fails_by_itself(change: dict[str, Any], words: str) -> None:
    figures = {**healthy(), **change}
    failed = [line for line in table(figures, verdict(figures)) if line.startswith("FAIL")]
    assert failed
    assert any(words in line for line in failed)
