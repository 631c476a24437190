"""Cues: what they may say, and every name in them checked against what the show has."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from appliance.pose.bvh import write_bvh
from appliance.show.bundle import write_checksums
from appliance.show.check import verify_bundle
from appliance.show.config_error import ConfigError
from appliance.show.cues import too_much
from appliance.show.opening_hours import HoursConfig
from appliance.show.show import load_show
from tests.show.conftest import recording, skeleton

SHOW = """\
name: Cues
motion:
  phrase: phrase.bvh
  phrases:
    quiet: quiet.bvh
hands:
  - {sensor: left-wrist, joint: lShldr}
  - {osc: true, joint: rShldr}
looks:
  - {name: marble, style: plaster}
  - {name: wires, style: lines}
cues:
"""
FIRST_CUE = SHOW.count("\n") + 1


@pytest.fixture
def with_cues(bundle: Path, show_yaml: Callable[[str], Path]) -> Callable[[str], Path]:
    """Writes cues into the show; gives the bundle's folder."""
    write_bvh(bundle / "quiet.bvh", recording(30))
    return lambda cues: show_yaml(SHOW + cues)


def test_a_cue_says_what_it_changes_and_leaves_the_rest(with_cues: Callable[[str], Path]) -> None:
    config = load_show(
        with_cues(
            "  - {name: start}\n"
            "  - name: storm\n"
            "    phrase: quiet\n"
            "    iterations: [10, 9]\n"
            "    liveliness: 0.5\n"
            "    seed: 7\n"
            "    hands: [lShldr]\n"
            "    look: wires\n"
            "    master: 0.4\n"
            "    fade_s: 5\n"
        )
    ).config
    start, storm = config.cues
    assert (start.phrase, start.iterations, start.hands, start.look, start.master) == (None,) * 5
    assert start.fade_s == 2.0
    assert (storm.liveliness, storm.seed, start.liveliness, start.seed) == (0.5, 7, None, None)
    assert (storm.phrase, storm.iterations, storm.hands) == ("quiet", (10, 9), ["lShldr"])
    assert (storm.look, storm.master, storm.fade_s) == ("wires", 0.4, 5)
    assert config.names["phrase"] == ("main", "quiet")
    assert config.names["look"] == ("marble", "wires")


def test_hands_that_move_nothing_are_a_warning_with_their_line(with_cues: Callable[[str], Path]) -> None:
    directory = with_cues(
        "  - {name: free, iterations: [3, 0], hands: []}\n"
        "  - {name: copied, iterations: [1, 0]}\n"
        "  - {name: forgotten, iterations: [4, 0], hands: [lShldr]}\n"
        "  - {name: held, iterations: [1, 1]}\n"
    )
    write_checksums(directory)
    first, second = verify_bundle(directory)
    assert {first.level, second.level} == {"warning"}
    assert (first.line, second.line) == (FIRST_CUE + 1, FIRST_CUE + 2)
    assert "The hands move nothing in the cue 'copied'" in first.message and "[1, 1]" in first.cure
    assert "'forgotten'" in second.message and "[4, 3]" in second.cure and "`hands: []`" in second.cure


def test_hands_that_move_nothing_are_a_warning(bundle: Path, show_yaml: Callable[[str], Path]) -> None:
    dancer = "name: x\ndancer:\n  coding_iterations: 6\n  interaction_iterations: 0\n"
    write_checksums(show_yaml(dancer))
    assert verify_bundle(bundle) == []  # there are no hands
    write_checksums(show_yaml(dancer + "hands:\n  - {kept: true, joint: lShldr}\n"))
    (finding,) = verify_bundle(bundle)
    assert (finding.level, finding.line) == ("warning", 4)
    assert finding.message == "The hands move nothing: interaction_iterations is 0."
    assert finding.cure == "Write 5, or remove the hands."


def test_without_looks_the_built_in_ones_may_be_named(bundle: Path, show_yaml: Callable[[str], Path]) -> None:
    config = load_show(
        show_yaml("name: x\ncues:\n- {name: a, look: plaster}\n- {name: b, look: ink}\n")
    ).config
    assert config.names["look"][0] == "plaster"


@pytest.mark.parametrize(
    ("cue", "line", "words"),
    [
        ("{name: a, phrase: quite}", 0, ["no phrase 'quite'", "Did you mean 'quiet'?"]),
        ("{name: a, look: wire}", 0, ["no look 'wire'", "Did you mean 'wires'?"]),
        ("{name: a, look: lines}", 0, ["no look 'lines'"]),
        ("name: a\n    look: marbel", 1, ["no look 'marbel'", "Did you mean 'marble'?"]),
        (
            "name: a\n    hands:\n    - lShldr\n    - lForeArm",
            3,
            ["No hand of this show holds", "'lForeArm'"],
        ),
        ("{name: a, lights: warm}", 0, ["no set of light mappings 'warm'", "Remove `lights`"]),
        ("{name: a, iterations: [4, 5]}", 0, ["5 interaction", "4 coding", "[4, 3]"]),
        ("{name: a, iterations: [0, 0]}", 0, ["0 coding iterations"]),
        ("{name: a, iterations: [4]}", 0, ["is a list of 1"]),
        ("{name: a, iterations: [65, 1]}", 0, ["is 65, out of range"]),
        ("{name: a, liveliness: 1.5}", 0, ["is 1.5, out of range"]),
        ("{name: a, seed: -1}", 0, ["is -1, out of range"]),
        ("{name: a, iterations: 5}", 0, ["is 5, which is not 2 numbers in brackets"]),
        ("{name: a, master: 1.5}", 0, ["is 1.5, out of range", "Write 0 to 1."]),
        ("{name: a, fade_s: 61}", 0, ["Write 0 to 60."]),
        ("{name: a, fade: 3}", 0, ["Unknown key 'fade' in 'cues[0]'", "Did you mean 'fade_s'?"]),
        ("{phrase: quiet}", 0, ["'cues[0].name' is missing"]),
        ("{name: a}\n  - {name: b}\n  - {name: a}", 2, ["Two cues are called 'a'", f"line {FIRST_CUE}"]),
    ],
)
def test_a_fault_is_named_with_its_line(
    with_cues: Callable[[str], Path], cue: str, line: int, words: list[str]
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_show(with_cues(f"  - {cue}\n"))
    assert (caught.value.file.name, caught.value.line) == ("show.yaml", FIRST_CUE + line)
    assert len(caught.value.problems) == 1
    for word in words:
        assert word in str(caught.value)


def test_all_faults_of_all_cues_are_reported_at_once(with_cues: Callable[[str], Path]) -> None:
    cues = "  - {name: a, phrase: b, look: c}\n  - {name: a, hands: [d, e]}\n"
    with pytest.raises(ConfigError) as caught:
        load_show(with_cues(cues))
    lines = [problem.line - FIRST_CUE for problem in caught.value.problems]
    assert lines == [0, 0, 1, 1, 1]


def test_iterations_that_do_not_fit_this_machine_are_reported_beforehand(
    with_cues: Callable[[str], Path],
) -> None:
    show = load_show(with_cues("  - {name: a, iterations: [6, 5]}\n  - {name: b, iterations: [20, 3]}\n"))
    assert list(too_much(show.config.cues, 20, show.file)) == []
    (problem,) = too_much(show.config.cues, 8, show.file)
    assert problem.line == FIRST_CUE + 1
    assert "'b' asks for 20 coding iterations; 8 fit" in problem.message


@pytest.mark.parametrize(
    ("phrases", "line", "words"),
    [
        ("{main: phrase.bvh}", 3, ["'main' is what the phrase that the show starts with is called"]),
        ("\n    quiet: quite.bvh", 4, ["There is no file 'quite.bvh'"]),
        ("\n    quiet: ../phrase.bvh", 4, ["is not inside the show's folder"]),
        ("\n    quiet: 5", 4, ["'motion.phrases.quiet' is 5"]),
        ("[quiet.bvh]", 3, ["is a list of 1, which is not a group of names, each with text"]),
        ("\n    quiet: phrase.bvh\n    quiet: phrase.bvh", 5, ["'quiet' is here twice"]),
    ],
)
def test_a_fault_in_the_phrases_is_named_with_its_line(
    bundle: Path, show_yaml: Callable[[str], Path], phrases: str, line: int, words: list[str]
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_show(show_yaml(f"name: x\nmotion:\n  phrases: {phrases}\n"))
    assert caught.value.line == line
    for word in words:
        assert word in str(caught.value)


def test_check_looks_at_every_phrase(with_cues: Callable[[str], Path]) -> None:
    bundle = with_cues("  - {name: a, phrase: quiet}\n")
    write_checksums(bundle)
    assert verify_bundle(bundle) == []
    write_bvh(bundle / "quiet.bvh", recording(7))
    write_checksums(bundle)
    (finding,) = verify_bundle(bundle)
    assert (finding.file.name, finding.level) == ("quiet.bvh", "error")
    assert "'quiet' has 7 poses; one window needs 8" in finding.message
    other = skeleton(("hip", "chest", "lShldr", "lForeArm", "rShldr", "rEye"))
    write_bvh(bundle / "quiet.bvh", recording(60, other))
    write_checksums(bundle)
    (finding,) = verify_bundle(bundle)
    assert finding.file.name == "quiet.bvh" and "rEye" in finding.message
    write_bvh(bundle / "quiet.bvh", recording(60, fps=30.0))
    write_checksums(bundle)
    (finding,) = verify_bundle(bundle)
    assert (finding.file.name, finding.level) == ("quiet.bvh", "warning")


def test_two_looks_of_one_name_are_refused(show_yaml: Callable[[str], Path]) -> None:
    with pytest.raises(ConfigError, match="Two looks are called 'a'") as caught:
        load_show(show_yaml("name: x\nlooks:\n- {name: a}\n- {name: b}\n- {name: a}\n"))
    assert caught.value.line == 5


def test_strings_and_opening_hours_that_name_no_cue_of_the_show_are_warned_of(
    with_cues: Callable[[str], Path],
) -> None:
    """They would be silent, or change nothing, without a word."""
    bundle = with_cues("  - {name: walk in}\n  - {name: duet}\nstrings: {cues: [duet, duett]}\n")
    write_checksums(bundle)
    found = [one for one in verify_bundle(bundle) if "strings" in one.message]
    assert [one.level for one in found] == ["warning"]
    assert "cue 'duett', which this show does not have" in found[0].message
    assert (found[0].line, found[0].cure) == (FIRST_CUE + 2, "Did you mean 'duet'?")
    hours = HoursConfig.model_validate(
        {"open": [{"from": "10:00", "to": "18:00"}], "open_cue": "walk in", "attract": {"cue": "waiting"}}
    )
    (sentence,) = hours.unknown_cues(["walk in", "duet"])
    assert sentence.startswith("The opening hours call the cue 'waiting'")
