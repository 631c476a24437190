"""show.yaml: sound files are read, broken ones refused with file, line, what is wrong and what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from appliance.sensor.keys import KeyFileError, load_keys
from appliance.show.config_error import ConfigError
from appliance.show.dance import DancerConfig
from appliance.show.hand import HandConfig
from appliance.show.show import ShowConfig, load_show
from tests.bundles import write_show
from tests.show.conftest import NAMES
from tests.sources import write_show_with_sources

ShowYaml = Callable[[str], Path]


def refusal(directory: Path) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        load_show(directory)
    return caught.value


def test_a_sound_bundle_is_read(bundle: Path) -> None:
    show = load_show(bundle)
    assert show.config.name == "Test"
    assert (show.config.dancer.coding_iterations, show.config.dancer.interaction_iterations) == (10, 9)
    assert show.skeleton.names == NAMES
    assert (show.network, show.phrase) == (bundle / "puppet.onnx", bundle / "phrase.bvh")
    assert [(hand.kind, hand.sensor, hand.joint) for hand in show.config.hands] == [
        ("sensor", "left-wrist", "lShldr")
    ]


def test_all_five_kinds_of_hand_are_read(show_yaml: ShowYaml) -> None:
    directory = show_yaml(
        "name: x\n"
        "hands:\n"
        "  - {sensor: wrist, joint: lShldr, weight: 1, neutral: [0.999, 0, 0, 0]}\n"
        "  - {turning: {axis: [0, 2, 0], seconds_per_turn: 1}, joint: chest}\n"
        "  - {fixed: {orientation: [0.6, 0.8, 0, 0]}, joint: hip, weight: 0.5}\n"
        "  - {osc: true, joint: rShldr}\n"
        "  - {kept: true, joint: lForeArm, weight: 0.4}\n"
    )
    hands = load_show(directory).config.hands
    assert [hand.kind for hand in hands] == ["sensor", "turning", "fixed", "osc", "kept"]
    assert hands[0].neutral == (1.0, 0.0, 0.0, 0.0)
    assert hands[1].turning is not None and hands[1].turning.axis == (0.0, 1.0, 0.0)
    assert hands[2].fixed is not None and hands[2].fixed.orientation == pytest.approx((0.6, 0.8, 0, 0))


def test_a_sensors_name_is_as_long_as_a_key_file_and_a_wearable_take_it(
    show_yaml: ShowYaml, tmp_path: Path
) -> None:
    hands = "name: x\nhands:\n  - {{sensor: {}, joint: lShldr}}\n"
    longest, longer = "w" * 24, "w" * 25
    assert load_show(show_yaml(hands.format(longest))).config.hands[0].sensor == longest
    assert "1 to 24" in str(refusal(show_yaml(hands.format(longer))))
    entry = "{}: {{device: 1, key: 000102030405060708090a0b0c0d0e0f}}\n"
    (keys := tmp_path / "sensors.keys").write_text(entry.format(longest))
    assert list(load_keys(keys)) == [longest]
    keys.write_text(entry.format(longer))
    with pytest.raises(KeyFileError, match="at most 24 letters"):
        load_keys(keys)
    header = Path(__file__).resolve().parents[2] / "firmware/wearable/src/core/settings.h"
    assert "kLongestName = 24," in header.read_text()


@pytest.mark.parametrize(("coding", "interaction"), [(10, 9), (2, 1), (1, 1), (64, 63)])
def test_the_last_pass_is_free_by_default(coding: int, interaction: int) -> None:
    assert DancerConfig.model_validate({"coding_iterations": coding}).interaction_iterations == interaction


def test_the_primary_sensor_is_the_one_that_says_so_or_else_the_first() -> None:
    def show(*hands: dict[str, object]) -> ShowConfig:
        return ShowConfig.model_validate({"name": "x", "hands": list(hands)})

    first, second = {"sensor": "a", "joint": "hip"}, {"sensor": "b", "joint": "chest"}
    turning = {"turning": {}, "joint": "lShldr"}
    assert show(turning, first, second).primary_sensor == "a"
    assert show(turning, first, {**second, "primary": True}).primary_sensor == "b"
    assert show(turning).primary_sensor is None


FAULTS = [
    # (text below line 1 'name: x', line, words of the message and its cure)
    ("acknowledgment: y", 2, ["Unknown key 'acknowledgment'", "Did you mean 'acknowledgement'?"]),
    (
        "dancer:\n  coding_iteration: 3",
        3,
        ["Unknown key 'coding_iteration' in 'dancer'", "'coding_iterations'?"],
    ),
    ("dancer:\n  Hop: 3", 3, ["Unknown key 'Hop'", "Did you mean 'hop'?"]),
    ("dancer:\n  qqqq: 3", 3, ["Unknown key 'qqqq'", "Known: network, coding_iterations"]),
    ("dancer:\n  coding_iterations: many", 3, ["'many', which is not a whole number", "Write 1 to 64."]),
    ("dancer:\n  coding_iterations: 2.5", 3, ["2.5, which is not a whole number"]),
    ("dancer:\n  coding_iterations: '4'", 3, ["'4', which is not a whole number", "without quotes"]),
    ("dancer:\n  coding_iterations: true", 3, ["true, which is not a whole number"]),
    ("dancer:\n  coding_iterations:", 3, ["is empty, which is not a whole number"]),
    ("dancer:\n  coding_iterations: 65", 3, ["is 65, out of range", "Write 1 to 64."]),
    ("dancer:\n  coding_iterations: 0", 3, ["is 0, out of range", "Write 1 to 64."]),
    ("dancer:\n  hop: 9", 3, ["'dancer.hop' is 9, out of range", "Write 1 to 8."]),
    ("dancer: {coding_iterations: 3,\n  interaction_iterations: 4}", 3, ["(4) is more than", "Write 0 to 3"]),
    ("dancer: 7", 2, ["'dancer' is 7, which is not a group of keys"]),
    ("motion:\n  rate: .nan", 3, ["'motion.rate' is nan", "Write -4 to 4."]),
    ("motion:\n  rate: 1e-3", 3, ["which is not a number", "0.001, not 1e-3"]),
    ("motion: {start_s: 3,\n  end_s: 2.5}", 3, ["end_s (2.5) is not after start_s (3)"]),
    ("motion: {grounded: 3}", 2, ["is 3, which is not true or false"]),
    ("dancer:\n  network: other.onnx", 3, ["There is no file 'other.onnx'", "copy the whole bundle again"]),
    ("dancer:\n  network: ../puppet.onnx", 3, ["not inside the show's folder"]),
    ("dancer:\n  network: /etc/passwd", 3, ["not inside the show's folder"]),
    ("motion:\n  phrase: gone.bvh", 3, ["There is no file 'gone.bvh'"]),
    ("hands:\n  - sensor: a\n    joint: lSholder", 4, ["no joint 'lSholder'", "Did you mean 'lShldr'?"]),
    ("hands:\n  - sensor: a\n    joint: LFOREARM", 4, ["no joint 'LFOREARM'", "Did you mean 'lForeArm'?"]),
    (
        "hands:\n  - sensor: a\n    joint: hip\n    weight: 1.5",
        5,
        ["'hands[0].weight' is 1.5", "Write 0 to 1."],
    ),
    ("hands:\n  - sensor: a\n    weight: 1", 3, ["'hands[0].joint' is missing"]),
    ("hands:\n  - joint: hip\n    sensor: a\n    osc: true", 5, ["exactly one of", "sensor and osc"]),
    ("hands:\n  - joint: hip", 3, ["exactly one of", "none of them"]),
    ("hands:\n  - joint: hip\n    osc: false", 4, ["is false, not true"]),
    ("hands:\n  - {osc: true, joint: hip,\n     primary: true}", 4, ["'primary' belongs to a sensor"]),
    (
        "hands:\n  - {sensor: a, joint: hip}\n  - {osc: true, joint: hip}",
        4,
        ["Two hands hold the joint 'hip'"],
    ),
    (
        "hands:\n  - {sensor: a, joint: hip, primary: true}\n  - {sensor: b, joint: chest, primary: true}",
        4,
        ["Two hands are primary"],
    ),
    ("hands:\n  - fixed:\n      orientation: [1, 1, 0, 0]\n    joint: hip", 4, ["has the length 1.41"]),
    ("hands:\n  - fixed:\n      orientation: [1, 0, 0]\n    joint: hip", 4, ["4 numbers in brackets"]),
    ("hands:\n  - fixed:\n      orientation: [1, 0, 0, a]\n    joint: hip", 4, ["which is not a number"]),
    ("hands:\n  - turning:\n      axis: [0, 0, 0]\n    joint: hip", 4, ["An axis needs a direction"]),
    ("hands:\n  - {springs: lose, joint: hip}", 3, ["no setting of springs 'lose'", "Did you mean 'loose'?"]),
    (
        "hands:\n  - {springs: loose, joint: hip}\n  - {springs: stiff, joint: chest}",
        4,
        ["Two hands are springs", "Keep one"],
    ),
    ("springs:\n  - {name: a}\n  - {name: a}", 4, ["Two settings of springs are called 'a'"]),
    ("springs:\n  - {name: a, arms: {mass: 0}}", 3, ["out of range", "Write 0.05 to 50."]),
    ("cues:\n  - {name: a, springs: loose}", 3, ["no setting of springs 'loose'", "Remove `springs`"]),
    ("hands: {sensor: a, joint: hip}", 2, ["'hands' is a group of keys, which is not a list"]),
    ("name: again", 2, ["'name' is here twice (first on line 1)"]),
    ("motion: {rate: 1", 2, ["not YAML", "behind the '{' on this line, up to line 3", "Close it"]),
    ("motion: {rate: 1; start_s: 1}", 2, ["behind the '{' on this line.", "commas between its parts"]),
    ("motion:\n\trate: 1", 3, ["This is not YAML: this line has a tab. Put spaces in its place."]),
    ("looks:\n  - {name: a, figure: #f2e6d8}\n  - {name: b}", 3, ["after a bare #", "in quotes"]),
    ("looks:\n  - {name: a, figure: #f2e6d8}\ncues: []", 3, ["after a bare #", "in quotes"]),
    ("motion:\n  rate: 1,5", 3, ["'1,5', which is not a number. Write it with a point: 1.5."]),
    ("motion: &a {rate: 1}\ndancer: *a", 2, ["Anchors and aliases"]),
    ("motion: !!python/object:os.system {}", 2, ["Tags like", "are not used here"]),
]


@pytest.mark.parametrize(("text", "line", "words"), FAULTS, ids=[repr(text)[:60] for text, _, _ in FAULTS])
def test_a_fault_is_named_with_its_line(show_yaml: ShowYaml, text: str, line: int, words: list[str]) -> None:
    directory = show_yaml(f"name: x\n{text}\n")
    error = refusal(directory)
    assert (error.file, error.line) == (directory / "show.yaml", line)
    assert f"{directory / 'show.yaml'}:{line}: " in str(error)
    for word in words:
        assert word in str(error)


def test_all_faults_are_listed_at_once_in_the_order_of_their_lines(show_yaml: ShowYaml) -> None:
    directory = show_yaml(
        "nmae: x\n"
        "dancer:\n"
        "  coding_iterations: 99\n"
        "  netwrk: a.onnx\n"
        "motion: {phrase: gone.bvh}\n"
        "hands:\n"
        "  - sensor: a\n"
        "    joint: hipp\n"
        "  - {osc: true, joint: chest, weight: heavy}\n"
    )
    (directory / "skeleton.bvh").touch()
    error = refusal(directory)
    assert [problem.line for problem in error.problems] == [1, 1, 3, 4, 5, 8, 9]
    assert len(str(error).splitlines()) == 7


def test_a_broken_skeleton_is_refused_together_with_the_rest(show_yaml: ShowYaml) -> None:
    directory = show_yaml("nam: x\n")
    (directory / "skeleton.bvh").write_text("HIERARCHY\nROOT hip\n{\n  nonsense\n")
    error = refusal(directory)
    assert {(problem.file.name, problem.line) for problem in error.problems} >= {
        ("skeleton.bvh", 4),
        ("show.yaml", 1),
    }


def test_missing_folders_and_files_are_reported(bundle: Path) -> None:
    assert "no such show folder" in str(refusal(bundle / "nowhere"))
    (bundle / "skeleton.bvh").unlink()
    assert "skeleton cannot be read" in str(refusal(bundle))
    (bundle / "show.yaml").unlink()
    assert refusal(bundle).file == bundle / "show.yaml"


@pytest.mark.parametrize(
    ("content", "line", "message"),
    [
        (b"", 1, "'name' is missing"),
        (b"- a\n- b\n", 1, "does not consist of keys"),
        (b"name: \xff\n", 1, "not text"),
        (b"name: x\n---\nname: y\n", 2, "not YAML"),
        (b"name: " + b"[" * 100_000, 1, "not YAML"),
        (b"name: x\n#" + b"x" * 300_000, 0, "larger than 256 kB"),
        (b"name: \x07\n", 1, "not YAML"),
        (b"? [a, b]\n: c\nname: x\n", 1, "A key is a single word"),
    ],
)
def test_what_is_hardly_a_file_is_refused(bundle: Path, content: bytes, line: int, message: str) -> None:
    (bundle / "show.yaml").write_bytes(content)
    error = refusal(bundle)
    assert error.line == line
    assert message in str(error)


def test_a_hand_on_a_joint_that_the_network_does_not_move_is_refused(show_yaml: ShowYaml) -> None:
    show = load_show(show_yaml("name: x\nhands:\n  - sensor: a\n    joint: leftEye\n"))
    with pytest.raises(ConfigError, match=r"show\.yaml:4: The network does not move the joint 'leftEye'"):
        show.require_moving(("hip", "chest"))
    show.require_moving(("leftEye",))


def test_the_models_hold_their_bounds_without_a_file() -> None:
    with pytest.raises(ValidationError):
        HandConfig.model_validate({"joint": "hip", "sensor": "a", "osc": True})
    with pytest.raises(ValidationError):
        DancerConfig(coding_iterations=3, interaction_iterations=4)


@pytest.mark.parametrize(
    ("written", "wanted"),
    [
        ("[0.7071, 0.7071, 0, 0]", (0.5**0.5, 0.5**0.5, 0, 0)),
        ("{euler: {x: 90}}", (0.5**0.5, 0.5**0.5, 0, 0)),
        ("{euler: {x: 90, z: 90}}", (0.5, 0.5, 0.5, 0.5)),  # about x first: y goes up to z, then x to y
        ("{axis: [0, 2, 0], angle: -90}", (0.5**0.5, 0, -(0.5**0.5), 0)),
        ("{axis: [0, 1, 0], angle: 0}", (1, 0, 0, 0)),
    ],
)
def test_an_orientation_in_degrees(show_yaml: ShowYaml, written: str, wanted: tuple[float, ...]) -> None:
    hands = f"name: x\nhands:\n  - {{fixed: {{orientation: {written}}}, joint: hip}}\n"
    (hand,) = load_show(show_yaml(hands)).config.hands
    assert hand.fixed is not None
    assert hand.fixed.orientation == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize(
    "written",
    [
        "{euler: {w: 90}}",
        "{euler: 90}",
        "{euler: {x: far}}",
        "{axis: [0, 1, 0]}",
        "{axis: [0, 1], angle: 90}",
        "{axis: [0, 1, 0], angle: yes}",
        "{roll: 5}",
    ],
)
def test_what_is_no_orientation_is_refused_with_its_line(show_yaml: ShowYaml, written: str) -> None:
    directory = show_yaml(f"name: x\nhands:\n  - {{fixed: {{orientation: {written}}}, joint: hip}}\n")
    assert "show.yaml:3: This is no orientation. Write {euler: {x: 90}}" in str(refusal(directory))


def test_a_source_whose_network_is_missing_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"show.yaml:\d+: .*no file 'sequence.onnx'"):
        load_show(write_show(tmp_path, motion={"vary": {"sigma": 1.0}}))


@pytest.mark.parametrize(
    ("motion", "why"),
    [
        ({"vary": {"sigma": 5.0}}, "4"),
        ({"source": "live"}, "starts from 'live'"),
        ({"source": "quiet"}, "starts from 'quiet'"),
        ({"granular": {"from": "main", "to": "quiet"}}, "no phrase 'quiet'"),
        ({"phrases": {"vary": "phrase.bvh"}}, "'vary' is what"),
        ({"kept": ["path"]}, "names something else"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, motion: dict[str, Any], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        load_show(write_show_with_sources(tmp_path, motion))


def test_a_cue_names_the_parameters_that_it_changes_and_no_others(tmp_path: Path) -> None:
    called = {"name": "again", "phrase": "anna"}
    kept = load_show(write_show_with_sources(tmp_path, {"kept": ["anna"]}, cues=[called]))
    assert kept.config.names["phrase"][-1] == "anna"
    cue = {"name": "wild", "phrase": "vary", "motion": {"vary": {"sigma": 2.0}}}
    show = load_show(write_show_with_sources(tmp_path, {"source": "granular"}, cues=[cue]))
    assert show.config.cues[0].model_dump(mode="json")["motion"] == {"vary": {"sigma": 2.0}}
    assert show.config.names["phrase"] == ("main", "vary", "granular", "path", "improvise")
    assert show.motion_networks["path"] == tmp_path / "pose.onnx"
    drawn: dict[str, Any] = {"path": {"points": [0.1, 0.9, 0.5, 0.5]}}
    show = load_show(write_show_with_sources(tmp_path, cues=[cue | {"motion": drawn}]))
    assert show.config.cues[0].model_dump(mode="json")["motion"] == drawn
    for points in ([0.5], [0.5, 1.5]):
        with pytest.raises(ConfigError, match="points"):
            wrong = {"path": {"points": points}}
            load_show(write_show_with_sources(tmp_path, cues=[cue | {"motion": wrong}]))
    with pytest.raises(ConfigError, match="sigma"):
        load_show(write_show_with_sources(tmp_path, cues=[cue | {"motion": {"vary": {"sigma": -1.0}}}]))
