"""A foreign sensor and the stage's link over real datagrams on loopback; time is invented."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from appliance.sensor import wire
from appliance.sensor.foreign.door import FILE, Door, foreign_key, open_door
from appliance.sensor.foreign.foreign_sensor import ForeignSensor
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink, SensorReading, open_link

ARM = "left-wrist"
TURNED = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)


class Pair:
    """A stage's link and a phone in one folder, a tick of 20 ms at a time."""

    def __init__(self, folder: Path, keys: dict[str, SensorKey] | None = None) -> None:
        self.folder, self.now = folder, 1000.0
        self.phone = ForeignSensor(ARM, "phone", Door(folder))
        self.keys = keys or {}
        self.link = self.start_link()

    def start_link(self) -> SensorLink:
        door, secret = open_door(self.folder)
        return open_link(self.keys, foreign=(door, {ARM: foreign_key(ARM, "phone", secret)}), hands=[ARM])

    def tick(self, count: int = 1, orientation: tuple[float, ...] | None = TURNED) -> list[SensorReading]:
        """Readings that the stage heard."""
        heard: list[SensorReading] = []
        for _ in range(count):
            self.now += 0.02
            if orientation is not None:
                w, x, y, z = orientation
                self.phone.take((w, x, y, z), self.now)
            heard += self.link.drain(self.now)
            self.link.send_due(self.now)
        return heard

    def close(self) -> None:
        self.phone.close()
        self.link.close()


@pytest.fixture
def pair(tmp_path: Path) -> Iterator[Pair]:
    with closing(Pair(tmp_path)) as pair:
        yield pair


def test_a_tracker_that_does_not_drift_says_so_as_a_wearable_with_a_magnetometer_does(pair: Pair) -> None:
    assert not pair.tick(20)[-1].flags & wire.IS_NDOF
    pair.phone.close()
    pair.phone = ForeignSensor(ARM, "phone", Door(pair.folder), drifts=False)
    assert pair.tick(200)[-1].flags & wire.IS_NDOF  # SensorBinding.correct_heading leaves it alone


def test_its_readings_are_those_of_a_wearable(pair: Pair) -> None:
    heard = pair.tick(20)
    assert len(heard) >= 15
    assert heard[-1].sensor == ARM
    assert heard[-1].orientation == pytest.approx(TURNED, abs=1e-4)
    assert [one.sequence for one in heard] == list(range(len(heard)))
    (state,) = pair.link.states(pair.now)
    assert (state.state, state.way) == ("linked", "phone")


def test_its_lamp_is_what_the_stage_asks_of_a_wearable(pair: Pair) -> None:
    assert pair.phone.lamp == "looking"
    pair.tick(20)
    assert pair.phone.lamp == "on"
    pair.link.wants_neutral.add(ARM)
    pair.tick(3)
    assert pair.phone.lamp == "slow"


def test_a_restarted_stage_goes_on_with_the_same_sensor(pair: Pair) -> None:
    before = pair.tick(20)[-1]
    pair.link.close()
    pair.tick(3)
    pair.link = pair.start_link()
    after = pair.tick(60)[-1]
    assert (after.wearable, after.boot_nonce) == (before.wearable, before.boot_nonce)


def test_a_phone_that_begins_anew_counts_as_switched_on_again(pair: Pair) -> None:
    before = pair.tick(20)[-1]
    pair.phone.switch_on()
    after = pair.tick(40)[-1]
    assert after.boot_nonce != before.boot_nonce
    assert after.wearable == before.wearable


def test_silence_is_silence_and_the_link_comes_back(pair: Pair) -> None:
    pair.tick(20)
    assert pair.tick(250, orientation=None) == []
    assert pair.link.states(pair.now)[0].state == "lost"
    assert pair.tick(20)
    assert pair.link.states(pair.now)[0].state == "linked"


def test_no_flood_and_no_orientation_gets_through(pair: Pair) -> None:
    pair.tick(20)
    for _ in range(1000):
        pair.now += 0.0001
        pair.phone.take(TURNED, pair.now)
    pair.link.drain(pair.now)
    assert pair.link.arrivals(ARM)
    assert len(pair.link.arrivals(ARM)) <= 12
    assert pair.phone.counts["thinned"] >= 980
    assert pair.tick(5, (math.nan, 0.0, 0.0, 1.0)) == []
    assert pair.tick(5, (0.0, 0.0, 0.0, 0.0)) == []
    assert pair.phone.counts["invalid"] == 10


def test_without_the_secret_nobody_moves_it(pair: Pair, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    port = (pair.folder / FILE).read_text().split()[0]
    (other / FILE).write_text(f"{port} {bytes(16).hex()}\n")
    with closing(ForeignSensor(ARM, "phone", Door(other))) as stranger:
        for _ in range(20):
            pair.now += 0.02
            stranger.take(TURNED, pair.now)
            assert not pair.link.drain(pair.now)
    assert pair.link.counts["tag"]
    assert (pair.folder / FILE).stat().st_mode & 0o077 == 0


def test_keys_that_are_read_again_leave_it_in(pair: Pair) -> None:
    pair.tick(20)
    pair.link.set_keys({})
    assert pair.tick(5)


def test_before_there_is_a_stage_nothing_is_sent(tmp_path: Path) -> None:
    with closing(ForeignSensor(ARM, "phone", Door(tmp_path))) as phone:
        assert not phone.take(TURNED, 1.0)
        assert phone.lamp == "looking"
