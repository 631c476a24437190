"""How recordings are read is kept by what was trained on them, and holds for no file of our own making."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.body_facts import fronts, sampled_positions
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.data.catalogue import Catalogue
from appliance.studio.data.remembered import Remembered, reading_facts
from tests.studio.conftest import bunraku
from tests.studio.test_commands import said
from tests.studio.tiny import swaying

UNIT = 0.031  # metres, which no guess knows
TOLD = ("--metres-per-unit", UNIT, "--facing", "-z")


@pytest.mark.usefixtures("quickly_written")
def test_later_commands_read_as_training_did_and_leave_what_they_made(tmp_path: Path) -> None:
    folder, out = tmp_path / "takes", tmp_path / "pose"
    folder.mkdir()
    for seed in range(2):
        dance = swaying(6.0, seed)
        dance.poses[:, 0] = quaternion.multiply(np.array([0.0, 0.0, 1.0, 0.0]), dance.poses[:, 0])
        write_bvh(folder / f"take_{seed}.bvh", dance, UNIT)
    trained = bunraku("train", "--model", "pose", "--recordings", folder, "--out", out, "--steps", 2, *TOLD)
    assert trained.exit_code == 0, said(trained)

    def wobbled(phrase: Path, name: str, *reported: object) -> Path:
        options = (
            "--model",
            out / "checkpoint.pt",
            "--out",
            tmp_path / name,
            "--wobble",
            0,
            1,
            "--seconds",
            1,
        )
        result = bunraku("path", phrase, *options, *reported)
        assert result.exit_code == 0, said(result)
        return tmp_path / name

    once = wobbled(folder / "take_0.bvh", "once.bvh")
    again = wobbled(once, "again.bvh")
    turned = wobbled(once, "turned.bvh", "--facing", "once=-z")
    written = read_bvh(folder / "take_0.bvh", metres_per_unit=UNIT).skeleton
    for made, front in ((once, 1), (again, 1), (turned, -1)):
        dance = read_bvh(made)
        np.testing.assert_allclose(dance.skeleton.offsets, written.offsets, atol=1e-4)
        ways = fronts(written, sampled_positions(dance))
        assert ways is not None and front * ways.mean(axis=0)[1] > 0.5, made.name


def test_what_was_asked_for_goes_before_what_is_remembered(tmp_path: Path) -> None:
    inches = Catalogue().with_options(ReadingOptions(metres_per_unit={"*": 0.0254}, all_frames=True))
    assert reading_facts(inches) == {"metres_per_unit": {"*": 0.0254}, "all_frames": True}
    write_bvh(tmp_path / "raw.bvh", swaying(1.0), 0.0254)
    write_bvh(tmp_path / "ours.bvh", swaying(1.0))
    trained = Remembered(inches.reading, read_bvh(tmp_path / "ours.bvh").skeleton)
    write_bvh(tmp_path / "at_another_rate.bvh", swaying(1.0, fps=60.0))

    def unit(name: str, **asked: float) -> float | None:
        reported = trained.options_for(tmp_path / name, ReadingOptions(metres_per_unit=asked))
        return reported.conventions_of(Path(name).stem).metres_per_unit

    assert unit("raw.bvh") == 0.0254 and unit("raw.bvh", raw=0.5) == 0.5
    assert unit("ours.bvh") is None and unit("ours.bvh", ours=0.5) == 0.5
    assert unit("at_another_rate.bvh") == 0.0254
