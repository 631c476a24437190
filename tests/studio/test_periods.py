"""Two periods of a practice: what one does and the other never does is found, with its share and its null."""

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
from appliance.studio.comparison.periods import Period, _takes
from appliance.studio.exchange.retargeting import retarget
from tests.studio.bodies import body
from tests.studio.conftest import bunraku
from tests.studio.tiny import swaying


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


def test_a_recording_that_is_too_short_is_no_practice(folders: tuple[Path, Path], tmp_path: Path) -> None:
    write_bvh(tmp_path / "short.bvh", swaying(4.0, 1))
    result = bunraku("periods", folders[0], tmp_path / "short.bvh", "--out", tmp_path / "out")
    assert result.exit_code == 2 and "less than 9 s of sound dance" in " ".join(result.stderr.split())
