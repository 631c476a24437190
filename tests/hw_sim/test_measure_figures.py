"""Figures of a run whose truth is known: invented readings and frames with a latency put in by hand."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hw_sim.figures import Evidence, figures_of, table, verdict
from hw_sim.journal_reader import read_journal
from hw_sim.latency import (
    Frame,
    Restart,
    SentReading,
    lag_ms,
    missing_frames,
    percentiles,
    power_on_s,
    response_ms,
    steps,
    transport,
    watched_steps,
)
from hw_sim.measure import power_on_course
from hw_sim.motions import about, dance, multiply
from hw_sim.peers import ProbeError
from hw_sim.probe import Run
from hw_sim.screen import Picture, Screen, Watcher, held_joint
from tests.virtual_display import virtual_display

AXIS = (0.0, 1.0, 0.0)
STEP_S = 0.6
HALF = np.radians(40.0)
RECORD = np.dtype([("sections_ms", "<f4", (2,)), ("flags", "<u4")])


def readings(count: int, lost: tuple[int, ...] = ()) -> list[SentReading]:
    """Every 20 ms, turning back and forth by 40 degrees every 0.6 s; 3 ms of network."""
    return [
        SentReading(
            n, 10.003 + 0.02 * n, 10.0 + 0.02 * n, about(AXIS, HALF * (int(0.02 * n / STEP_S + 1e-9) % 2))
        )
        for n in range(count)
        if n not in lost
    ]


def frames(sent: list[SentReading], latency_s: float = 0.0025, response_s: float = 0.08) -> list[Frame]:
    """A frame for each reading; the joint follows each step after `response_s`, in the middle of a ramp."""
    result, moments = [], steps(sent)
    for tick, reading in enumerate(sent):
        at = reading.sent_at + latency_s
        done = [np.clip((at - moment - response_s) / 0.06 + 0.5, 0.0, 1.0) for moment in moments]
        angle = HALF * sum(share if number % 2 == 0 else -share for number, share in enumerate(done))
        result.append(Frame(at, 100 + tick, reading.sequence, False, np.array(about(AXIS, angle))))
    return result


def run(sent: list[SentReading], received: list[Frame]) -> Run:
    ticks = np.zeros(len(received), RECORD)
    ticks["sections_ms"] = (0.5, 1.0)
    return Run(received, sent, ticks, ("drain", "puppet"), 80.0, 0.9, 0.0)


def power_ons(count: int, until_reading_s: float = 0.75) -> tuple[list[SentReading], list[Frame]]:
    """A sensor that is on for 1.5 s and off as long; each boot counts its readings from zero."""
    sent, received = [], []
    for boot in range(count):
        power_on_at = 20.0 + 3.0 * boot
        for n in range(35):
            at = power_on_at + until_reading_s + 0.02 * n
            sent.append(SentReading(n, at, at, (1.0, 0.0, 0.0, 0.0), power_on_at))
            received.append(Frame(at + 0.002, len(received), n, False, np.array([1.0, 0, 0, 0])))
        gap = np.arange(sent[-1].sent_at + 0.022, power_on_at + 3.0 + until_reading_s, 0.02)
        received += [Frame(at, len(received) + k, 34, False, np.zeros(4)) for k, at in enumerate(gap)]
    return sent, received


def evidence() -> Evidence:
    sent = readings(400)
    locked, free = run(sent, frames(sent, response_s=0.02)), run(sent, frames(sent, latency_s=0.012))
    return Evidence(locked, free, run(*power_ons(5)), [Restart(10.0, 10.1, 11.0 + n / 10) for n in range(3)])


def test_from_power_on_to_the_first_frame_that_carries_a_reading_of_it() -> None:
    np.testing.assert_allclose(power_on_s(*power_ons(5)), 0.752, atol=1e-6)


def test_a_power_on_of_which_no_frame_tells_is_left_out() -> None:
    sent, received = power_ons(3)
    ended = [frame for frame in received if frame.arrived_at < 26.5]
    assert len(power_on_s(sent, ended)) == 2
    assert len(power_on_s(sent, [])) == 0
    assert len(power_on_s([], received)) == 0


def test_a_power_on_without_a_reading_is_later_than_all_others() -> None:
    """Null: of the readings that came, each is in time."""
    sent, received = power_ons(2)
    some = replace(evidence(), power_ons=run(sent, received), switched_on=3)
    assert figures_of(some)["power_on_to_reading_s"] == {"p50": pytest.approx(0.752), "max": None}
    few = figures_of(replace(some, switched_on=5))
    assert (few["power_ons"], few["unanswered_power_ons"]) == (2, 3)
    failed = [limit.label for limit in verdict(few) if not limit.holds]
    assert failed == ["sensor's power-on to its reading in a frame, median"]
    assert "2 power-ons of a sensor, 3 more without a reading" in "\n".join(table(few, verdict(few)))


def test_a_sensor_is_switched_on_and_off_as_often_as_its_course_says() -> None:
    assert [power_on_course(seconds, 1.5).switched_on for seconds in (4.0, 18.0, 120.0)] == [2, 6, 9]
    assert power_on_course(30.0, 5.0).switched_on == 9


def test_transport_is_from_sending_to_the_first_frame_with_the_reading() -> None:
    sent = readings(100)
    received = frames(sent)
    received.insert(50, received[49]._replace(arrived_at=received[49].arrived_at + 0.02, tick=999))
    transported = transport(sent, received)
    np.testing.assert_allclose(transported.latency_ms, 2.5, atol=1e-6)
    assert transported.overtaken == 0


def test_an_overtaken_reading_counts_with_the_frame_of_the_newer_one_and_the_end_does_not() -> None:
    sent = readings(100)
    received = [frame for frame in frames(sent) if frame.sensor_sequence not in (40, 41, 98, 99)]
    transported = transport(sent, received)
    assert transported.overtaken == 2
    assert len(transported.latency_ms) == 98
    np.testing.assert_allclose(transported.latency_ms[[39, 40, 41, 42]], [2.5, 42.5, 22.5, 2.5], atol=1e-6)


def test_frames_before_the_first_reading_carry_nothing() -> None:
    silent = [Frame(9.0 + 0.02 * n, n, -1, False, np.array([1.0, 0, 0, 0])) for n in range(10)]
    assert len(transport(readings(5), silent).latency_ms) == 0
    assert transport([], []).overtaken == 0


def chunk(kind: int, content: bytes) -> bytes:
    stored = zlib.compress(content)
    head = struct.pack("<4sHHII", b"bkj2", kind, 0, len(stored), len(content))
    return head + struct.pack("<I", zlib.crc32(head + stored)) + stored


def test_a_tick_that_the_journal_lost_counts_as_late(tmp_path: Path) -> None:
    """The disk that lost it held the box up, perhaps."""
    layout = [("tick", "<i8", ()), ("flags", "<u4", ())]
    (tmp_path / "1.segment").write_bytes(chunk(1, json.dumps({"record": layout}).encode()))
    entries = [struct.pack("<QIIqI", number, 1, 12, 100 + number, 0) for number in (1, 2, 5)]
    log = chunk(3, b"".join(entries))
    (tmp_path / "2.segment").write_bytes(log)
    journal = read_journal(tmp_path)
    assert journal.ticks["tick"].tolist() == [101, 102, 105] and journal.gaps == 2
    some = evidence()
    figures = figures_of(replace(some, locked=replace(some.locked, gaps=2)))
    assert figures["late_ticks"] == 2 and "FAIL  late ticks" in "\n".join(table(figures, verdict(figures)))
    (tmp_path / "2.segment").write_bytes(log[:30] + bytes([log[30] ^ 1]) + log[31:])
    with pytest.raises(ValueError, match="damaged"):
        read_journal(tmp_path)
    (tmp_path / "1.segment").unlink()
    (tmp_path / "2.segment").unlink()
    with pytest.raises(ValueError, match="no journal"):
        read_journal(tmp_path)


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


def test_steps_that_show_late_or_never_count_as_later_than_all_others() -> None:
    sent = readings(400)
    moments = steps(sent)
    early, late = frames(sent, response_s=0.02), frames(sent, response_s=0.35)
    third = moments[2] - 0.02
    received = [one if one.arrived_at < third else other for one, other in zip(early, late, strict=True)]
    assert len(response_ms(moments, received)) < len(moments) / 2 < watched_steps(moments, received)
    figures = figures_of(replace(evidence(), locked=run(sent, received)))
    assert figures["response_ms"] == {"p50": None} and figures["unseen_steps"] > figures["steps"]
    assert "nothing came" in "\n".join(table(figures, verdict(figures)))


def test_percentiles_with_what_is_missing() -> None:
    values = np.random.default_rng(1).normal(size=101)
    for share in (0.0, 12.3, 50.0, 99.0, 99.9, 100.0):
        found = percentiles(values, {"p": share})["p"]
        assert found == pytest.approx(np.percentile(values, share), abs=6e-4)
    assert percentiles(np.array([1.0, 3.0]), {"p50": 50.0, "max": 100.0}, 1) == {"p50": 3.0, "max": None}
    assert percentiles(np.array([1.0]), {"p50": 50.0}, 1) == {"p50": None}


def test_the_figures_have_exactly_the_documented_names() -> None:
    figures = figures_of(evidence())
    documented: dict[str, set[str]] = {
        "transport_ms": {"p50", "p99", "p999", "max"},
        "response_ms": {"p50"},
        "tick_ms": {"p50", "p99", "max"},
        "free_running_transport_ms": {"p50", "p99"},
        "power_on_to_reading_s": {"p50", "max"},
        "restart_to_reading_s": {"p50", "max"},
        "kill_to_reading_s": {"p50", "max"},
    }
    for name, keys in documented.items():
        assert set(figures[name]) == keys
    for name in ("ticks", "late_ticks", "missing_frames", "rss_mb", "start_to_first_frame_s"):
        assert name in figures
    assert figures["transport_ms"]["p50"] == pytest.approx(2.5)
    assert figures["free_running_transport_ms"]["p50"] == pytest.approx(12.0)
    assert figures["tick_ms"]["p50"] == pytest.approx(1.5)
    assert figures["power_on_to_reading_s"]["p50"] == pytest.approx(0.752)
    assert figures["restart_to_reading_s"] == {"p50": pytest.approx(1.0), "max": pytest.approx(1.1)}
    assert figures["kill_to_reading_s"]["p50"] == pytest.approx(1.1)
    assert (figures["power_ons"], figures["restarts"]) == (5, 3)


def healthy() -> dict[str, Any]:
    return figures_of(evidence())


def test_a_healthy_box_passes() -> None:
    assert all(limit.holds for limit in verdict(healthy()))
    assert not any("FAIL" in line for line in table(healthy(), verdict(healthy())))


def test_the_firmware_may_take_as_long_as_joining_a_wifi_takes() -> None:
    slow = {"power_on_to_reading_s": {"p50": 2.0, "max": 2.1}}
    assert not all(limit.holds for limit in verdict({**healthy(), **slow}))
    assert all(limit.holds for limit in verdict({**healthy(), **slow, "firmware": True}))


@pytest.mark.parametrize(
    ("change", "label"),
    [
        ({"transport_ms": {"p50": 3.5, "p99": 4.0, "p999": 4.0, "max": 4.0}}, "transport, median"),
        ({"transport_ms": {"p50": None, "p99": None, "p999": None, "max": None}}, "nothing came"),
        ({"free_running_transport_ms": {"p50": 6.0, "p99": 20.0}}, "against free running"),
        ({"response_ms": {"p50": 46.0}}, "response to a step"),
        ({"response_ms": {"p50": None}}, "nothing came"),
        ({"tick_ms": {"p50": 2.2, "p99": 5.0, "max": 9.0}}, "tick, median"),
        ({"tick_ms": {"p50": 1.0, "p99": 6.5, "max": 9.0}}, "tick, p99"),
        ({"late_ticks": 1}, "late ticks"),
        ({"missing_frames": 3}, "missing frames"),
        ({"rss_mb": 140.0}, "memory"),
        ({"start_to_first_frame_s": 2.0}, "start to first frame"),
        ({"power_on_to_reading_s": {"p50": 1.1, "max": 1.1}}, "sensor's power-on"),
        ({"power_on_to_reading_s": {"p50": None, "max": None}}, "sensor's power-on"),
        ({"restart_to_reading_s": {"p50": 1.6, "max": 1.6}}, "box's restart"),
        ({"kill_to_reading_s": {"p50": 1.6, "max": 1.6}}, "the same from its end"),
    ],
)
def test_each_limit_fails_by_itself(change: dict[str, Any], label: str) -> None:
    figures = {**healthy(), **change}
    failed = [line for line in table(figures, verdict(figures)) if line.startswith("FAIL")]
    assert failed
    assert any(label in line for line in failed)


@pytest.mark.parametrize("late_s", [0.03, 0.055, 0.09])
def test_the_lag_of_a_dancing_hand_is_found_whatever_its_neutral_pose(late_s: float) -> None:
    hand, other = dance(3), np.array([0.5, -0.5, 0.5, 0.5])
    sent = [SentReading(n, 10.0 + 0.02 * n, 10.0 + 0.02 * n, hand(0.02 * n)) for n in range(300)]
    at_s = 10.05 + np.arange(220) / 40.0
    shown = [
        Picture(float(at), np.array(multiply(tuple(other), hand(float(at) - late_s - 10.0)))) for at in at_s
    ]
    assert lag_ms(sent, shown) == pytest.approx(1000.0 * late_s, abs=2.0)


def test_a_joint_that_does_its_own_dance_has_no_lag() -> None:
    hand, another = dance(3), dance(4)
    sent = [SentReading(n, 10.0 + 0.02 * n, 10.0 + 0.02 * n, hand(0.02 * n)) for n in range(300)]
    shown = [Picture(10.0 + n / 40.0, np.array(another(n / 40.0))) for n in range(240)]
    assert lag_ms(sent, shown) is None
    assert lag_ms(sent[:3], shown) is None


PROJECTOR = """
import sys, time
from appliance.projector.context import GlContext
from appliance.projector.stamp import stamp
from appliance.projector.window import Window
from appliance.show.projector import ProjectorConfig

window = Window(ProjectorConfig(size=(640, 480)), "window")
context = GlContext(window)
for number, line in enumerate(sys.stdin):
    context.gl.screen.clear(0.3, 0.3, 0.3)
    stamp(context.gl.screen, number, [float(part) for part in line.split()] or None)
    context.finish()
    window.show()
    print(flush=True)
"""


ORIENTATIONS = [(1.0, 0.0, 0.0, 0.0), (0.5, -0.5, 0.5, -0.5), (0.6, 0.0, -0.8, 0.0)]


def wait_for(holds: Callable[[], bool]) -> None:
    until = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.005)


def test_what_the_projector_stamps_is_read_from_the_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    with virtual_display() as display:
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
        command = [sys.executable, "-c", PROJECTOR]
        drawer = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert drawer.stdin is not None and drawer.stdout is not None
        with drawer, closing(Screen()) as screen:
            watcher = Watcher(screen)
            watcher.start()
            began = time.monotonic()
            for count, stamped in enumerate(ORIENTATIONS, 1):
                for drawn in (stamped, ()):  # then a picture that shows no dance
                    drawer.stdin.write(" ".join(map(str, drawn)) + "\n")
                    drawer.stdin.flush()
                    drawer.stdout.readline()
                    wait_for(lambda wanted=count: len(watcher.pictures) == wanted)
            drawer.stdin.close()
            pictures = watcher.stop()
    np.testing.assert_allclose([one.joint for one in pictures], ORIENTATIONS, atol=1.1e-3)
    assert all(one.arrived_at > began for one in pictures)


@pytest.mark.parametrize("damage", [1 << 51, 1 << 50, 1 << 45, 1 << 20, 1 << 2])
def test_a_stamp_that_is_half_drawn_is_no_stamp(damage: int) -> None:
    whole = 0b1010 << 48 | 0x12345678901 << 4 | sum(range(10)) + 1 & 15
    found = held_joint(whole)
    assert found is not None
    assert found[3] == pytest.approx(2 * (0x101) / 1023 - 1)
    assert held_joint(whole ^ damage) is None


def test_without_a_screen_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ProbeError, match=r"No X11 screen .* xvfb-run"):
        Screen()


def test_the_light_of_a_step_is_the_first_picture_that_shows_half_of_it() -> None:
    """Pictures at 50 Hz; a joint that turns by 0.4 radians within four of them, 50 ms after the step."""
    at_s = 10.0 + 0.02 * np.arange(100)
    half = 0.2 * np.clip((at_s - 10.55) / 0.08, 0.0, 1.0)
    pictures = [
        Picture(float(now), np.array([np.cos(turn), 0.0, np.sin(turn), 0.0]))
        for now, turn in zip(at_s, half, strict=True)
    ]
    assert response_ms([10.5], pictures) == pytest.approx([100.0])
    assert len(response_ms([11.4], pictures)) == 0  # nothing moves any more
