"""VMC trackers move the joints whose hands name them: a place a tick at most, and no others are heard."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import pytest

from appliance.box.orders import Order
from appliance.show_control.vmc_input import EVERY_S, SILENT_S, TRACKERS, Trackers
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts
from tests.system.processes import wait_until

TRACKER = "/VMC/Ext/Tra/Pos"
POSE = (0.5, 1.25, -0.25, 0.0, 0.0, 0.0, 1.0)
SHOW = replace(facts(), trackers={"wrist": ["lShldr", "lForeArm"]})


def test_a_tracker_gives_its_joints_their_places_in_the_boxs_axes() -> None:
    orders = Trackers().orders(TRACKER, ["wrist", *POSE], SHOW, 10.0)
    expected = (-0.5, 1.25, -0.25, SILENT_S)
    assert orders == [Order("place", expected, joint, quiet=True) for joint in ("lShldr", "lForeArm")]


def test_a_fast_tracker_gives_a_place_a_tick() -> None:
    trackers = Trackers()
    times = [10.0 + tick / 250 for tick in range(250)]
    taken = [now for now in times if trackers.orders(TRACKER, ["wrist", *POSE], SHOW, now)]
    assert 45 <= len(taken) <= 56
    assert min(b - a for a, b in itertools.pairwise(taken)) >= EVERY_S - 1e-9


@pytest.mark.parametrize("arguments", [[], ["hip", *POSE], [3, *POSE], ["hip"]])
def test_trackers_that_no_hand_names_are_passed_over(arguments: list[object]) -> None:
    assert Trackers().orders(TRACKER, arguments, SHOW, 1.0) == []
    assert Trackers().orders(TRACKER, ["wrist", *POSE], None, 1.0) == []


@pytest.mark.parametrize("numbers", [(1.0, 2.0), (math.nan, *POSE[1:]), ("x", *POSE[1:])])
def test_what_is_no_pose_is_refused_in_words(numbers: tuple[object, ...]) -> None:
    with pytest.raises(ValueError, match="takes a name and seven numbers"):
        Trackers().orders(TRACKER, ["wrist", *numbers], SHOW, 1.0)


@pytest.mark.parametrize("address", sorted(TRACKERS))
def test_trackers_reach_the_stage_through_the_control_port(
    folder: Path, control: ControlInThread, asker: Asker, address: str
) -> None:
    with StageDouble(folder, SHOW) as stage:

        def arrives() -> bool:
            """A tracker sends on and on: what comes before show control has seen the stage is passed over."""
            asker.tell(address, "wrist", *POSE)
            return len(stage.orders) >= 2

        wait_until(arrives, "no place came")
        assert stage.orders[0].values == pytest.approx((-0.5, 1.25, -0.25, SILENT_S))
        assert [order.text for order in stage.orders[:2]] == ["lShldr", "lForeArm"]
