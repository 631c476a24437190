"""Two versions of a dance: form and timing are told apart, and the worst moments named."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.show.bundle import default_show_path
from appliance.studio.comparison import versions
from appliance.studio.comparison.periods import Period, _takes
from appliance.studio.comparison.pictures import draw_joints_over_time
from appliance.studio.comparison.versions import compare, null_rows, sentences
from appliance.studio.data.mirror import mirrored
from appliance.studio.exchange.retargeting import retarget
from appliance.studio.improviser import naturalness
from appliance.studio.studio_error import StudioError
from tests.studio.bodies import body
from tests.studio.conftest import bunraku
from tests.studio.tiny import skeleton, swaying


def danced(seconds: float = 8.0, seed: int = 1) -> Recording:
    """Every joint moves smoothly, and never twice alike."""
    rng, time, bones = np.random.default_rng(seed), np.arange(round(50 * seconds)) / 50, skeleton()
    poses = np.tile([1.0, 0, 0, 0], (len(time), len(bones), 1))
    for joint in range(len(bones)):
        waves = [rng.uniform(0.1, 0.3) * np.sin(time * rate + rng.uniform(0, 6)) for rate in (0.9, 2.1, 3.7)]
        poses[:, joint] = quaternion.from_axis_angle(rng.normal(size=3), sum(waves))
    roots = np.stack([0.2 * np.sin(time), np.full(len(time), 0.8), 0 * time], axis=-1)
    return Recording(bones, quaternion.continuous(poses), roots, 50.0)


def lowered(dance: Recording, name: str, degrees: float, first: int, end: int) -> Recording:
    """A joint turned for a while, its beginning and end eased."""
    joint, poses = dance.skeleton.index(name), dance.poses.copy()
    turn = quaternion.from_axis_angle([0.0, 0, 1.0], -np.radians(degrees) * np.hanning(end - first))
    poses[first:end, joint] = quaternion.multiply(turn, poses[first:end, joint])
    return replace(dance, poses=poses)


def test_a_shift_and_another_tempo_are_timing_and_no_form() -> None:
    teacher = danced()
    found = dict(null_rows(teacher))
    itself, late, fast, image, backwards = found.values()
    assert itself.form == pytest.approx(0, abs=0.01) and itself.alignment.late_s == pytest.approx(0, abs=0.01)
    assert late.form < 0.1 < 3 < late.on_the_clock
    assert late.alignment.late_s == pytest.approx(0.4, abs=0.02)
    assert late.alignment.tempo == pytest.approx(1, abs=0.01)
    assert fast.form < 0.5 < 3 < fast.on_the_clock
    assert fast.alignment.tempo == pytest.approx(1.1, abs=0.01) and fast.alignment.unsteady_s < 0.03
    assert image.form > 8 and backwards.form > 8, "another dance stays another one"
    assert compare(teacher, danced(seed=2)).form > 8
    words = sentences(late, [], "anna")
    assert "anna is 0.40 s later, at the same tempo" in words[0] and "the form is the same" in words[1]
    assert "1.10 times as fast" in sentences(fast, [], "anna")[0]


def test_the_joint_and_the_second_of_a_mistake_are_named_whatever_the_tempo() -> None:
    teacher = danced()
    wrong = lowered(teacher, "lShldr", 60, 200, 300)
    student = wrong.between(np.clip(np.arange(0, len(wrong) - 1, 0.9) - 15, 0, None))
    found = compare(teacher, student)
    worst = found.moments()[0]
    assert worst.joint == "left upper arm" == next(iter(found.by_joint))
    assert worst.teacher_s == pytest.approx(5.0, abs=0.4) and worst.degrees == pytest.approx(60, abs=8)
    assert worst.student_s == pytest.approx(0.3 + worst.teacher_s / 0.9, abs=0.2)
    assert "cm" in worst.words and found.by_joint["right upper arm"] < 0.3 * found.by_joint["left upper arm"]
    assert found.alignment.tempo == pytest.approx(0.9, abs=0.02)


def test_neither_may_stand_while_the_other_goes_on() -> None:
    """The null product is unbounded time warping, with which a statue fits wherever the dancer passes by."""
    teacher = danced()
    still = replace(teacher, poses=np.repeat(teacher.poses[100:101], len(teacher), axis=0))
    found = compare(teacher, still)
    assert found.form > 5
    assert found.alignment.tempo_over_time.min() >= 0.5 and found.alignment.tempo_over_time.max() <= 2


def test_another_body_is_compared_by_what_its_joints_are() -> None:
    teacher = danced(5.0)
    other = retarget(teacher, body())
    assert compare(teacher, other).form < 3
    with pytest.raises(StudioError, match="different skeletons"):
        names = tuple(f"j{number}" for number in range(len(body())))
        compare(teacher, replace(other, skeleton=replace(body(), names=names)))


def test_too_long_a_dance_is_no_version() -> None:
    with pytest.raises(StudioError, match="more than twice as long"):
        compare(danced(2.0), danced(30.0))


def test_the_command_draws_says_and_writes_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(versions, "MOMENTS", 1)
    teacher = danced(4.0)
    write_bvh(tmp_path / "teacher.bvh", teacher)
    write_bvh(tmp_path / "anna.bvh", lowered(mirrored(teacher), "rShldr", 50, 80, 160).excerpt(0.4))
    files = tmp_path / "teacher.bvh", tmp_path / "anna.bvh"
    result = bunraku("compare", *files, "--no-nulls", "--out", tmp_path / "as-it-is")
    assert result.exit_code == 0 and "give --mirrored" in result.stderr
    result = bunraku("compare", *files, "--mirrored", "--out", tmp_path / "out")
    words = " ".join(result.stderr.split())
    assert result.exit_code == 0 and "anna is 0.40 s earlier, at the same tempo" in words, result.output
    assert "The worst moments: " in words and "left upper arm" in words
    report = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert (
        report["figures"]["anna"]["form_degrees"] < 5 < report["figures"]["itself, mirrored"]["form_degrees"]
    )
    for name in ("moments.png", "joints.png"):
        assert (tmp_path / "out" / name).read_bytes()[:4] == b"\x89PNG"


def with_an_arm_up(dance: Recording, first: int, end: int) -> Recording:
    """For some frames the left arm points upwards."""
    poses, joint = dance.poses.copy(), dance.skeleton.index("lShldr")
    turn = quaternion.from_axis_angle([0.0, 0, 1.0], 1.4 * np.hanning(end - first) ** 0.5)
    poses[first:end, joint] = quaternion.multiply(turn, poses[first:end, joint])
    return replace(dance, poses=poses)


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """The same practice twice; the later one raises an arm in two takes, at 3 to 6 s."""
    dance = swaying(9.0, 1)
    for name in ("earlier", "later"):
        (tmp_path / name).mkdir()
        for number, start in enumerate((0.0, 0.5, 1.0)):
            take = dance.excerpt(start)
            if name == "later" and number < 2:
                take = with_an_arm_up(take, 150, 300)
            write_bvh(tmp_path / name / f"take_{number}.bvh", take)
    return tmp_path / "earlier", tmp_path / "later"


def test_a_new_movement_is_found_where_it_is(folders: tuple[Path, Path], tmp_path: Path) -> None:
    result = bunraku("periods", *folders, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "out" / "periods.json").read_text())
    shares = report["shares"]
    assert shares["earlier"]["new"] == 0, "all that it does is in the later one too"
    assert 0.1 < shares["later"]["new"] < 0.5
    assert report["movements"]["earlier"] == []
    found = report["movements"]["later"]
    assert all(3 <= one["at_s"] <= 6.2 and one["take"] in ("take_0", "take_1") for one in found)
    assert max(one["takes"] for one in found) == 2
    words = " ".join(result.stderr.split())
    assert f"{shares['later']['new']:.0%} of later is like nothing in earlier" in words
    for name in ("periods.png", "shares.png"):
        assert (tmp_path / "out" / name).read_bytes()[:4] == b"\x89PNG"


def test_the_same_practice_has_nothing_new_whatever_the_body(
    folders: tuple[Path, Path], tmp_path: Path
) -> None:
    """The null product: a period beside itself, on another skeleton."""
    (tmp_path / "other").mkdir()
    for file in sorted(folders[0].iterdir()):
        dance = swaying(9.0, 1).excerpt(0.5 * int(file.stem[-1]))
        write_bvh(tmp_path / "other" / file.name, retarget(dance, body()))
    result = bunraku("periods", folders[0], tmp_path / "other", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "0% of earlier is like nothing in other" in " ".join(result.stderr.split())


def test_a_single_recording_is_cut_into_parts_with_its_own_seconds() -> None:
    parts = _takes(default_show_path(), ReadingOptions())
    assert len(parts) == 9 and {part.name for part in parts} == {"phrase"}
    period = Period.of("default", parts, None)
    assert max(map(period.second_of, range(len(period.rows)))) == pytest.approx(88, abs=2)


def test_a_recording_of_ten_seconds_has_two_parts_to_compare(
    folders: tuple[Path, Path], tmp_path: Path
) -> None:
    write_bvh(tmp_path / "ten.bvh", swaying(9.8, 1))
    parts = _takes(tmp_path / "ten.bvh", ReadingOptions())
    assert [len(part.recording) for part in parts] == [245, 245]
    result = bunraku("periods", folders[0], tmp_path / "ten.bvh", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output


def test_a_recording_that_is_too_short_is_no_practice(folders: tuple[Path, Path], tmp_path: Path) -> None:
    write_bvh(tmp_path / "short.bvh", swaying(4.0, 1))
    result = bunraku("periods", folders[0], tmp_path / "short.bvh", "--out", tmp_path / "out")
    assert result.exit_code == 2 and "less than 9 s of sound dance" in " ".join(result.stderr.split())


def test_joints_with_names_of_other_joints_roles_are_told_apart(tmp_path: Path) -> None:
    """VRM has `chest` below `upperChest`, which is taken for the chest."""
    names = {"hip": "hips", "abdomen": "spine", "neck": "upperChest"}

    def renamed(dance: Recording) -> Recording:
        changed = tuple(names.get(name, name) for name in dance.skeleton.names)
        return replace(dance, skeleton=replace(dance.skeleton, names=changed))

    found = compare(renamed(danced()), renamed(danced(seed=2)))
    assert {"chest", "joint chest"} <= found.by_joint.keys()
    assert len(found.by_joint) == len(found.joints)
    draw_joints_over_time(tmp_path / "joints.png", found, found.moments(), "one", "other")


def test_hours_of_a_practice_are_compared_part_by_part(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(50, 30)), rng.normal(size=(33, 30))
    whole, most = naturalness.distances(one, other), []

    def counted(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        most.append(len(a) * len(b))
        return distances(a, b)

    distances = naturalness.distances
    monkeypatch.setattr(naturalness, "_DISTANCES_AT_ONCE", 100)
    monkeypatch.setattr(naturalness, "distances", counted)
    apart, places = naturalness.nearest(one, other)
    assert max(most) <= 100 and len(most) > 1
    np.testing.assert_allclose(apart, whole.min(axis=1))
    np.testing.assert_array_equal(places, whole.argmin(axis=1))
