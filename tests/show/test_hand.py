"""Hands by position in show.yaml: which may be, and what is said about those that may not."""

from __future__ import annotations

import pytest

from appliance.show.show import load_show
from tests.show.test_show import ShowYaml, refusal

FAULTS = [
    (
        "hands:\n  - turning: {}\n    joint: hip\n    by: position",
        5,
        ["by position is osc or fixed", "turning"],
    ),
    (
        "hands:\n  - {sensor: wrist, joint: hip,\n     by: position}",
        4,
        ["by position is osc or fixed", "sensor"],
    ),
    ("hands:\n  - fixed: {}\n    joint: hip\n    by: position", 3, ["by position needs one", "[0.3, 1.4"]),
    ("hands:\n  - fixed: {position: [0, 1, 0]}\n    joint: hip", 3, ["holds by orientation", "by: position"]),
    (
        "hands:\n  - by: position\n    joint: hip\n"
        "    fixed:\n      position: [0, 1, 0]\n      orientation: [1, 0, 0, 0]",
        7,
        ["by orientation or by position, and this one has both"],
    ),
    (
        "hands:\n  - joint: hip\n    by: position\n    fixed:\n      position: [0, 1000, 0]",
        6,
        ["Write at most 100"],
    ),
    ("hands:\n  - {osc: true, joint: hip,\n     tracker: wrist}", 4, ["{osc: true, by: position}"]),
    ("hands:\n  - {osc: true, joint: hip,\n     by: place}", 4, ["orientation", "position"]),
]


@pytest.mark.parametrize(("text", "line", "words"), FAULTS, ids=[repr(text)[:60] for text, _, _ in FAULTS])
def test_a_fault_is_named_with_its_line(show_yaml: ShowYaml, text: str, line: int, words: list[str]) -> None:
    error = refusal(show_yaml(f"name: x\n{text}\n"))
    assert error.line == line
    for word in words:
        assert word in str(error)


def test_hands_by_position_are_read(show_yaml: ShowYaml) -> None:
    directory = show_yaml(
        "name: x\n"
        "hands:\n"
        "  - {osc: true, joint: lForeArm, by: position, tracker: left-wrist}\n"
        "  - {fixed: {position: [0.3, 1, -2]}, joint: rShldr, by: position}\n"
        "  - {osc: true, joint: chest}\n"
    )
    hands = load_show(directory).config.hands
    assert [hand.by for hand in hands] == ["position", "position", "orientation"]
    assert hands[0].tracker == "left-wrist"
    assert hands[1].fixed is not None and hands[1].fixed.position == (0.3, 1.0, -2.0)


def test_a_joint_may_have_a_hand_by_orientation_and_one_by_position(show_yaml: ShowYaml) -> None:
    both = (
        "name: x\nhands:\n  - {sensor: wrist, joint: lForeArm}\n"
        "  - {osc: true, joint: lForeArm, by: position}\n"
    )
    config = load_show(show_yaml(both)).config
    assert [hand.by for hand in config.hands] == ["orientation", "position"]
    assert config.names["hands"] == ("lForeArm",)
    error = refusal(show_yaml(both + "  - {fixed: {position: [0, 1, 0]}, joint: lForeArm, by: position}\n"))
    assert "Two hands hold the joint 'lForeArm' by position (hands[1] and hands[2])" in str(error)


def test_a_hand_that_draws_the_hips_is_not_doubted(show_yaml: ShowYaml) -> None:
    def doubts(by: str) -> str:
        directory = show_yaml(f"name: x\nhands:\n  - {{osc: true, joint: hip, by: {by}}}\n")
        return " ".join(map(str, load_show(directory).doubtful_hands()))

    assert "turns the whole figure" in doubts("orientation")
    assert not doubts("position")
