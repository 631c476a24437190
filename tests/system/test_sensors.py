"""Sensors and the real box as a process: switched on, killed, out of reach, eight at once, on a cable."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.dancer.puppeteers import HOLD_S, TAKE_S
from appliance.recorder.reading import read_journal
from hw_sim.emulator import Sent
from tests.bundles import FIGURE, MOVING, write_show
from tests.hw_sim.null_modem import NullModem
from tests.system.box import JOURNAL, PATIENCE_S, Box, await_end_of_keeper, playing
from tests.system.processes import await_that
from tests.system.wearables import Wearables

pytestmark = pytest.mark.realtime

SHOULDER = FIGURE.index("lShldr")
EIGHT = [f"hand-{number}" for number in range(8)]


def reading(above: int = -1) -> Callable[[list[Any]], bool]:
    """A frame that carries a reading with a higher number than this."""
    return lambda frame: frame[2] > above


def await_fluent(box: Box, count: int) -> None:
    """Until so many frames in a row have come of which each fifth at least carries another reading."""
    row, same, newest = 0, 0, -1
    until = time.monotonic() + PATIENCE_S
    while row < count:
        assert time.monotonic() < until, box.words
        for frame in box.frames(1):
            same, newest = (same + 1 if frame[2] == newest else 0), frame[2]
            row = row + 1 if same < 4 else 0


def since_a_pause_s(ticks: np.ndarray) -> np.ndarray:
    """For each tick, how long no readings have been missing: no pause that lets go of a joint."""
    arrivals, started = ticks["sensor_arrival"], ticks["started"]
    ended = np.append(started[0], np.where(np.diff(arrivals) > HOLD_S, started[1:], started[0]))
    return np.asarray(started - np.maximum.accumulate(ended))


def listed(box: Box, is_enough: Callable[[list[dict[str, Any]]], bool]) -> list[dict[str, Any]]:
    """What `bunraku sensors --json` tells; asked again until it is enough."""
    box_file = box.words_file.with_name("box.yaml")
    command = [sys.executable, "-m", "appliance.cli", "sensors", "--json", "--box", str(box_file)]
    until = time.monotonic() + PATIENCE_S
    while True:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
        assert done.returncode == 0, done.stderr
        sensors: list[dict[str, Any]] = json.loads(done.stdout)["sensors"]
        if is_enough(sensors):
            return sensors
        assert time.monotonic() < until, sensors


def test_switched_on_it_is_used_and_standing_still_gives_the_neutral_pose(show: Path, tmp_path: Path) -> None:
    sent: dict[int, Sent] = {}
    with playing(show, tmp_path, settings=JOURNAL) as box:
        box.frames(1)
        with Wearables(
            [box.key], box.sensors, on_sent=lambda one: sent.update({one.sample.sequence: one})
        ) as wearables:
            box.frame_that(reading())
            box.await_words("Sensor left-wrist: neutral pose taken. Dance.")
            assert box.words.index("stands still for a breath now") < box.words.index("neutral pose taken")
            still_from = box.frames(1)[-1][2]
            still_until = box.frame_that(reading(still_from + 30))[2]
            wearables.dance()
            box.frame_that(reading(still_until + 150))
            await_fluent(box, 80)
            assert box.end() == 0
    ticks = read_journal(tmp_path / "run.journal").ticks
    standing = ticks[(ticks["sensor_sequence"] >= still_from) & (ticks["sensor_sequence"] <= still_until)]
    assert np.abs(standing["pose"][:, SHOULDER, 0]).min() > 0.999
    # What the hand does against its neutral pose is what the joint does, about the same axes.
    dancing = ticks[ticks["sensor_sequence"] > still_until + 50]
    hands = np.array([sent[int(number)].sample.orientation for number in dancing["sensor_sequence"]])
    assert np.abs(hands[:, 0]).min() < 0.95
    fluent = since_a_pause_s(dancing) > TAKE_S + 0.1  # after one it is led over
    assert fluent.sum() > 20
    assert np.median(np.abs((dancing["targets"][:, 0] * hands).sum(1)[fluent])) > 0.9995


def test_killed_and_restarted_it_uses_the_readings_and_the_neutral_pose_again(
    show: Path, tmp_path: Path
) -> None:
    with playing(show, tmp_path) as box:
        box.frames(1)
        with Wearables([box.key], box.sensors) as wearables:
            box.await_words("neutral pose taken")
            wearables.dance()
            before = box.frame_that(reading())[2]
            box.kill_and_restart()
            after = box.frame_that(reading())[2]
            box.await_words("Sensor left-wrist: the neutral pose taken before is used on. Dance.")
            assert box.end() == 0
            assert wearables.sensors[0].reboots == 0
    assert after > before  # the same power-on, still counting
    assert box.words.count("neutral pose taken.") == 1


def test_after_a_power_cut_the_neutral_pose_is_used_again(show: Path, tmp_path: Path) -> None:
    """The sensor has a battery; what the box loses is its memory."""
    with playing(show, tmp_path) as box, Wearables([box.key], box.sensors) as wearables:
        box.await_words("neutral pose taken")
        wearables.dance()
        await_that((tmp_path / "sensors.memory").exists)
        box.end(signal.SIGKILL)
        await_end_of_keeper(tmp_path / "runtime")
        shutil.rmtree(tmp_path / "runtime")
        box.kill_and_restart()
        box.await_words("Sensor left-wrist: the neutral pose taken before is used on. Dance.")
        assert box.end() == 0
        assert box.words.count("neutral pose taken.") == 1


def test_out_of_reach_and_back_in_the_same_session(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box:
        box.frames(1)
        with Wearables([box.key], box.sensors) as wearables:
            box.frame_that(reading(20))
            wearables.radios[0].in_reach = False
            box.await_words("Sensor left-wrist silent for")
            last = box.frames(1)[-1][2]
            wearables.radios[0].in_reach = True
            box.frame_that(reading(last))
            box.await_words("Sensor left-wrist is back.")
            assert box.end() == 0
    assert "Danced" in box.words


def test_lost_for_longer_than_a_link_lasts_it_pairs_again(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box:
        box.frames(1)
        with Wearables([box.key], box.sensors) as wearables:
            last = box.frame_that(reading(20))[2]
            wearables.radios[0].in_reach = False
            for linked in (False, True):  # three seconds without the box; then it is found again
                until = time.monotonic() + PATIENCE_S
                while wearables.sensors[0].is_linked != linked:
                    assert time.monotonic() < until
                    last = box.frames(1)[-1][2]  # the network may hold back some of the old session
                wearables.radios[0].in_reach = True
            box.frame_that(reading(last))
            assert box.end() == 0


def test_switched_off_and_on_its_joint_goes_on_without_standing_still(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box:
        box.frames(1)
        with Wearables([box.key], box.sensors) as wearables:
            box.await_words("neutral pose taken")
            wearables.dance()
            boot_nonce = wearables.sensors[0].boot_nonce
            before = box.frame_that(reading())[2]
            wearables.do(lambda now: wearables.sensors[0].switch_off(now, 1.0))
            box.frame_that(lambda frame: 0 <= frame[2] < before)  # it counts from zero
            box.await_words("Sensor left-wrist is on again: its joint goes on where it was.")
            assert wearables.sensors[0].boot_nonce != boot_nonce
            assert box.end() == 0


def test_a_double_tap_takes_the_neutral_pose_again(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box:
        box.frames(1)
        with Wearables(
            [box.key], box.sensors, motion=lambda _: lambda t_s: (1.0, 0.0, 0.0, 0.0)
        ) as wearables:
            box.await_words("neutral pose taken")

            def tap(now: float) -> None:
                wearables.sensors[0].taps += 1

            wearables.do(tap)
            box.await_words("neutral pose taken", count=2)
            assert box.end() == 0


def test_eight_sensors_at_once_and_the_list_of_them(tmp_path: Path) -> None:
    hands: list[dict[str, object]] = [
        {"sensor": name, "joint": joint} for name, joint in zip(EIGHT, MOVING, strict=False)
    ]
    show = write_show(tmp_path / "show", hands)
    with playing(show, tmp_path, names=EIGHT) as box:
        box.frames(1)
        with Wearables(list(box.keys.values()), box.sensors):
            sensors = listed(
                box, lambda them: all(one["rate_hz"] > 40 and one["age_s"] < 1.0 for one in them)
            )
            assert [one["name"] for one in sensors] == EIGHT
            assert {one["state"] for one in sensors} == {"linked"}
            assert len({one["way"] for one in sensors}) == 8
            assert {one["firmware"] for one in sensors} == {"1.0.0"}
            for name in EIGHT[: len(MOVING)]:
                box.await_words(f"Sensor {name}: neutral pose taken")
            listed(box, lambda them: all(0 < (one["round_trip_s"] or 0) < 1.0 for one in them))
            assert box.end() == 0
    assert "Traceback" not in box.words


def test_from_the_network_to_a_cable_and_back(show: Path, tmp_path: Path) -> None:
    cable = NullModem(tmp_path)
    serial = {"sensors": {"serial": [{"device": str(cable.far)}]}}
    with playing(show, tmp_path, settings=serial) as box:
        box.frames(1)
        with Wearables([box.key], box.sensors, cable=cable.near) as wearables:
            first = box.frame_that(reading(20))[2]
            box.await_words("Sensor left-wrist is linked by 127.0.0.1:")
            with cable:
                box.await_words(f"Sensor left-wrist now speaks by {cable.far}. The dance goes on.")
                on_cable = box.frame_that(reading(first + 30))[2]
            box.await_words("Sensor left-wrist now speaks by 127.0.0.1:")
            box.frame_that(reading(on_cable))
            assert wearables.sensors[0].reboots == 0
            assert box.end() == 0
    assert "Traceback" not in box.words
