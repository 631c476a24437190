"""Joints held by place on the stage: what the network is given, the hips, turned puppets, and the replay."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from appliance.box.orders import Order
from appliance.dancer.held_positions import HeldPosition, RemotePosition, in_room
from appliance.dancer.puppet import weights_of_one_pass
from appliance.pose import quaternion
from appliance.recorder.journal_reader import read_journal
from appliance.show.show import load_show
from appliance.stage.carry_out import obey
from appliance.stage.comparison import Comparison
from appliance.stage.iterations import Iterations
from appliance.stage.replay import Replay
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import FIGURE, MOVING, write_show
from tests.recorder.night import Night
from tests.stage.shows import BOX

ARM, LEG = "lForeArm", "lThigh"
HANDS: list[dict[str, object]] = [
    {"osc": True, "joint": ARM, "by": "position"},
    {"osc": True, "joint": "Hips", "by": "position"},
    {"fixed": {"orientation": [0.8, 0.6, 0, 0]}, "joint": "rThigh"},
]
PLACE = (0.45, 1.4, 0.08)


@pytest.fixture
def night(tmp_path: Path) -> Iterator[Night]:
    night = Night(write_show(tmp_path / "show", HANDS), tmp_path / "runtime")
    with contextlib.closing(night.recorder):
        yield night
    night.parts.close()


def given(night: Night, puppet: int = 0) -> np.ndarray:
    """The arm's place (3,) that the network has, back in the room."""
    one = night.parts.puppets[puppet]
    window = one.puppet.window
    facing, root = quaternion.heading(window[len(window) // 2, 0]), one.grounding.root
    placed = in_room(one.puppet.places[MOVING.index(ARM)], root, facing)
    if one.place is None:
        return placed
    x, z = one.place.placement.point(placed[0], placed[2])
    return np.array([x, placed[1], z])


def test_the_network_is_given_the_place_and_the_weight_of_one_pass(night: Night) -> None:
    row, arm = night.parts.led.puppet, MOVING.index(ARM)
    night.dance(20)
    assert not row.place_weights.any()
    night.order("place", *PLACE, text=ARM)
    night.dance(15)
    growing = float(night.parts.led.hands.place_weights[arm])
    assert 0.1 < growing < 0.9
    assert row.place_weights[arm] == pytest.approx(weights_of_one_pass(np.float32(growing), 2), abs=1e-6)
    night.dance(60)
    assert given(night) == pytest.approx(PLACE, abs=5e-3)
    assert row.place_weights.tolist() == [float(joint == ARM) for joint in MOVING]
    assert night.tick.frame.puppets[0].holds[FIGURE.index(ARM)] == 1.0
    night.order("release", text=ARM)
    night.dance(60)
    assert not row.place_weights.any()
    assert night.tick.frame.puppets[0].holds[FIGURE.index(ARM)] == 0.0


def test_one_joint_goes_to_a_place_with_a_hands_orientation(tmp_path: Path) -> None:
    turned = {"fixed": {"orientation": [0.8, 0.6, 0, 0]}, "joint": ARM}
    night = Night(write_show(tmp_path / "show", [HANDS[0], turned]), tmp_path / "runtime")
    night.order("place", *PLACE, text=ARM)
    night.dance(80)
    row, arm = night.parts.led.puppet, MOVING.index(ARM)
    assert given(night) == pytest.approx(PLACE, abs=5e-3)
    assert row.place_weights[arm] == 1.0 and night.parts.led.hands.mask[arm]
    assert night.parts.led.hands.targets[0, arm] == pytest.approx([0.8, 0.6, 0, 0], abs=1e-5)
    night.recorder.close()
    night.parts.close()
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    placed, held = run.ticks["targets"][-1]
    assert placed[1:] == pytest.approx(row.places[arm]) and held == pytest.approx([0.8, 0.6, 0, 0], abs=1e-5)


def test_a_place_that_this_dancer_never_goes_to_is_brought_within_its_reach(night: Night) -> None:
    night.order("place", 0.4, 1.0, -0.5, text=ARM)
    night.dance(80)
    away = given(night) - np.array((0.4, 1.0, -0.5))
    assert np.linalg.norm(away) > 0.1
    hand = night.parts.led.hands.puppeteers[0]
    assert isinstance(hand, HeldPosition) and hand.habitual is not None
    row = night.parts.led.puppet.places[MOVING.index(ARM)]
    assert hand.habitual.bounded(row) == pytest.approx(row, abs=1e-5)


def test_a_turned_puppet_has_the_place_in_the_room(tmp_path: Path) -> None:
    puppets = [
        {"name": "left", "x": -0.8},
        {"name": "right", "x": 1.0, "z": -0.5, "turned": 70, "hands": [dict(HANDS[0])]},
    ]
    night = Night(write_show(tmp_path / "show", HANDS, puppets=puppets), tmp_path / "runtime")
    night.dance(20)
    x, y, z = night.parts.puppets[1].frame.positions[FIGURE.index(ARM)].tolist()
    place = (x, y - 0.05, z - 0.05)
    night.order("place", *place, text=ARM)
    night.dance(80)
    assert given(night, 1) == pytest.approx(place, abs=5e-3)
    frame = night.parts.puppets[1].frame
    reach = np.linalg.norm(frame.positions[FIGURE.index(ARM)] - frame.root)
    assert reach < 1.0  # else the place would be no place of that puppet
    night.parts.close()


def test_the_hips_go_to_their_place_with_the_feet_on_the_floor(night: Night) -> None:
    night.dance(20)
    begun = night.tick.frame.puppets[0].root.copy()
    night.order("place", 0.4, 0.3, -0.3, text="Hips")
    roots = []
    for _ in range(200):
        night.dance(1)
        roots.append(night.tick.frame.puppets[0].root.copy())
        assert not night.parts.led.puppet.place_weights.any()
    assert roots[-1][[0, 2]] == pytest.approx([0.4, -0.3], abs=0.02)
    assert roots[-1][1] == pytest.approx(begun[1], abs=0.05)  # the height is the legs'
    assert np.linalg.norm(np.diff(roots, axis=0), axis=1).max() < 0.03
    assert night.tick.frame.puppets[0].holds[FIGURE.index("Hips")] == 1.0


def test_a_night_with_places_dances_again_bit_for_bit(night: Night, tmp_path: Path) -> None:
    night.dance(30)
    night.order("place", *PLACE, text=ARM)
    night.dance(200)
    night.order("place", 0.5, 1.0, 0.0, text="Hips")
    night.order("place", -0.2, 1.3, 0.3, 0.4, text=ARM)
    night.dance(500)
    night.order("hand", 0.0, text="Hips")
    night.order("hand", 1.0, text=ARM)
    night.dance(100)
    (run,) = read_journal(night.saved(tmp_path / "journal")).runs
    hands = run.header["hands"]
    assert [hand["by"] for hand in hands] == ["position", "position", "orientation"]
    places = run.ticks["targets"][:, 0]
    assert not places[:, 0].any() and len(np.unique(places, axis=0)) > 100
    assert run.ticks["weights"][200].tolist() == pytest.approx([1.0, 0.0, 1.0])
    for from_s in (0.0, 12.0):
        replay = Replay(run, load_show(tmp_path / "show"))
        comparison = Comparison(float(run.ticks["frame_time"][0]), 0.0)
        for _ in replay.dance(comparison, from_s):
            pass
        assert comparison.first is None
        assert comparison.ticks > 200
        row, again = night.parts.led.puppet, replay.tick.parts.led.puppet
        assert again.places.tobytes() == row.places.tobytes()
        assert again.place_weights.tobytes() == row.place_weights.tobytes()
        assert row.place_weights.any()


ITERATIONS = Iterations(3, 2, 8)
TWO_HANDS: list[dict[str, object]] = [
    {"osc": True, "joint": "lShldr", "by": "position", "tracker": "wrist"},
    {"osc": True, "joint": "Chest"},
]


@pytest.fixture
def parts(tmp_path: Path) -> Iterator[StageParts]:
    parts = assemble(load_show(write_show(tmp_path / "show", TWO_HANDS)), BOX)
    yield parts
    parts.close()


def hand_of(parts: StageParts) -> RemotePosition:
    hand = parts.led.hands.puppeteers[0]
    assert isinstance(hand, RemotePosition)
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
        (Order("place", (0.0, 1e4, 0.0), "lShldr"), "no position"),
    ]:
        done, said = obey(order, parts)
        assert not done and message in said
    assert hand_of(parts).given is None


def test_other_processes_know_which_joints_are_held_by_place(tmp_path: Path) -> None:
    show = load_show(write_show(tmp_path / "show", TWO_HANDS))
    facts = facts_of(show, None, ITERATIONS, 0.0)
    by_position = [hand for hand in facts.led.hands if hand.by == "position"]
    assert [(hand.source, hand.joint) for hand in by_position] == [("osc", "lShldr")]
    assert facts.trackers == {"wrist": ["lShldr"]}
    again = type(facts).unpacked(facts.packed())
    assert (again.puppets, again.trackers) == (facts.puppets, facts.trackers)
