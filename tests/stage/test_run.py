"""The stage's loop on the test's clock: a machine that holds it up for a while, at whatever instruction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from appliance.box.clock import TICK_S, TickClock
from appliance.box.orders import Order
from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import ITERATIONS, PHRASE
from appliance.pose.bvh import write_bvh
from appliance.sensor.link import SensorLink, SensorReading, SensorState
from appliance.show.box import BoxConfig, OutputsConfig, RealtimeConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage import recorder, run
from appliance.stage.admission import SecondLook
from appliance.stage.fallback import SENSOR_SILENT
from appliance.stage.rerun import Rerun
from appliance.stage.run import Stage
from appliance.stage.watch import Watch
from tests.bundles import swaying_phrase, write_show
from tests.fake_clock import FakeTime
from tests.logged import said

RAISED = (0.8, 0.6, 0.0, 0.0)


class Cable(SensorLink):
    """A sensor's cable: what came during a stop is read after the tick that ends it, by another thread."""

    def __init__(self) -> None:
        super().__init__({}, ())
        self.talks = True
        self._drained_at = 0.0
        self._sequence = 0

    def drain(self, now: float) -> Sequence[SensorReading]:
        before, self._drained_at = self._drained_at, now
        if not self.talks or now - before > 1.5 * TICK_S:
            return ()
        self._sequence += 1
        return [SensorReading("left-wrist", RAISED, self._sequence, 0, now, now - 0.001, 90, 255)]

    def states(self, now: float) -> list[SensorState]:
        return [SensorState("left-wrist", 0, "linked", "", 50.0, 0, None, 0.0, 90, 255, "", "", 0, 1, "")]


class Inbox:
    """Orders that wait; whoever takes one is held up for `held_up_s` meanwhile."""

    def __init__(self, time: FakeTime, *orders: Order) -> None:
        self.waiting, self.answers = list(orders), list[tuple[str, bool, str]]()
        self.held_up_s = 0.0
        self._time = time

    def take(self) -> Order | None:
        if not self.waiting:
            return None
        self._time.work(self.held_up_s)
        return self.waiting.pop(0)

    def answer(self, order: Order, done: bool, message: str) -> None:
        self.answers.append((order.name, done, message))


class Evening:
    """A whole stage on a clock that sleeps too long where it is told to: `stops`, seconds by tick."""

    def __init__(self, bundle: Path, runtime: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.runtime = runtime
        self.time, self.cable = FakeTime(self._overshoot_s), Cable()
        self.stops: dict[int, float] = {}
        self.each_s = 0.0
        self.said = said
        self.weights: list[float] = []
        box = BoxConfig(
            sensors=SensorsConfig(udp=None),
            outputs=OutputsConfig(osc=[]),
            runtime=runtime,
            realtime=RealtimeConfig(enabled=False),
        )
        monkeypatch.setattr(
            run, "TickClock", lambda: TickClock(monotonic=self.time.monotonic, sleep=self.time.sleep)
        )
        self.stage = Stage(load_show(bundle), box)
        self.stage.parts.link.close()
        self.stage.parts.link = self.cable
        self.stage.tick._monotonic = self.time.monotonic
        self.stage.lead_s = 0.0  # one sleep a tick
        self.inbox = Inbox(self.time)
        self.stage.inbox = self.inbox  # type: ignore[assignment]

    @property
    def silences(self) -> int:
        return sum(
            one.times for one in self.stage.watch.fallbacks.happened(0.0) if one.name == SENSOR_SILENT.name
        )

    def dance(self, seconds: float) -> None:
        self.stage.dance(seconds, lambda: self.weights.append(self._weight) or False)  # type: ignore[func-returns-value]

    @property
    def _weight(self) -> float:
        return float(self.stage.parts.led.hands.weights[self.stage.parts.led.hand_places[0]])

    def _overshoot_s(self) -> float:
        return self.each_s + self.stops.get(self.stage.health.ticks, 0.0)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_show(tmp_path_factory.mktemp("show"))
    write_bvh(folder / "other.bvh", swaying_phrase(4.0))
    config = yaml.safe_load((folder / "show.yaml").read_text()) | {
        "motion": {"phrases": {"other": "other.bvh"}}
    }
    (folder / "show.yaml").write_text(yaml.safe_dump(config))
    return folder


@pytest.fixture
def evening(bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Evening]:
    (tmp_path / "runtime").mkdir(mode=0o700)
    evening = Evening(bundle, tmp_path / "runtime", monkeypatch)
    with closing(evening.stage):
        yield evening


@pytest.mark.parametrize("stop_s", [0.085, 0.3, 0.9, 1.6, 5.0])
def test_after_a_stop_no_sensor_is_said_to_be_silent_and_no_hand_lets_go(
    evening: Evening, stop_s: float
) -> None:
    evening.stops = {100: stop_s, 160: stop_s}
    evening.dance(5.0 + 2 * stop_s)
    assert evening.silences == 0
    assert not [message for message in evening.said if "silent" in message]
    assert min(evening.weights[50:]) > 0.9
    assert evening.stage.health.skipped >= 2 * int(stop_s / TICK_S) - 2


@pytest.mark.parametrize("each_s", [0.0, 0.07])
def test_a_sensor_that_falls_silent_is_told_of_on_a_slow_machine_too(evening: Evening, each_s: float) -> None:
    evening.each_s = each_s
    evening.stage.dance(1.0, lambda: False)
    evening.cable.drain(evening.time.now)
    evening.stage.parts.hear(SensorReading("left-wrist", RAISED, 1, 0, 0.0, evening.time.now, 90, 255))
    evening.cable.talks = False
    evening.stage.dance(4.0, lambda: False)
    assert evening.silences >= 1
    assert [message for message in evening.said if message.startswith("Sensor left-wrist silent for")]


def test_a_tick_that_was_held_up_leaves_orders_to_the_next_one(evening: Evening) -> None:
    """What it knows of the sensors is of before the stop: a heading would be reset by that."""
    evening.dance(1.0)
    evening.inbox.waiting = [Order("heading")]
    began = evening.time.now
    evening.time.work(0.3)
    evening.stage._take_orders(began, evening.time.monotonic)
    assert evening.inbox.waiting and not evening.inbox.answers
    evening.stage._comes_from_stop = True
    evening.stage._take_orders(evening.time.now, evening.time.monotonic)
    assert evening.inbox.waiting and not evening.inbox.answers
    evening.dance(0.1)
    assert [(name, done) for name, done, _ in evening.inbox.answers] == [("heading", True)]


def test_a_box_whose_every_tick_takes_too_long_can_be_told_to_do_less(evening: Evening) -> None:
    evening.each_s = 0.11
    evening.dance(2.0)
    evening.inbox.waiting = [Order("jump", (1.0,)), Order("heading")]
    with closing(ShowStateWriter(evening.runtime)) as writer:
        writer.write(ShowState(show="A test").to(ITERATIONS, (1, 1), evening.time.now))
    run_tick = evening.stage.tick.run
    evening.stage.tick.run = lambda slot: (run_tick(slot), evening.time.work(0.11))[0]  # type: ignore[method-assign]
    evening.dance(2.0)
    assert [(name, done) for name, done, _ in evening.inbox.answers][:1] == [("jump", True)]
    assert evening.stage.iterations.asked == (1, 1)


def test_what_was_declared_before_an_order_comes_before_it(evening: Evening) -> None:
    """Also where it was declared after the tick had read the show state."""
    evening.dance(1.0)
    with closing(ShowStateWriter(evening.runtime)) as writer:
        writer.write(ShowState(show="A test").to(PHRASE, "other", evening.time.now, 0.5))
    evening.inbox.waiting = [Order("jump", (0.5,))]
    evening.stage._take_orders(evening.time.now, evening.time.monotonic)
    assert evening.stage.parts.led.motion.going_on == ("other", pytest.approx(0.5), 0)


def test_an_order_is_carried_out_at_the_time_at_which_it_is_taken(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stop between the tick and the order is not taken from what the dancer is given for it."""
    noted: list[float] = []
    assert evening.stage.recorder is not None
    evening.dance(1.0)
    monkeypatch.setattr(evening.stage.recorder, "event", lambda kind, now, **facts: noted.append(now))
    evening.inbox.waiting, evening.inbox.held_up_s = [Order("neutral"), Order("heading")], 0.3
    began = evening.time.now
    evening.stage._take_orders(began, evening.time.monotonic)
    assert noted == pytest.approx([began + 0.3, began + 0.6])
    (_, asked, _), (_, reset, message) = evening.inbox.answers
    assert (asked, reset) == (True, False)  # the reading is of before both stops, and by now too old
    assert "heard at this moment" in message
    waits_until = evening.stage.wearing._wearers["left-wrist"].waits_until
    assert waits_until == pytest.approx(began + 0.3 + 3.0)


def test_a_show_that_one_busy_start_lowered_dances_its_own_iterations_ten_seconds_later(
    evening: Evening,
) -> None:
    stage, asked = evening.stage, (evening.stage.iterations.coding, evening.stage.iterations.interaction)
    measured = replace(stage.admission, p99_ms=50.0, coding=1, interaction=1, most_coding=1)
    stage.watch, stage.second_look = Watch(stage.parts, measured), SecondLook(measured)
    stage.iterations.most = 1
    stage.iterations.ask(*asked)
    evening.dance(9.0)
    assert stage.iterations.asked == (1, 1)
    evening.dance(3.0)
    assert stage.iterations.asked == asked
    assert [message for message in evening.said if "coding iterations fit by now" in message]
    now = evening.time.now
    assert not [one for one in stage.watch.fallbacks.happened(now) if one.active and "lowered" in one.name]


def follower(ahead_s: float) -> SimpleNamespace:
    return SimpleNamespace(
        leads=False,
        ahead_s=ahead_s,
        follow=lambda clock, pulse: None,
        close=lambda: None,
        reported=lambda now: {},
        set_fallbacks=lambda fallbacks, now: None,
    )


def test_a_box_that_follows_reports_no_sensors_and_ages_by_the_leaders_clock(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It hears them by the ticks of the leader: bunraku doctor told people to provision or charge them."""
    stage, reported = evening.stage, list[dict[str, Any]]()
    monkeypatch.setattr(stage.parts.link, "lets_in", lambda sensor: True)
    heard = Rerun(stage.tick, stage.wearing, list(stage.parts.worn)).heard
    heard.answers("left-wrist", False)
    stage.parts.link = heard
    stage.parts.worn["left-wrist"][0].take_reading(RAISED, 5000.0)
    monkeypatch.setattr(stage, "paired", follower(ahead_s=-4000.0))
    monkeypatch.setattr(stage.parts.outputs, "publish_health", reported.append)
    stage._publish_health(1000.5)
    (health,) = reported
    assert health["sensors"] == [] and health["not_let_in"] == []
    assert health["sensor_age_s"] == pytest.approx(0.5)


def test_a_box_that_follows_says_once_that_it_is_ready(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It looks at the network some hundred times a second, and each time the supervisor was told."""
    said = list[str]()
    monkeypatch.setattr(evening.stage.notifier, "ready", lambda: said.append("ready"))
    monkeypatch.setattr(evening.stage, "paired", follower(ahead_s=0.0))
    for _ in range(100):
        assert not evening.stage._lead_or_follow(TickClock(monotonic=lambda: 0.0))
    assert said == ["ready"]


def test_a_keyframe_of_this_show_finds_room(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A puppet of 43 joints that goes on by itself took more than was reserved: no journal of it could be
    danced again, and one segment grew until the disk was full.
    """
    monkeypatch.setattr(recorder, "KEYFRAME_BYTES", 1 << 11)
    monkeypatch.setattr(recorder, "KEYFRAME_JOINT_BYTES", 0)
    (tmp_path / "runtime").mkdir(mode=0o700)
    evening = Evening(bundle, tmp_path / "runtime", monkeypatch)
    with closing(evening.stage):
        evening.dance(0.2)
        assert evening.stage.recorder is not None
        evening.stage.recorder.keyframe(evening.stage.tick)
        assert evening.stage.recorder.lost == 0
