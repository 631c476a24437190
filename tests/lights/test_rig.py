"""The rig when things happen to the show: panic, stop, blackout, a lost stage, the end."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.live_rig import LARGEST, MOST_BEAMS, NOTHING, LiveRigReader
from appliance.box.orders import Order, OrderInbox, OrderSender
from appliance.levers.show_state import ShowState
from appliance.levers.table import GOING, LIGHTS, MASTER
from appliance.lights.live import EVERY_S, STEP_S, LiveRig, OrderedWalk
from appliance.lights.patch import Patch
from appliance.lights.rig import LEAVING_FADE_S, LOST_S, SAFE_FADE_S, Rig
from tests.lights.rigs import SKELETON, frame, lights, rig

PERIOD_S = 0.025
PAR = {"name": "par", "profile": "led-par", "address": 1}
SHY = {"name": "shy", "profile": "led-par", "address": 11}
HEAD = {"name": "head", "profile": "moving-wash", "address": 21, "place": [0, 4, 0]}
FULL = {"reads": "steady", "drives": "dimmer"}
AIM = {"reads": "place", "joint": "hand", "drives": "aim"}
RED = {"reads": "steady", "drives": "colour", "colours": [[1, 0, 0]]}


class Evening:
    """A rig and its clock: passes 40 times a second, with frames or without."""

    def __init__(self, made: Rig) -> None:
        self.rig, self.now, self.show_state = made, 0.0, ShowState()
        self.frame = frame(1)
        self.generation = 1

    def dance(self, seconds: float = 0.0, hand: Any = (1.0, 1.0, 0.0)) -> list[bytes]:
        """Universe 1 pass by pass while the stage dances."""
        return self._passes(seconds, lambda: frame(round(self.now / 0.02) + 1, hand))

    def hang(self, seconds: float) -> list[bytes]:
        """While it does not."""
        return self._passes(seconds, lambda: self.frame)

    def _passes(self, seconds: float, newest: Callable[[], Any]) -> list[bytes]:
        shown = []
        for _ in range(max(1, round(seconds / PERIOD_S))):
            self.now += PERIOD_S
            self.frame = newest()
            shown.append(self.rig.render(self.frame, self.generation, self.show_state, self.now)[1])
        return shown


def evening(*rules: dict[str, Any], safe: dict[str, Any] | None = None) -> Evening:
    return Evening(rig(lights([PAR, SHY, HEAD], *(rules or (FULL,)), safe=safe)))


def dimmers(levels: bytes) -> tuple[int, int, int]:
    return levels[0], levels[10], levels[24]


def test_panic_is_dark_in_the_very_next_pass_and_heads_stand_still() -> None:
    night = evening(FULL, AIM)
    night.dance(2.0)
    assert dimmers(night.dance()[0]) == (255, 255, 255)
    night.show_state = ShowState(panic=True)
    before = night.rig.patch.heads.angles.copy()
    for levels in night.dance(0.5, hand=(-2, 1, 1)):
        assert dimmers(levels) == (0, 0, 0)
    np.testing.assert_array_equal(night.rig.patch.heads.angles, before)


def test_the_safe_look_shines_on_panic_where_the_show_says_so() -> None:
    night = evening(FULL, RED, safe={"dimmer": 0.4, "colour": [1, 1, 1], "fixtures": ["par"]})
    assert night.dance(1.0)[-1][:4] == bytes([255, 255, 0, 0])
    night.show_state = ShowState(panic=True)
    levels = night.dance()[0]
    assert levels[:4] == bytes([102, 255, 255, 255])
    assert dimmers(levels)[1:] == (0, 0)


def test_heads_go_home_in_the_safe_look_where_the_show_says_so() -> None:
    night = evening(FULL, AIM, safe={"heads": "home"})
    night.dance(3.0)
    assert abs(night.rig.patch.heads.angles).max() > 5
    night.show_state = ShowState(panic=True)
    night.dance(3.0)
    np.testing.assert_allclose(night.rig.patch.heads.angles, 0, atol=1e-6)


def test_after_panic_the_dance_fades_in() -> None:
    night = evening()
    night.show_state = ShowState(panic=True)
    night.dance(1.0)
    night.show_state = ShowState()
    shown = [dimmers(levels)[0] / 255 for levels in night.dance(1.5 * SAFE_FADE_S)]
    assert np.diff(shown).max() < 0.05
    assert shown[-1] == 1.0


def test_stop_fades_as_show_control_says_and_then_comes_the_safe_look() -> None:
    night = evening(safe={"dimmer": 0.2})
    night.dance(1.0)
    night.show_state = ShowState().to(GOING, 0.0, night.now, 2.0)
    shown = [dimmers(levels)[0] / 255 for levels in night.dance(4.0)]
    assert shown[39] == pytest.approx(0.5, abs=0.03)
    assert shown[79] < 0.05
    assert shown[-1] == pytest.approx(0.2, abs=0.01)


def test_master_and_blackout_reach_dimmers_alone() -> None:
    night = evening(FULL, RED)
    night.show_state = ShowState().to(MASTER, 0.5, night.now, 0.0)
    assert night.dance(1.0)[-1][:3] == bytes([128, 255, 0])
    night.show_state = ShowState(blackout=True)
    assert night.dance()[0][:3] == bytes([0, 255, 0])


@pytest.mark.parametrize(("show_state", "shines"), [(ShowState(), 51), (ShowState(blackout=True), 0)])
def test_blackout_also_darkens_the_safe_look_of_a_lost_stage(show_state: ShowState, shines: int) -> None:
    night = evening(safe={"dimmer": 0.2})
    night.dance(0.5)
    night.show_state = show_state
    assert dimmers(night.hang(LOST_S + 2 * SAFE_FADE_S)[-1])[0] == shines


def test_but_on_panic_the_safe_look_is_seen_whatever_else_is_in_force() -> None:
    night = evening(safe={"dimmer": 0.2})
    night.show_state = ShowState(panic=True, blackout=True).to(MASTER, 0.0)
    assert dimmers(night.dance()[0])[0] == 51


def test_a_lost_stage_fades_to_the_safe_look_after_a_second_and_comes_back() -> None:
    night = evening()
    night.dance(1.0)
    shown = [dimmers(levels)[0] / 255 for levels in night.hang(3.0)]
    lost = round(LOST_S / PERIOD_S)
    assert min(shown[: lost - 2]) == 1.0
    assert shown[lost + 20] == pytest.approx(0.5, abs=0.1)
    assert shown[lost + 44] == 0.0
    night.generation = 2
    back = [dimmers(levels)[0] / 255 for levels in night.dance(1.5)]
    assert np.diff(back).max() < 0.05
    assert back[-1] == 1.0


def test_on_the_way_to_the_safe_look_a_wheel_jumps_instead_of_showing_all_it_has() -> None:
    spot = {"name": "spot", "profile": "moving-spot", "address": 1}
    night = Evening(rig(lights([spot], FULL, {"reads": "steady", "drives": "gobo", "value": 0.8})))
    shown = [levels[10] for levels in (*night.dance(1.0), *night.hang(3.0), *night.dance(2.0))]
    assert sorted(set(shown)) == [0, 204]
    assert np.count_nonzero(np.diff(shown)) == 2


def test_a_rig_begins_safe_and_stays_so_without_a_stage() -> None:
    config = lights([PAR, SHY, HEAD], FULL, safe={"dimmer": 0.2})
    made = rig(config)
    made.safety = 1.0
    for number in range(50):
        levels = made.render(None, 0, ShowState(), 100.0 + number * PERIOD_S)[1]
        assert dimmers(levels)[0] == 51


def test_the_old_frame_of_a_dead_stage_lights_nothing() -> None:
    made = rig(lights([PAR, SHY, HEAD], FULL))
    made.safety = 1.0
    old = frame(50)
    for number in range(50):
        assert dimmers(made.render(old, 1, ShowState(), 100.0 + number * PERIOD_S)[1]) == (0, 0, 0)


@pytest.mark.parametrize(("safe", "left"), [({}, 0), ({"dimmer": 0.5}, 128)])
def test_at_the_end_it_fades_and_leaves_zeros_or_the_safe_look(safe: dict[str, Any], left: int) -> None:
    night = evening(safe=safe)
    night.dance(1.0)
    night.rig.fade_out()
    shown = [dimmers(levels)[0] for levels in night.dance(LEAVING_FADE_S + PERIOD_S)]
    assert shown[0] > 200 and shown == sorted(shown, reverse=True)
    assert shown[-1] == left
    assert night.rig.safety == 1.0
    last = night.rig.last_levels(night.show_state)[1]
    assert last[0] == left
    heads = set(range(20, 24))  # pan and tilt, coarse and fine
    assert any(level for channel, level in enumerate(last) if channel not in heads) == bool(left)


@pytest.mark.parametrize(
    ("show_state", "left"),
    [(ShowState(blackout=True), 0), (ShowState(panic=True), 51), (ShowState(panic=True, blackout=True), 51)],
)
def test_the_end_is_as_dark_as_blackout_and_as_lit_as_panic(show_state: ShowState, left: int) -> None:
    night = evening(FULL, AIM, safe={"dimmer": 0.2})
    night.dance(1.0)
    night.show_state = show_state
    night.dance(0.5)
    night.rig.fade_out()
    shown = {dimmers(levels)[0] for levels in night.dance(2 * LEAVING_FADE_S)}
    last = night.rig.last_levels(show_state)[1]
    assert shown | {last[0]} == {left}
    assert any(last[20:24])  # where the head points
    assert bool(left) == any(level for channel, level in enumerate(last) if not 20 <= channel < 24)


def test_at_the_end_heads_stay_where_they_point() -> None:
    night = evening(FULL, AIM)
    shown = night.dance(2.0)[-1]
    night.rig.fade_out()
    night.dance(LEAVING_FADE_S + PERIOD_S, hand=(-2.0, 1.0, 1.0))
    before, last = night.dance()[0], night.rig.last_levels(night.show_state)[1]
    assert last[20:24] == before[20:24] != shown[20:24]
    assert any(last[20:24]) and not any(last[:20]) and not any(last[24:])


def test_a_pause_of_the_whole_machine_makes_no_jump() -> None:
    night = evening(FULL, AIM)
    night.dance(1.0)
    before = night.rig.patch.heads.angles.copy()
    night.now += 30.0
    night.dance(hand=(-3, 0, 2))
    assert np.abs(night.rig.patch.heads.angles - before).max() <= 200 * 0.1 + 1e-6


def slow(rate_hz: float) -> Rig:
    """A rig that dances, with few passes a second."""
    config = lights([PAR], FULL)
    made = Rig(config, Patch(config.fixtures, None), SKELETON, rate_hz)
    made.safety = 0.0
    return made


@pytest.mark.parametrize("held_up_s", [0.9, 1.5, 5.0])
def test_a_pause_of_the_whole_machine_dims_nothing_and_counts_nothing(held_up_s: float) -> None:
    """The lights wake some passes before the stage does."""
    night = evening()
    night.dance(2.0)
    night.now += held_up_s
    shown = night.hang(0.5) + night.dance(0.5)
    assert {dimmers(levels)[0] for levels in shown} == {255}
    assert not night.rig.is_lost


def test_lights_paused_while_the_stage_died_fade_as_usual() -> None:
    night = evening()
    night.dance(1.0)
    night.now += 5.0
    shown = [dimmers(levels)[0] / 255 for levels in night.hang(LOST_S + 1.5 * SAFE_FADE_S)]
    assert np.abs(np.diff(shown)).max() < 0.05
    assert shown[-1] == 0.0 and night.rig.is_lost


def test_a_pause_during_the_fade_to_the_safe_look_makes_no_jump() -> None:
    night = evening()
    night.dance(1.0)
    night.hang(LOST_S + 0.3 * SAFE_FADE_S)
    before = dimmers(night.hang(0.0)[0])[0]
    night.now += 5.0
    assert 0 < before - dimmers(night.hang(0.0)[0])[0] < 255 * 0.11


@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 5.0, 8.0])
def test_at_a_slow_rate_a_lost_stage_is_seen_and_faded_from_in_the_same_time(rate_hz: float) -> None:
    made, period_s, safe_at = slow(rate_hz), 1.0 / rate_hz, np.inf
    for number in range(round(4.0 * rate_hz)):
        now = 1.0 + number * period_s
        made.render(frame(50), 1, ShowState(), now)
        safe_at = min(safe_at, now if made.safety >= 1.0 else np.inf)
    assert LOST_S + SAFE_FADE_S - 1e-6 <= safe_at - 1.0 <= LOST_S + SAFE_FADE_S + 1.1 * period_s


def test_passes_that_do_not_keep_up_see_a_lost_stage_and_fade_in_the_same_time() -> None:
    made, period_s, safe_at, now = slow(40.0), 0.3, np.inf, 1.0
    for _ in range(10):
        now += period_s
        made.render(frame(round(now / 0.02)), 1, ShowState(), now)
    last_frame, died_at = frame(round(now / 0.02)), now
    while now < died_at + 4.0:
        now += period_s
        made.render(last_frame, 1, ShowState(), now)
        safe_at = min(safe_at, now if made.safety >= 1.0 else np.inf)
    assert LOST_S + SAFE_FADE_S - 0.02 <= safe_at - died_at <= LOST_S + SAFE_FADE_S + 1.1 * period_s


def test_unknown_mappings_leave_the_first_in_force() -> None:
    night = evening()
    night.show_state = ShowState().to(LIGHTS, "nor this").to(LIGHTS, "of another show")
    assert dimmers(night.dance(0.5)[-1])[0] == 255


RIG = [
    {"name": "par", "profile": "led-par", "mode": "RGBW", "address": 1, "place": [-1, 3, 0]},
    {"name": "head", "profile": "moving-wash", "address": 21, "place": [2, 4, 0]},
]
STANDS = ShowState().to(GOING, 0.0)


@pytest.fixture
def patch() -> Patch:
    return Patch(lights(RIG).fixtures, None)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[OrderSender]:
    with contextlib.closing(OrderSender(tmp_path)) as sender:
        yield sender


@pytest.fixture
def walk(patch: Patch, tmp_path: Path) -> Iterator[OrderedWalk]:
    with contextlib.closing(OrderInbox(tmp_path, "lights")) as inbox:
        yield OrderedWalk(inbox, patch, 40.0)


def asked(
    desk: OrderSender, walk: OrderedWalk, state: ShowState, name: str, text: str = ""
) -> tuple[bool, str]:
    assert desk.send("lights", Order(name, text=text, ask=1)) == "sent"
    walk.levels(state, 0.0)
    answer = desk.take()
    assert answer is not None
    return answer.done, answer.message


def test_a_reader_sees_where_each_lamp_points_and_how_bright_it_is(patch: Patch, tmp_path: Path) -> None:
    reader, live = LiveRigReader(tmp_path), LiveRig(tmp_path)
    assert reader.newest() == NOTHING
    values = patch.dimmed(patch.defaults, 1.0)
    values[patch.select(["par"], "dimmer")] = 0.5
    live.publish(patch, values, "", 10.0)
    reported = json.loads(reader.newest())
    name, place, way, _, level, degrees = reported["beams"][0]
    assert (name, place, level, reported["walk"]) == ("par", [-1.0, 3.0, 0.0], 0.5, "")
    assert np.linalg.norm(way) == pytest.approx(1.0, abs=0.01) and 0 < degrees < 90
    assert [one[0] for one in reported["beams"]] == ["par", "head"]
    live.publish(patch, values, "soon", 10.0 + EVERY_S / 2)
    assert json.loads(reader.newest())["walk"] == "", "five times a second"
    for second in (20.0, 30.0):
        live.publish(patch, values, f"{second}", second)
    assert json.loads(reader.newest())["walk"] == "20.0", "and nothing while nobody does"
    live.close()
    assert reader.newest() == NOTHING
    reader.close()


@pytest.mark.parametrize(("name", "most"), [("a rather long name", MOST_BEAMS), ("灯" * 60, 100)])
def test_a_rig_of_any_size_fits(tmp_path: Path, name: str, most: int) -> None:
    """Names in another script too: JSON has six letters for each of theirs, and the first beams are told."""
    fixtures = [
        {
            "name": f"{name} {place}",
            "profile": "rgb",
            "universe": 1 + place // 100,
            "address": 1 + 3 * (place % 100),
        }
        for place in range(MOST_BEAMS + 50)
    ]
    patch = Patch(lights(fixtures).fixtures, None)
    reader, live = LiveRigReader(tmp_path), LiveRig(tmp_path)
    assert reader.newest() == NOTHING
    live.publish(patch, patch.defaults, "x" * 200, 1.0)
    assert len(json.loads(reader.newest())["beams"]) == most and len(reader.newest()) < LARGEST
    live.close()


def test_a_show_that_is_seen_is_not_walked(desk: OrderSender, walk: OrderedWalk) -> None:
    done, message = asked(desk, walk, ShowState(), "walk")
    assert not done and "Stop it first" in message and walk.values is None
    for state in (replace(STANDS, panic=True), replace(STANDS, blackout=True)):
        assert not asked(desk, walk, state, "walk")[0]


def test_one_lamp_is_walked_and_go_ends_it(desk: OrderSender, walk: OrderedWalk, patch: Patch) -> None:
    done, message = asked(desk, walk, STANDS, "walk", "par")
    assert done and "steps" in message
    seen = {walk.description: None}
    for tick in range(round(STEP_S * 40 * 8)):
        if walk.levels(STANDS, tick / 40) is None:
            break
        seen[walk.description] = None
    assert [message.partition(",")[0] for message in seen if message] == [
        f"par: {one}" for one in ("dimmer", "red", "green", "blue", "white", "strobe")
    ]
    assert walk.levels(STANDS, 100.0) is None, "it ends by itself"
    asked(desk, walk, STANDS, "walk")
    assert walk.levels(STANDS, 100.1) is not None
    assert walk.levels(ShowState(), 100.2) is None
    assert walk.levels(STANDS, 100.3) is None, "it does not begin again"


def test_words_for_what_cannot_be_walked(desk: OrderSender, walk: OrderedWalk) -> None:
    assert asked(desk, walk, STANDS, "walk", "pra") == (
        False,
        "The rig has no fixture 'pra'. Did you mean 'par'?",
    )
    assert not asked(desk, walk, STANDS, "burn")[0]
    asked(desk, walk, STANDS, "walk")
    assert asked(desk, walk, STANDS, "walk/stop")[0] and walk.values is None
