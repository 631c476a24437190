"""The predicted figure: limbs of the same length, further on, quiet at jumps, feet on the floor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.projector.prediction import CONFIDENCE, MOST_M, MOST_RADIANS, REST, SPAN, Figure, Prediction
from appliance.release.choice import EMBEDDED_SHOW
from appliance.show.show import load_show


@pytest.fixture(scope="module")
def skeleton() -> Skeleton:
    return load_show(EMBEDDED_SHOW).skeleton


def figure_at(
    skeleton: Skeleton, turns: np.ndarray, root: tuple[float, float, float] = (0.0, 1.0, 0.0), held: str = ""
) -> Figure:
    """turns (J,): radians of each joint about its own x. held: a joint; "": the root, so the whole figure."""
    pose = quaternion.from_axis_angle([1, 0, 0], turns)
    positions, world = skeleton.forward_kinematics(pose, np.array(root))
    holds = np.zeros(len(skeleton), np.float32)
    holds[skeleton.index(held) if held else 0] = 1.0
    return Figure(positions.astype(np.float32), world.astype(np.float32), holds)


def moving(
    skeleton: Skeleton, rates: np.ndarray, ticks: tuple[float, ...], speed: float = 0.0
) -> list[Figure]:
    return [figure_at(skeleton, rates * tick, (speed * tick, 1.0, 0.0)) for tick in ticks]


def test_limbs_keep_their_lengths(skeleton: Skeleton) -> None:
    rates = np.random.default_rng(1).normal(0.0, 0.05, len(skeleton))
    found = Prediction(skeleton)(*moving(skeleton, rates, (0, -SPAN, -2 * SPAN), 0.01), 2.0)
    parents = np.array(skeleton.parents[1:])
    lengths = np.linalg.norm(found.positions[1:] - found.positions[parents], axis=-1)
    np.testing.assert_allclose(lengths, np.linalg.norm(skeleton.offsets[1:], axis=-1), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found.world, axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize("ticks", [0.0, 0.5, 1.0, 2.0])
def test_an_even_turn_is_carried_on_with_its_share(skeleton: Skeleton, ticks: float) -> None:
    rates = np.zeros(len(skeleton))
    rates[skeleton.index("lShldr")] = 0.03
    now, before, earlier = moving(skeleton, rates, (0, -SPAN, -2 * SPAN))
    found = Prediction(skeleton)(now, before, earlier, ticks)
    wanted = figure_at(skeleton, rates * ticks * CONFIDENCE)
    np.testing.assert_allclose(found.world, wanted.world, atol=2e-4)
    np.testing.assert_allclose(found.positions, wanted.positions, atol=3e-4)


def test_limbs_that_a_hand_leads_are_carried_on_further(skeleton: Skeleton) -> None:
    rates = np.full(len(skeleton), 0.01)
    now, before, earlier = (
        figure_at(skeleton, rates * tick, held="lShldr") for tick in (0, -SPAN, -2 * SPAN)
    )
    found = Prediction(skeleton)(now, before, earlier, 1.0)
    turned = quaternion.angle_between(found.world, now.world) / quaternion.angle_between(
        now.world, before.world
    )
    for name, share in (("lShldr", 1.0), ("lHand", 1.0), ("rShldr", REST), ("lCollar", REST), ("hip", REST)):
        assert turned[skeleton.index(name)] == pytest.approx(CONFIDENCE * share / SPAN, rel=0.01), name


def test_after_a_jump_nothing_is_carried_on(skeleton: Skeleton) -> None:
    here, there = (
        figure_at(skeleton, np.zeros(len(skeleton))),
        figure_at(skeleton, np.full(len(skeleton), 0.3)),
    )
    found = Prediction(skeleton)(there, here, here, 1.0)
    np.testing.assert_allclose(found.positions, there.positions, atol=1e-5)


def test_where_the_figure_turns_back_nothing_is_carried_on(skeleton: Skeleton) -> None:
    rates = np.full(len(skeleton), 0.02)
    now, before = moving(skeleton, rates, (0, -SPAN))
    np.testing.assert_allclose(
        Prediction(skeleton)(now, before, now, 1.0).positions, now.positions, atol=1e-5
    )


def test_no_joint_is_turned_on_and_no_root_moved_on_further_than_bounded(skeleton: Skeleton) -> None:
    rates = np.zeros(len(skeleton))
    rates[skeleton.index("lShldr")] = 0.6
    now, before, earlier = moving(skeleton, rates, (0, -SPAN, -2 * SPAN))
    found = Prediction(skeleton)(now, before, earlier, 5.0)
    assert 0.8 * MOST_RADIANS < quaternion.angle_between(found.world, now.world).max() <= MOST_RADIANS
    now, before, earlier = moving(skeleton, np.zeros(len(skeleton)), (0, -SPAN, -2 * SPAN), 0.5)
    found = Prediction(skeleton)(now, before, earlier, 5.0)
    assert math.dist(found.positions[0], now.positions[0]) == pytest.approx(MOST_M, rel=0.01)


def test_a_standing_foot_stays_while_the_hips_sink(skeleton: Skeleton) -> None:
    """Hip, knee and ankle turn against one another: with a share for each of them the foot would slide."""
    rates = np.zeros(len(skeleton))
    for name, rate in (("lThigh", -0.02), ("lShin", 0.04), ("lFoot", -0.02)):
        rates[skeleton.index(name)] = rate
    foot = skeleton.index("lFoot")
    figures = []
    for tick in (0, -SPAN, -2 * SPAN):
        hanging = figure_at(skeleton, 0.3 * rates / 0.02 + rates * tick)
        figures.append(hanging._replace(positions=hanging.positions - hanging.positions[foot]))
    moved = math.dist(figures[0].positions[0], figures[1].positions[0]) / SPAN
    found = Prediction(skeleton)(*figures, 1.0)
    assert moved > 0.005
    assert math.dist(found.positions[foot], (0, 0, 0)) < 0.1 * moved
