"""The joint that a new show gives to its first sensor: the left upper arm, whatever it is called."""

from __future__ import annotations

from dataclasses import replace

import pytest

from appliance.studio.data.mirror import mirror_pairs
from appliance.studio.export.release import first_hand
from tests.pose.conventions import CONVENTIONS, skeleton_of


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_the_first_hand_is_the_upper_arm(convention: str) -> None:
    skeleton = skeleton_of(convention)
    assert first_hand(skeleton, skeleton.names) == (CONVENTIONS[convention].name("left upper arm"), "")
    pairs = mirror_pairs(skeleton)
    assert pairs[skeleton.roles["left toe"]] == skeleton.roles["right toe"]


def test_an_unknown_name_is_told_and_the_shape_decides() -> None:
    skeleton = skeleton_of("Mixamo")
    nameless = replace(skeleton, names=tuple(f"bone{number}" for number in range(len(skeleton))))
    name, doubt = first_hand(nameless, nameless.names)
    assert nameless.index(name) == skeleton.roles["left upper arm"]
    assert "No joint has a name that is known for an arm" in doubt and name in doubt


def test_an_upper_arm_that_does_not_move_is_told() -> None:
    skeleton = skeleton_of("Unreal")
    name, doubt = first_hand(skeleton, [n for n in skeleton.names if n != "upperarm_l"])
    assert name == "lowerarm_l"
    assert "The left upper arm does not move" in doubt
