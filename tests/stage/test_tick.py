"""The tick with its real parts: puppet, playback, blending, real datagrams to a real receiver."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.box.clock import TICK_S, Slot
from appliance.pose import quaternion
from appliance.pose.possible import FARTHEST_ON_STAGE_M
from appliance.sensor.link import SensorReading
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.osc import OscConfig
from appliance.show.show import load_show
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from hw_sim.osc_receiver import OscReceiver
from tests.bundles import FIGURE, write_show

SHOULDER, CHEST = FIGURE.index("lShldr"), FIGURE.index("Chest")
TURNED = (0.8, 0.6, 0.0, 0.0)  # about the sensor's x, which points to the front
LEANS = np.array((0.8, 0.0, 0.0, 0.6))  # the same about the stage's z


@pytest.fixture
def receiver() -> Iterator[OscReceiver]:
    with OscReceiver("127.0.0.1") as receiver:
        yield receiver


@pytest.fixture
def stage(tmp_path: Path, receiver: OscReceiver) -> Iterator[Callable[..., Tick]]:
    casts: list[StageParts] = []

    def made(network: str = "plain", hands: list[dict[str, object]] | None = None) -> Tick:
        show = load_show(write_show(tmp_path / network, hands, network))
        box = BoxConfig(
            sensors=SensorsConfig(udp=None),
            outputs=OutputsConfig(osc=[OscConfig(port=receiver.port, frame_message=True)]),
        )
        casts.append(assemble(show, box))
        casts[-1].led.iterations = Iterations(3, 2, 10)
        return Tick(casts[-1], worn(casts[-1]), latest_start_s=0.005)

    yield made
    for parts in casts:
        parts.close()


def worn(parts: StageParts) -> SensorFit:
    return SensorFit(parts, SensorMemory(None))


def dance(tick: Tick, slots: range, late_s: float = 0.0, heard: tuple[float, ...] | None = None) -> None:
    for number in slots:
        deadline = 100.0 + number * TICK_S
        if heard is not None:
            reading = SensorReading("left-wrist", heard, number, 0, deadline, deadline - 0.001, 90, 255)
            tick.wearing.hear(reading)
            tick.parts.hear(reading)
        slot = Slot(number, deadline, deadline + late_s)
        tick.run(slot)
        tick.after(slot)


def frames(receiver: OscReceiver) -> list[list[object]]:
    return [list(arguments) for _, address, arguments in receiver.poll(1.0) if address == "/bunraku/frame"]


def poses(receiver: OscReceiver) -> np.ndarray:
    lists = [arguments for _, address, arguments in receiver.poll(1.0) if address.endswith("rot_local")]
    return np.array(lists, float).reshape(len(lists), len(FIGURE), 4)


def test_each_slot_sends_one_frame_with_its_own_number(
    stage: Callable[..., Tick], receiver: OscReceiver
) -> None:
    dance(stage(hands=[]), range(5, 10))
    assert [frame[0] for frame in frames(receiver)] == [5, 6, 7, 8, 9]


def test_without_hands_the_phrase_itself_is_danced(stage: Callable[..., Tick], receiver: OscReceiver) -> None:
    tick = stage(hands=[])
    expected = []
    for number in range(60):
        expected.append(tick.parts.led.motion.window()[0].copy())
        dance(tick, range(number, number + 1))
    np.testing.assert_allclose(poses(receiver), expected, atol=1e-5)


def test_a_worn_sensor_turns_its_joint_and_the_frame_names_the_reading(
    stage: Callable[..., Tick], receiver: OscReceiver
) -> None:
    tick = stage()
    dance(tick, range(60), heard=TURNED)
    assert tick.frame.sensor_sequence == 59
    assert tick.frame.sensor_arrival == pytest.approx(100.0 + 59 * TICK_S - 0.001)
    assert quaternion.angle_between(tick.frame.puppets[0].pose[SHOULDER], LEANS) < 0.01
    assert frames(receiver)[-1][2] == 59


def test_a_frame_says_how_firmly_each_joint_is_held(stage: Callable[..., Tick]) -> None:
    tick = stage()
    held = []
    for number in range(180):
        dance(tick, range(number, number + 1), heard=TURNED if 20 <= number < 80 else None)
        held.append(tick.frame.puppets[0].holds.copy())
    weights = np.array(held)
    assert not np.delete(weights, SHOULDER, axis=1).any()
    of_hand = weights[:, SHOULDER]
    assert not of_hand[:20].any(), "before the first message nothing is held"
    assert np.all(np.diff(of_hand[20:80]) >= 0) and of_hand[79] == 1.0
    assert np.all(np.diff(of_hand[86:]) <= 0) and of_hand[-1] == 0.0, "released, it is free"
    assert ((of_hand > 0.1) & (of_hand < 0.9)).sum() > 10, "it grows and fades"


def test_the_neutral_orientation_of_a_sensor_means_the_rest_pose(stage: Callable[..., Tick]) -> None:
    tick = stage(hands=[{"sensor": "left-wrist", "joint": "lShldr", "neutral": list(TURNED)}])
    dance(tick, range(60), heard=TURNED)
    assert quaternion.angle_between(tick.frame.puppets[0].pose[SHOULDER], quaternion.IDENTITY) < 0.01


def test_a_neutral_pose_taken_in_stillness_leads_the_joint_over(stage: Callable[..., Tick]) -> None:
    hanging = [0.8, 0.0, 0.0, -0.6]
    tick = stage(hands=[{"sensor": "left-wrist", "joint": "lShldr", "at_neutral": hanging}])
    shown = []
    for number in range(110):
        dance(tick, range(number, number + 1), heard=TURNED)
        shown.append(tick.frame.puppets[0].pose[SHOULDER].copy())
    assert quaternion.angle_between(shown[70], quaternion.IDENTITY) < 0.01  # turned up from hanging
    assert quaternion.angle_between(shown[-1], np.array(hanging)) < 0.01
    steps = quaternion.angle_between(np.array(shown[61:]), np.array(shown[60:-1]))
    assert steps.max() < 2 * 1.29 / 25  # 74 degrees, spread over half a second


def test_a_late_tick_sends_the_last_pose_marked_late_and_the_phrase_waits(
    stage: Callable[..., Tick], receiver: OscReceiver
) -> None:
    tick = stage(hands=[])
    dance(tick, range(30))
    before = tick.parts.led.motion.position_s
    dance(tick, range(30, 31), late_s=0.006)
    assert tick.parts.led.motion.position_s == before
    dance(tick, range(31, 32))
    sent = receiver.poll(1.0)
    marks = [arguments for _, address, arguments in sent if address == "/bunraku/frame"]
    shown = [arguments for _, address, arguments in sent if address.endswith("rot_local")]
    assert [mark[3] for mark in marks[-3:]] == [0, 1, 0]
    assert [mark[0] for mark in marks[-3:]] == [29, 30, 31]
    assert shown[-2] == shown[-3]
    assert shown[-1] != shown[-2]


def test_a_late_tick_does_not_claim_the_reading_that_it_could_not_show(stage: Callable[..., Tick]) -> None:
    tick = stage()
    dance(tick, range(10), heard=TURNED)
    dance(tick, range(10, 11), late_s=0.006, heard=TURNED)
    assert tick.frame.sensor_sequence == 9
    dance(tick, range(11, 12))
    assert tick.frame.sensor_sequence == 10


def test_a_network_that_gives_no_numbers_holds_the_last_good_pose(
    stage: Callable[..., Tick], receiver: OscReceiver
) -> None:
    tick = stage("broken")
    first = tick.frame.puppets[0].pose.copy()
    dance(tick, range(20), heard=TURNED)
    assert tick.network_failed
    assert np.isfinite(tick.frame.puppets[0].pose).all()
    np.testing.assert_array_equal(tick.frame.puppets[0].pose, first)
    assert np.isfinite(poses(receiver)).all()


def test_a_tick_makes_nothing_for_the_collector(stage: Callable[..., Tick]) -> None:
    tick = stage(hands=[])
    dance(tick, range(100))
    gc.collect()
    gc.disable()
    try:
        before = len(gc.get_objects())
        dance(tick, range(100, 400))
        grown = len(gc.get_objects()) - before
        found = gc.collect()
    finally:
        gc.enable()
    assert grown < 20
    assert found == 0


def test_section_times_add_up_to_the_cost(stage: Callable[..., Tick]) -> None:
    ticking = iter(np.arange(0.0, 100.0, 0.001).tolist())
    parts = stage(hands=[]).parts
    parts.led.iterations = Iterations(3, 2, 10)
    tick = Tick(parts, worn(parts), 0.005, monotonic=lambda: next(ticking))
    slot = Slot(0, 0.0, 0.0)
    tick.run(slot)
    cost_ms = tick.after(slot)
    assert cost_ms == pytest.approx(float(tick.sections_ms.sum()), abs=1e-3)
    assert (tick.sections_ms[1:] > 0.9).all()


def test_warming_up_changes_nothing_that_is_danced(stage: Callable[..., Tick], receiver: OscReceiver) -> None:
    tick = stage(hands=[{"turning": {"seconds_per_turn": 2.0}, "joint": "lShldr"}])
    dance(tick, range(40))
    plain = poses(receiver)
    warmed = stage(hands=[{"turning": {"seconds_per_turn": 2.0}, "joint": "lShldr"}])
    for number in range(40):
        warmed.warm_up()
        dance(warmed, range(number, number + 1))
    np.testing.assert_array_equal(poses(receiver), plain)


TIMES = st.tuples(st.integers(0, 64), st.integers(0, 64))


@pytest.mark.parametrize(
    ("asked", "danced"),
    [
        ((5, 4), (5, 4)),
        ((12, 11), (8, 7)),
        ((12, 2), (8, 1)),
        ((60, 1), (8, 1)),
        ((12, 0), (8, 0)),
        ((3, 3), (3, 3)),
        ((0, 0), (1, 0)),
    ],
)
def test_without_a_fade_they_change_at_once_within_what_fits(
    asked: tuple[int, int], danced: tuple[int, int]
) -> None:
    iterations = Iterations(3, 2, most=8)
    message = iterations.ask(*asked)
    assert (iterations.coding, iterations.interaction) == danced
    assert (f"with {danced[0]} and {danced[1]}: " in message) == (asked != danced)
    assert ("at most 8 fit" in message) == (asked[0] > 8)


def test_a_fade_goes_in_steps_and_takes_its_time() -> None:
    iterations = Iterations(10, 9, most=20)
    iterations.ask(4, 3, 2.0)
    course = []
    for _ in range(101):
        course.append((iterations.coding, iterations.interaction))
        iterations.advance()
    assert course[0] == (10, 9) and course[50] == (7, 6) and course[-1] == (4, 3)
    assert all(before[0] - after[0] in (0, 1) for before, after in pairwise(course))
    assert all(coding - interaction == 1 for coding, interaction in course)


def test_a_change_during_a_fade_begins_where_it_has_come_to() -> None:
    iterations = Iterations(10, 9, most=20)
    iterations.ask(4, 3, 2.0)
    for _ in range(50):
        iterations.advance()
    iterations.ask(10, 9, 1.0)
    assert (iterations.coding, iterations.interaction) == (7, 6)
    for _ in range(200):
        iterations.advance()
    assert (iterations.coding, iterations.interaction) == (10, 9)


@settings(deadline=None)
@given(begin=TIMES, asked=TIMES, most=st.integers(1, 64), fade_s=st.floats(0, 3))
def test_they_are_never_more_than_fit_nor_interactions_more_than_codings(
    begin: tuple[int, int], asked: tuple[int, int], most: int, fade_s: float
) -> None:
    iterations = Iterations(1, 0, most)
    iterations.ask(*begin)
    iterations.ask(*asked, fade_s)
    for _ in range(160):
        iterations.advance()
        assert 1 <= iterations.coding <= most
        assert 0 <= iterations.interaction <= iterations.coding


def test_a_walk_without_end_is_led_back_before_its_numbers_end(stage: Callable[..., Tick]) -> None:
    """A phrase that walks gets 1e5 m in a day; the figure then stood still for good, also after a restart."""
    tick = stage()
    led = tick.parts.led
    _, position_s, _ = led.motion.going_on
    led.motion.start_at("main", led.motion.excerpt_s, position_s, 1.0, (2.0 * FARTHEST_ON_STAGE_M, 0.0, 0.0))
    for number in range(20):
        tick.run(Slot(number, number * TICK_S, number * TICK_S))
        tick.after(Slot(number, number * TICK_S, number * TICK_S))
    assert led.figures_refused == 1
    assert np.hypot(*led.frame.root[[0, 2]]) < 10.0
