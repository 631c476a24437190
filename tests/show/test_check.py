"""Checksums and verify_bundle: a sound bundle has no findings, each damage has its own."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import (
    CHECKSUMS,
    bundle_bytes,
    bundled_shows,
    checksum_problems,
    default_show_path,
    named_show,
    write_checksums,
)
from appliance.show.check import Finding, verify_bundle
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.show.yaml_file import read_yaml
from tests.show.conftest import MOVING, NAMES, SHOW_YAML, recording, save_network, skeleton


def only(directory: Path, repack: bool = True) -> Finding:
    """The one finding of a bundle, packed again so that checksums do not speak too."""
    if repack:
        write_checksums(directory)
    findings = verify_bundle(directory)
    assert len(findings) == 1, "\n".join(map(str, findings))
    return findings[0]


def test_a_sound_bundle_has_no_findings(bundle: Path) -> None:
    assert verify_bundle(bundle) == []


def test_sha256sum_reads_the_checksums(bundle: Path) -> None:
    if not shutil.which("sha256sum"):
        pytest.fail("the program 'sha256sum' is missing: install the Debian package coreutils")
    checked = subprocess.run(["sha256sum", "--check", "--strict", CHECKSUMS], cwd=bundle, capture_output=True)
    assert checked.returncode == 0, checked.stderr


def test_a_changed_byte_is_found_with_its_line(bundle: Path) -> None:
    content = bytearray((bundle / "report.json").read_bytes() + b" ")
    (bundle / "report.json").write_bytes(content)
    finding = only(bundle, repack=False)
    names = [line.split("  ")[1] for line in (bundle / CHECKSUMS).read_text().splitlines()]
    assert (finding.file, finding.line) == (bundle / CHECKSUMS, names.index("report.json") + 1)
    assert finding.level == "error" and "'report.json' is not the file that was packed" in finding.message


def test_a_missing_file_is_found(bundle: Path) -> None:
    (bundle / "report.json").unlink()
    assert [(f.level, f.message) for f in verify_bundle(bundle)] == [
        ("error", "'report.json' is missing."),
        ("warning", "The report of the training is missing."),
    ]


def test_a_file_without_a_checksum_is_a_warning_and_hidden_ones_do_not_matter(bundle: Path) -> None:
    (bundle / "notes.txt").write_text("remember the gaffer tape")
    (bundle / ".DS_Store").write_text("a stick that was in another machine")
    finding = only(bundle, repack=False)
    assert finding.level == "warning" and finding.file == bundle / "notes.txt"
    assert str(finding).endswith("(a warning)")


@pytest.mark.parametrize(
    "line", ["no checksum at all", f"{'0' * 64}  ../../etc/passwd", f"{'0' * 64}  /etc/passwd"]
)
def test_a_broken_line_of_checksums_is_found(bundle: Path, line: str) -> None:
    with (bundle / CHECKSUMS).open("a") as sums:
        sums.write(line + "\n")
    (problem,) = checksum_problems(bundle)
    assert problem.line == 6 and "not a checksum" in problem.message


def test_missing_checksums_are_found(bundle: Path) -> None:
    (bundle / CHECKSUMS).unlink()
    assert only(bundle, repack=False).message == "The checksums are missing or unreadable."


def test_faults_of_show_yaml_keep_their_lines(bundle: Path) -> None:
    (bundle / "show.yaml").write_text("name: x\nmotoin: {}\n")
    finding = only(bundle)
    assert (finding.file.name, finding.line, finding.cure) == ("show.yaml", 2, "Did you mean 'motion'?")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"joints": ("hip", "chest", "lSholder")}, ["'lSholder'", "Did you mean 'lShldr'?"]),
        ({"facts": {"window": "16"}}, ["16 poses long"]),
        ({"facts": {"joints": ""}}, ["does not say which joints"]),
        ({"facts": {"rest": "[[1, 0, 0]]"}}, ["rest pose"]),
        ({"facts": {"rest": "nonsense"}}, ["rest pose"]),
        ({"joints": ("hip", "chest", "lShldr", "chest", "rShldr")}, ["names a joint twice"]),
        ({"facts": {"joints": ",".join(NAMES)}}, ["has the shape ['P', 8, 5, 4], not ['P', 8, 6, 4]"]),
        ({"without": "weights"}, ["no input 'weights'"]),
        ({"targets": [1, 8, 5, 4]}, ["'targets' has the shape [1, 8, 5, 4], not ['P', 8, 5, 4]"]),
        ({"facts": {"latent": "many"}}, ["latent has many numbers"]),
        ({"facts": {"latent": "7"}}, ["'noise' has the shape ['P', 1], not ['P', 7]", "Export the show"]),
        ({"node": "Log"}, ["numbers that are no rotations"]),
        ({"node": "Exp"}, ["numbers that are no rotations"]),
    ],
)
def test_a_network_that_is_no_puppet_of_this_show_is_refused(
    bundle: Path, change: dict[str, object], words: list[str]
) -> None:
    save_network(bundle / "puppet.onnx", **change)  # type: ignore[arg-type]
    (bundle / "show.yaml").write_text(SHOW_YAML.split("hands:")[0])
    write_checksums(bundle)
    findings = verify_bundle(bundle)
    assert findings and all(finding.level == "error" for finding in findings)
    assert {finding.file for finding in findings} == {bundle / "puppet.onnx"}
    for word in words:
        assert word in "\n".join(map(str, findings))


def test_a_network_that_is_no_network_is_refused(bundle: Path) -> None:
    (bundle / "puppet.onnx").write_bytes(b"once upon a time")
    assert "cannot be read as a network" in only(bundle).message


def test_a_hand_on_a_still_joint_is_refused_with_its_line(bundle: Path) -> None:
    assert "leftEye" not in MOVING
    (bundle / "show.yaml").write_text(SHOW_YAML.replace("lShldr", "leftEye"))
    finding = only(bundle)
    assert (finding.file.name, finding.line) == ("show.yaml", 9)
    assert "does not move the joint 'leftEye'" in finding.message


def test_a_phrase_shorter_than_a_window_is_refused(bundle: Path) -> None:
    write_bvh(bundle / "phrase.bvh", recording(7))
    finding = only(bundle)
    assert finding.level == "error" and finding.file == bundle / "phrase.bvh"
    assert finding.message == "The excerpt has 7 poses; one window needs 8."
    write_bvh(bundle / "phrase.bvh", recording(8))
    write_checksums(bundle)
    assert verify_bundle(bundle) == []


@pytest.mark.parametrize(
    ("motion", "line", "message"),
    [
        ("motion:\n  start_s: 1.1\n", 3, "The excerpt has 5 poses"),
        ("motion:\n  start_s: 30\n", 3, "The excerpt has 0 poses"),
        ("motion:\n  end_s: 9\n", 3, "behind the phrase's end (1.20 s)"),
    ],
)
def test_an_excerpt_outside_the_phrase_is_refused(bundle: Path, motion: str, line: int, message: str) -> None:
    (bundle / "show.yaml").write_text(f"name: x\n{motion}")
    finding = only(bundle)
    assert (finding.level, finding.file.name, finding.line) == ("error", "show.yaml", line)
    assert message in finding.message


def test_a_phrase_of_another_skeleton_is_refused(bundle: Path) -> None:
    write_bvh(
        bundle / "phrase.bvh",
        recording(60, skeleton(("hip", "chest", "lShldr", "lForeArm", "rShldr", "rEye"))),
    )
    assert "only one of them has leftEye, rEye" in only(bundle).message
    bones = skeleton()
    longer = Skeleton(bones.names, bones.parents, bones.offsets * 1.1, bones.ends)
    write_bvh(bundle / "phrase.bvh", recording(60, longer))
    assert "not as long as those" in only(bundle).message


@pytest.mark.parametrize("far", [2e3, 1e30])
def test_a_bone_longer_than_any_stage_is_refused_by_its_name(bundle: Path, far: float) -> None:
    bones = skeleton()
    bones.offsets[2, 0] = far
    for name, frames in (("skeleton", 1), ("phrase", 60)):
        write_bvh(bundle / f"{name}.bvh", recording(frames, bones))
    finding = only(bundle)
    assert (finding.level, finding.file.name) == ("error", "skeleton.bvh")
    assert f"'{bones.names[2]}'" in finding.message


def test_a_phrase_at_another_rate_is_a_warning(bundle: Path) -> None:
    write_bvh(bundle / "phrase.bvh", recording(60, fps=60.0))
    finding = only(bundle)
    assert finding.level == "warning" and "60 poses a second" in finding.message


@pytest.mark.parametrize("frames", [[60], [60, 61, 90], list(range(20, 120, 2))])
def test_a_root_that_jumps_is_a_warning_that_names_file_and_frames(bundle: Path, frames: list[int]) -> None:
    phrase = recording(150)
    for frame in frames:
        phrase.roots[frame:, 0] += 40.0
    write_bvh(bundle / "phrase.bvh", phrase)
    finding = only(bundle)
    assert (finding.level, finding.file) == ("warning", bundle / "phrase.bvh")
    assert f"{frames[0] + 1} ({frames[0] / 50:.2f} s)" in finding.message
    assert ("45 more" in finding.message) == (len(frames) == 50)
    assert "goes on from where it stood" in finding.message


def test_a_row_of_the_phrase_that_is_lost_is_a_warning_with_its_line(bundle: Path) -> None:
    lines = (bundle / "phrase.bvh").read_text().splitlines()
    lines[-1] = lines[-1].replace("0", "nan", 1)
    (bundle / "phrase.bvh").write_text("\n".join(lines) + "\n")
    finding = only(bundle)
    assert (finding.file.name, finding.level) == ("phrase.bvh", "warning")
    assert f"Line {len(lines)}: 1 row lost" in finding.message


def test_a_broken_phrase_keeps_its_line(bundle: Path) -> None:
    lines = (bundle / "phrase.bvh").read_text().splitlines()
    lines[0] = "HIERARCHIE"
    (bundle / "phrase.bvh").write_text("\n".join(lines) + "\n")
    finding = only(bundle)
    assert (finding.file.name, finding.line) == ("phrase.bvh", 1)


def test_a_bundle_that_is_too_large_is_a_warning(bundle: Path) -> None:
    (bundle / "film.bin").write_bytes(bytes(26_000_000))
    finding = only(bundle)
    assert finding.level == "warning" and "more than 25 MB" in finding.message


def test_a_report_that_is_no_json_is_a_warning_with_its_line(bundle: Path) -> None:
    (bundle / "report.json").write_text('{\n"a": 1,\n"b": nothing\n}')
    finding = only(bundle)
    assert (finding.level, finding.line) == ("warning", 3)


def test_a_missing_folder_is_one_finding(tmp_path: Path) -> None:
    assert only(tmp_path / "nowhere", repack=False).message == "There is no such show folder."


@given(st.text(max_size=200) | st.binary(max_size=200).map(lambda raw: raw.decode("latin-1")))
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_text_raises_anything_but_a_config_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "show.yaml"
    path.write_bytes(text.encode("utf-8", "replace"))
    try:
        values = read_yaml(path).values
    except ConfigError as error:
        assert all(problem.message for problem in error.problems)
    else:
        assert isinstance(values, dict)


def test_the_show_that_comes_with_the_box_is_sound() -> None:
    assert verify_bundle(default_show_path()) == []
    assert np.sum([path.stat().st_size for path in default_show_path().iterdir()]) <= 25_000_000


SHOWS = bundled_shows()


def test_the_default_show_is_the_first() -> None:
    assert list(SHOWS) == ["default", "martial"]
    assert SHOWS["default"] == default_show_path()


@pytest.mark.parametrize("name", SHOWS)
def test_a_show_that_comes_with_the_box_is_sound(name: str) -> None:
    assert verify_bundle(SHOWS[name]) == []
    assert "mocap.cs.cmu.edu" in load_show(SHOWS[name]).config.acknowledgement


def test_the_second_dancer_is_small_and_dances_another_phrase() -> None:
    assert bundle_bytes(SHOWS["martial"]) <= 5_000_000
    phrases = [read_bvh(load_show(show).phrase) for show in SHOWS.values()]
    assert phrases[0].skeleton.names == phrases[1].skeleton.names
    assert 20.0 <= phrases[1].seconds <= 40.0
    assert phrases[0].poses.shape != phrases[1].poses.shape


def test_a_name_stands_for_its_folder() -> None:
    assert named_show(Path("martial")) == SHOWS["martial"]
    assert named_show(None) is None
    assert named_show(Path("nowhere")) == Path("nowhere")


def test_a_show_in_a_folder_of_that_name_takes_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("martial").mkdir()
    assert named_show(Path("martial")) == SHOWS["martial"]
    shutil.copy(SHOWS["default"] / "show.yaml", "martial")
    assert named_show(Path("martial")) == Path("martial")


@pytest.mark.parametrize(
    ("word", "cure"),
    [
        ("marital", "Did you mean 'martial', which comes with the box?"),
        ("my_show", "Check its path. Shows that come with the box: default, martial."),
        ("shows/martial", "Check its path. Shows that come with the box: default, martial."),
    ],
)
def test_an_unknown_name_names_the_nearest(word: str, cure: str) -> None:
    assert [finding.cure for finding in verify_bundle(word)] == [cure]
    with pytest.raises(ConfigError, match="There is no such show folder") as refused:
        load_show(word)
    assert cure in str(refused.value)
