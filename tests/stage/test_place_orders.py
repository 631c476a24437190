"""Joints that are held by place through OSC: told, let go, and refused where the hand gives orientations."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.box.orders import Order
from appliance.dancer.held_places import RemotePlace
from appliance.show.show import load_show
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import write_show
from tests.stage.shows import BOX

ITERATIONS = Iterations(3, 2, 8)
HANDS: list[dict[str, object]] = [
    {"osc": True, "joint": "lShldr", "by": "position", "tracker": "wrist"},
    {"osc": True, "joint": "Chest"},
]


@pytest.fixture
def parts(tmp_path: Path) -> Iterator[StageParts]:
    parts = assemble(load_show(write_show(tmp_path / "show", HANDS)), BOX)
    yield parts
    parts.close()


def hand_of(parts: StageParts) -> RemotePlace:
    hand = parts.led.hands.puppeteers[0]
    assert isinstance(hand, RemotePlace)
    return hand


def test_a_place_is_told_and_taken_back(parts: StageParts) -> None:
    hand = hand_of(parts)
    assert obey(Order("place", (0.25, 1.5, -0.5), "lShldr"), parts) == (True, "")
    assert hand.given == (0.25, 1.5, -0.5)
    assert obey(Order("release", (), "lShldr"), parts) == (True, "")
    assert hand.given is None


def test_a_hand_that_is_let_hold_by_place_holds_its_joint_where_it_is(parts: StageParts) -> None:
    parts.led.stand()
    assert obey(Order("hand", (1.0,), "lShldr"), parts) == (True, "")
    hand = hand_of(parts)
    assert hand.given == pytest.approx(parts.led.frame.positions[hand.number].tolist())
    assert any(hand.given or ())


def test_what_a_hand_does_not_give_is_refused_in_words(parts: StageParts) -> None:
    for order, message in [
        (Order("hold", (1.0, 0.0, 0.0, 1.0), "lShldr"), "takes a position: send /mocap/setjointpos."),
        (
            Order("place", (0.0, 1.0, 0.0), "Chest"),
            "takes an orientation: send /mocap/setjointrot, or write by:",
        ),
        (Order("place", (0.0, 1.0, 0.0), "hip"), "No hand of this show holds 'hip'"),
        (Order("place", (0.0, 1e4, 0.0), "lShldr"), "no place"),
    ]:
        done, said = obey(order, parts)
        assert not done and message in said
    assert hand_of(parts).given is None


def test_other_processes_know_which_joints_are_held_by_place(tmp_path: Path) -> None:
    show = load_show(write_show(tmp_path / "show", HANDS))
    facts = facts_of(show, None, ITERATIONS, 0.0)
    by_position = [hand for hand in facts.led.hands if hand.by == "position"]
    assert [(hand.source, hand.joint) for hand in by_position] == [("osc", "lShldr")]
    assert facts.trackers == {"wrist": ["lShldr"]}
    again = type(facts).unpacked(facts.packed())
    assert (again.puppets, again.trackers) == (facts.puppets, facts.trackers)
