"""Unexplored regions: found where a limb's poses were never combined, and danced through smoothly."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from appliance.levers.sources import PATH
from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path
from appliance.studio.evaluation.dance_figures import largest_step
from appliance.studio.opened_model import OpenedModel, open_show
from appliance.studio.pose_space.explore import exploring
from appliance.studio.pose_space.latent_poses import latents_of, poses_of
from appliance.studio.pose_space.unseen import Known
from tests.studio.conftest import bunraku


@pytest.fixture(scope="module")
def opened() -> OpenedModel:
    return open_show(PATH, default_show_path())


@pytest.fixture(scope="module")
def known(opened: OpenedModel) -> Known:
    return Known.of(opened.network, opened.dataset)


def test_recorded_poses_are_seen_and_plausible_and_torn_ones_are_neither(known: Known) -> None:
    assert not known.unseen(known.shapes).any() and known.plausible(known.shapes).all()
    torn = known.shapes.copy()
    torn[:, 3 * known.limbs["arms"][-1] + 1] += 60  # a hand 60 cm above where it was
    assert known.unseen(torn).mean() > 0.8 and known.plausible(torn).mean() < 0.3


def test_regions_are_unseen_plausible_and_apart(known: Known) -> None:
    regions, share = known.regions(4, 1)
    assert len(regions) == 4 and 0 < share < 0.2
    shapes = known.shapes_of(poses_of(known.network, np.stack([one.latent for one in regions])))
    assert known.unseen(shapes).all() and known.plausible(shapes).all()
    assert all(one.away_cm > known.far and one.take == "phrase" and 0 <= one.at_s < 90 for one in regions)
    again, _ = known.regions(4, 1)
    np.testing.assert_array_equal(again[2].latent, regions[2].latent)


def test_what_was_visited_is_no_region_any_more(opened: OpenedModel, known: Known) -> None:
    """The null product finds the same regions whatever was danced since."""
    from appliance.studio.pose_space.explore import _seen
    from appliance.studio.pose_space.unseen import poses_shown

    region = known.regions(1, 1)[0][0]
    visit, _ = poses_shown(known, region)
    held = visit.spread(np.arange(1))
    take = _seen(Path("visit.bvh"), held)
    later = Known.of(opened.network, opened.dataset, [take])
    assert later.far == known.far, "performances say nothing about what is usual"
    shape = known.shapes_of(poses_of(known.network, region.latent[None]))
    assert known.unseen(shape).all() and not later.unseen(shape).any()


def test_the_dance_begins_and_ends_as_the_phrase_and_goes_there_without_a_jolt(
    opened: OpenedModel, known: Known
) -> None:
    moving = list(opened.dataset.moving)
    own = opened.dataset.training[0].recording.poses[:600][:, moving].astype(np.float32)
    latents, facing = latents_of(opened.network, own)
    regions = np.stack([one.latent for one in known.regions(2, 1)[0]])
    path = exploring(latents, regions)
    np.testing.assert_allclose(path[[0, -1]], latents[[0, -1]], atol=1e-4)
    made = poses_of(opened.network, path, facing)
    assert largest_step(made) < 1.5 * largest_step(poses_of(opened.network, latents, facing))
    shapes = known.shapes_of(made)
    both = known.unseen(shapes) & known.plausible(shapes)
    assert both.mean() > 0.15 and not both[:25].any()
    quiet = exploring(np.repeat(latents[:1], 600, axis=0), regions)
    assert np.linalg.norm(quiet[200] - regions[0], axis=-1) < 1e-3, "it reaches the region itself"


def test_the_command_lists_draws_and_compares_with_null_products(tmp_path: Path) -> None:
    out = tmp_path / "unseen.bvh"
    options = ["--seconds", 8, "--count", 2, "--out", out]
    result = bunraku("explore", "--show", "default", *options)
    assert result.exit_code == 0, result.output
    assert "2 regions that none of" in result.stderr and len(read_bvh(out)) == 400
    report = json.loads(out.with_suffix(".json").read_text())
    rows = report["figures"]
    assert rows["unseen"]["both"] > max(rows[name]["both"] for name in rows if name != "unseen")
    assert rows["the phrase itself"]["unseen"] == 0 and rows["noise"]["jerk"] > 20 > rows["unseen"]["jerk"]
    for ending in (".png", ".map.png"):
        assert out.with_suffix(ending).read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--model", "x.pt"], "--phrase"),
        ([], "Give --show"),
        (["--show", "martial"], "has no pose.onnx"),
    ],
)
def test_what_it_needs_is_said(arguments: list[str], message: str, tmp_path: Path) -> None:
    result = bunraku("explore", *arguments, "--out", tmp_path / "x.bvh")
    assert result.exit_code == 2 and message in " ".join(result.stderr.split()), result.output
