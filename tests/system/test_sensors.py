"""Sensors and the real box: switched on, killed, out of reach, eight at once, on a cable."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.dancer.puppeteers import HOLD_S, TAKE_S
from appliance.recorder.journal_reader import read_journal
from hw_sim.emulator import Sent
from hw_sim.peers import remove_folder
from tests.bundles import FIGURE, MOVING, write_show
from tests.hw_sim.null_modem import NullModem
from tests.system.box import JOURNAL, Box, playing
from tests.system.processes import PATIENCE_S, wait_until

pytestmark = pytest.mark.realtime

SHOULDER = FIGURE.index("lShldr")
EIGHT = [f"hand-{number}" for number in range(8)]


def reading(above: int = -1) -> Callable[[list[Any]], bool]:
    """Whether a frame carries a reading with a higher number than this."""
    return lambda frame: frame[2] > above


def await_fluent(box: Box, count: int) -> None:
    """Wait for this many frames in a row of which at least every fifth carries another reading."""
    row, same, newest = 0, 0, -1

    def is_fluent() -> bool:
        nonlocal row, same, newest
        for frame in box.frames(1):
            same, newest = (same + 1 if frame[2] == newest else 0), frame[2]
            row = row + 1 if same < 4 else 0
        return row >= count

    wait_until(is_fluent, lambda: box.output, lambda: None)


def since_a_pause_s(ticks: np.ndarray) -> np.ndarray:
    """For each tick, seconds since the last pause in the readings that let go of a joint."""
    arrivals, started = ticks["sensor_arrival"], ticks["started"]
    ended = np.append(started[0], np.where(np.diff(arrivals) > HOLD_S, started[1:], started[0]))
    return np.asarray(started - np.maximum.accumulate(ended))


def await_sensors(box: Box, is_enough: Callable[[dict[str, Any]], bool]) -> dict[str, dict[str, Any]]:
    """What `bunraku sensors` lists by name, once every sensor is as wanted."""

    def find() -> dict[str, dict[str, Any]] | None:
        sensors = box.listed_sensors()
        return sensors if all(map(is_enough, sensors.values())) else None

    sensors = wait_until(find, lambda: f"{box.listed_sensors()}")
    assert sensors is not None
    return sensors


def test_a_sensor_switched_on_is_used_and_standing_still_gives_the_neutral_pose(
    show: Path, tmp_path: Path
) -> None:
    sent: dict[int, Sent] = {}
    with (
        playing(show, tmp_path, settings=JOURNAL) as box,
        box.wearables(on_sent=lambda one: sent.update({one.sample.sequence: one})) as wearables,
    ):
        box.frame_that(reading())
        box.await_output("Sensor left-wrist: neutral pose taken. Dance.")
        assert box.output.index("stands still for a breath now") < box.output.index("neutral pose taken")
        still_from = box.frames(1)[-1][2]
        still_until = box.frame_that(reading(still_from + 30))[2]
        wearables.dance()
        box.frame_that(reading(still_until + 150))
        await_fluent(box, 80)
        assert box.end() == 0
    ticks = read_journal(tmp_path / "run.journal").ticks
    standing = ticks[(ticks["sensor_sequence"] >= still_from) & (ticks["sensor_sequence"] <= still_until)]
    assert np.abs(standing["pose"][:, 0, SHOULDER, 0]).min() > 0.999
    # The joint turns as the hand does from its neutral pose, about the same axes.
    dancing = ticks[ticks["sensor_sequence"] > still_until + 50]
    hands = np.array([sent[int(number)].sample.orientation for number in dancing["sensor_sequence"]])
    assert np.abs(hands[:, 0]).min() < 0.95
    fluent = since_a_pause_s(dancing) > TAKE_S + 0.1  # after a pause the joint is blended over
    assert fluent.sum() > 20
    assert np.median(np.abs((dancing["targets"][:, 0] * hands).sum(1)[fluent])) > 0.9995


def test_killed_and_restarted_it_uses_the_readings_and_the_neutral_pose_again(
    show: Path, tmp_path: Path
) -> None:
    with playing(show, tmp_path) as box, box.wearables() as wearables:
        box.await_output("neutral pose taken")
        wearables.dance()
        before = box.frame_that(reading())[2]
        box.kill_and_restart()
        after = box.frame_that(reading())[2]
        box.await_output("Sensor left-wrist: the neutral pose taken before is used on. Dance.")
        assert box.end() == 0
        assert wearables.sensors[0].reboots == 0
    assert after > before  # the same power-on, still counting
    assert box.output.count("neutral pose taken.") == 1


def test_after_a_power_cut_the_neutral_pose_is_used_again(show: Path, tmp_path: Path) -> None:
    """The sensor has a battery; the box loses its memory."""
    with playing(show, tmp_path) as box, box.wearables() as wearables:
        box.await_output("neutral pose taken")
        wearables.dance()
        wait_until((tmp_path / "sensors.memory").exists)
        box.end_whole()
        remove_folder(tmp_path / "runtime")
        box.kill_and_restart()
        box.await_output("Sensor left-wrist: the neutral pose taken before is used on. Dance.")
        assert box.end() == 0
        assert box.output.count("neutral pose taken.") == 1


def test_out_of_reach_and_back_in_the_same_session(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box, box.wearables() as wearables:
        box.frame_that(reading(20))
        wearables.radios[0].in_reach = False
        box.await_output("Sensor left-wrist silent for")
        last = box.frames(1)[-1][2]
        wearables.radios[0].in_reach = True
        box.frame_that(reading(last))
        box.await_output("Sensor left-wrist is back.")
        assert box.end() == 0
    assert "Danced" in box.output


def test_lost_for_longer_than_a_link_lasts_it_pairs_again(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box, box.wearables() as wearables:
        last = box.frame_that(reading(20))[2]
        wearables.radios[0].in_reach = False
        for linked in (False, True):  # it gives up the box after three seconds, then finds it again
            until = time.monotonic() + PATIENCE_S
            while wearables.sensors[0].is_linked != linked:
                assert time.monotonic() < until, box.output
                last = box.frames(1)[-1][2]  # the network may still deliver readings of the old session
            wearables.radios[0].in_reach = True
        box.frame_that(reading(last))
        assert box.end() == 0


def test_switched_off_and_on_its_joint_goes_on_without_standing_still(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box, box.wearables() as wearables:
        box.await_output("neutral pose taken")
        wearables.dance()
        boot_nonce = wearables.sensors[0].boot_nonce
        before = box.frame_that(reading())[2]
        wearables.do(lambda now: wearables.sensors[0].switch_off(now, 1.0))
        box.frame_that(lambda frame: 0 <= frame[2] < before)  # it counts from zero
        box.await_output("Sensor left-wrist is on again: its joint goes on where it was.")
        assert wearables.sensors[0].boot_nonce != boot_nonce
        assert box.end() == 0


def test_a_double_tap_takes_the_neutral_pose_again(show: Path, tmp_path: Path) -> None:
    with (
        playing(show, tmp_path) as box,
        box.wearables(motion=lambda _: lambda t_s: (1.0, 0.0, 0.0, 0.0)) as wearables,
    ):
        box.await_output("neutral pose taken")

        def tap(now: float) -> None:
            wearables.sensors[0].taps += 1

        wearables.do(tap)
        box.await_output("neutral pose taken", count=2)
        assert box.end() == 0


def test_eight_sensors_at_once_and_the_list_of_them(tmp_path: Path) -> None:
    hands: list[dict[str, object]] = [
        {"sensor": name, "joint": joint} for name, joint in zip(EIGHT, MOVING, strict=False)
    ]
    show = write_show(tmp_path / "show", hands)
    with playing(show, tmp_path, names=EIGHT) as box, box.wearables():
        sensors = await_sensors(
            box, lambda one: one["state"] == "linked" and one["rate_hz"] > 40 and one["age_s"] < 1.0
        )
        assert list(sensors) == EIGHT
        assert len({one["way"] for one in sensors.values()}) == 8
        assert {one["firmware"] for one in sensors.values()} == {"1.0.0"}
        for name in EIGHT[: len(MOVING)]:
            box.await_output(f"Sensor {name}: neutral pose taken")
        await_sensors(box, lambda one: 0 < (one["round_trip_s"] or 0) < 1.0)
        assert box.end() == 0
    assert "Traceback" not in box.output


def test_from_the_network_to_a_cable_and_back(show: Path, tmp_path: Path) -> None:
    cable = NullModem(tmp_path)
    serial = {"sensors": {"serial": [{"device": str(cable.far)}]}}
    with playing(show, tmp_path, settings=serial) as box, box.wearables(cable=cable.near) as wearables:
        first = box.frame_that(reading(20))[2]
        box.await_output("Sensor left-wrist is linked by 127.0.0.1:")
        with cable:
            box.await_output(f"Sensor left-wrist now speaks by {cable.far}. The dance goes on.")
            on_cable = box.frame_that(reading(first + 30))[2]
        box.await_output("Sensor left-wrist now speaks by 127.0.0.1:")
        box.frame_that(reading(on_cable))
        assert wearables.sensors[0].reboots == 0
        assert box.end() == 0
    assert "Traceback" not in box.output


def test_wearables_send_as_often_as_the_box_file_asks(show: Path, tmp_path: Path) -> None:
    with (
        playing(show, tmp_path, settings={"sensors": {"rate_hz": 100}}) as box,
        box.wearables() as wearables,
    ):
        box.await_output("neutral pose taken")
        wearables.dance()
        wait_until(lambda: box.listed_sensors()["left-wrist"]["rate_hz"] > 80, lambda: box.output)
        assert box.listed_sensors()["left-wrist"]["loss"] < 0.5
        assert box.end() == 0
