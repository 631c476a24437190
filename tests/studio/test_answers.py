"""Lessons in answering: what the dancer does with a joint held so, and how a network learns to go there."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.answers import Answers, AnswerSettings
from appliance.studio.autoencoder.repertoire import Nearness, Repertoire, change, middle

ROOT, ARM, LEG, HEAD = range(4)
NEAR = Nearness(neighbours=8, candidates=4000)


def turned(angles: Tensor, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Tensor:
    """Rotations (..., 4) by angles (...) about an axis."""
    half = angles[..., None] / 2
    return torch.cat([torch.cos(half), torch.sin(half) * torch.tensor(axis)], dim=-1)


def dance(arm: Tensor, head: Tensor) -> Tensor:
    """Windows (N, 8, 4 joints, 4) of a dancer who bends the leg as far as the arm is raised; (N,) radians."""
    angles = torch.stack([0 * arm, arm, arm, head], dim=-1)
    return turned(angles)[:, None].expand(-1, 8, -1, -1).clone()


@pytest.fixture(scope="module")
def recorded() -> Tensor:
    torch.manual_seed(1)
    return dance(2 * torch.rand(3000) - 1, 2 * torch.rand(3000) - 1)


def degrees(one: Tensor, other: Tensor) -> Tensor:
    return torch.rad2deg(rotation.angle_between(one, other))


def held(count: int, joint: int, weight: float = 1.0) -> Tensor:
    weights = torch.zeros(count, 4)
    weights[:, joint] = weight
    return weights


def test_the_answer_is_what_the_dancer_does_with_that_arm(recorded: Tensor) -> None:
    windows = dance(torch.full((20,), -0.6), torch.linspace(-0.5, 0.5, 20))
    hands = dance(torch.full((20,), 0.7), torch.zeros(20))
    answer = Repertoire(recorded, NEAR).answers(windows, hands, held(20, ARM))
    assert degrees(answer[:, :, LEG], hands[:, :, LEG]).mean() < 6  # 0.7 radians: the leg goes along
    assert degrees(answer[:, :, ARM], hands[:, :, ARM]).mean() < 3
    assert degrees(answer[:, :, HEAD], windows[:, :, HEAD]).mean() < 6  # nothing ties it to the arm


def test_a_hand_where_the_phrase_has_the_arm_anyway_changes_little(recorded: Tensor) -> None:
    windows = dance(torch.linspace(-0.6, 0.6, 20), torch.linspace(0.5, -0.5, 20))
    near = replace(NEAR, own=1.0)
    answer = Repertoire(recorded, near).answers(windows, windows, held(20, ARM))
    assert degrees(answer, windows).mean() < 1


def test_a_hand_that_no_dancer_had_gets_the_nearest_that_one_had(recorded: Tensor) -> None:
    windows = dance(torch.zeros(20), torch.zeros(20))
    hands = dance(torch.full((20,), 2.5), torch.zeros(20))
    answer = Repertoire(recorded, NEAR).answers(windows, hands, held(20, ARM))
    arm = degrees(answer[:, :, ARM], windows[:, :, ARM])
    assert arm.min() > 45 and arm.max() < math.degrees(1.0) + 1  # as high as the arm was ever raised
    assert degrees(answer[:, :, LEG], windows[:, :, LEG]).min() > 40


def test_signs_of_quaternions_do_not_matter_to_the_search(recorded: Tensor) -> None:
    hands = dance(torch.full((4,), 0.7), torch.zeros(4))
    hands[:, ::2] *= -1
    torch.testing.assert_close(middle(hands).abs(), middle(hands.abs()))
    assert change(hands).abs().max() < 1e-6


SETTINGS = AnswerSettings(pool=400, nearness=NEAR)


def pool(recorded: Tensor, **changed: float) -> Answers:
    torch.manual_seed(2)
    chances = torch.tensor([1e-6, 1.0, 1e-6, 1e-6])
    return Answers(recorded, chances, replace(SETTINGS, **changed))


def test_a_dance_without_a_hand_should_stay_as_it_is(recorded: Tensor) -> None:
    lesson = pool(recorded, free=1.0, disturbed=0.0).draw(400)
    assert not lesson.held.any()
    torch.testing.assert_close(lesson.answer, lesson.windows, atol=1e-3, rtol=0)


def test_a_disturbed_dance_is_led_back(recorded: Tensor) -> None:
    lesson = pool(recorded, free=1.0, disturbed=1.0).draw(400)
    torch.testing.assert_close(lesson.answer, lesson.start, atol=1e-3, rtol=0)
    assert degrees(lesson.windows, lesson.start).max() > 20


def test_each_pass_asks_for_a_step_towards_the_answer(recorded: Tensor) -> None:
    """Passes of a network that does what it is asked: the way that is left shrinks by the step each time."""
    answers = pool(recorded, free=0.0, let_go=0.0, light=0.0, wild=0.0, passes=1000.0)
    left = []
    for _ in range(4):
        lesson = answers.draw(400)
        in_order = lesson.rows.argsort()
        left.append(degrees(lesson.windows, answers._answer[lesson.rows])[in_order][:, 0, LEG])
        answers.follow(lesson, lesson.answer)
    far = (left[0] > 20) & (answers._held[:, LEG] == 0)
    assert far.sum() > 100
    for before, after in pairwise(left):
        torch.testing.assert_close(
            after[far] / before[far], torch.full_like(before[far], 1 - SETTINGS.step), atol=0.02, rtol=0
        )


def test_a_light_hand_asks_for_a_part_of_the_answer(recorded: Tensor) -> None:
    reach = {}
    for weight in (0.25, 0.5, 1.0):
        answers = pool(recorded, free=0.0, wild=0.0, frozen=0.0)
        windows = dance(torch.full((50,), -0.6), torch.zeros(50))
        answers._weights = lambda *_, weight=weight: held(25, ARM, weight)  # type: ignore[method-assign]
        answers._recorded = dance(torch.full((50,), 0.7), torch.zeros(50))
        answers._take_hands(torch.arange(50), windows, torch.ones(25, dtype=torch.long))
        reach[weight] = float(degrees(answers._answer[:50, :, LEG], windows[:, :, LEG]).mean())
    assert reach[0.25] < 0.45 * reach[1.0] < reach[0.5] < 0.8 * reach[1.0]
    assert reach[1.0] > 60


def test_dances_come_in_pairs_a_few_poses_apart() -> None:
    moving = dance(torch.linspace(-1, 1, 4000), torch.zeros(4000))
    lesson = pool(moving, free=0.5, disturbed=0.0).draw(200)
    first, second = lesson.start.chunk(2)
    apart = degrees(first[:, 0, ARM], second[:, 0, ARM])
    a_pose = math.degrees(2 / 3999)
    assert 0.9 * a_pose < apart[apart > 0].min() and apart.max() < 8.5 * a_pose
    torch.testing.assert_close(*lesson.held.chunk(2))


def test_dances_that_are_led_go_on_from_what_was_asked_for(recorded: Tensor) -> None:
    for led, asked in ((1.0, True), (0.0, False)):
        answers = pool(recorded, free=0.0, led=led)
        lesson = answers.draw(400)
        made = lesson.windows.roll(1, 0)
        answers.follow(lesson, made)
        torch.testing.assert_close(answers._windows[lesson.rows], lesson.answer if asked else made)
