"""Batches in answering: what the dancer does with a joint held so, and how a network learns to go there."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.answers import Answers, AnswerSettings
from appliance.studio.autoencoder.batches import Batch, HeldTargets
from appliance.studio.autoencoder.repertoire import Nearness, Repertoire, change, middle

ROOT, ARM, LEG, HEAD = range(4)
NEAR = Nearness(bandwidth=0.02, hand_degrees=4.0)
NO_TAKE = torch.tensor([-1])


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


def repertoire(windows: Tensor) -> Repertoire:
    """All of one take."""
    return Repertoire(windows, torch.zeros(len(windows)), NEAR)


def test_the_answer_is_what_the_dancer_does_with_that_arm(recorded: Tensor) -> None:
    windows = dance(torch.full((20,), -0.6), torch.linspace(-0.5, 0.5, 20))
    hands = dance(torch.full((20,), 0.7), torch.zeros(20))
    answer = repertoire(recorded).answers(windows, hands, held(20, ARM), NO_TAKE.expand(20))
    assert degrees(answer[:, :, LEG], hands[:, :, LEG]).mean() < 6  # 0.7 radians: the leg goes along
    assert degrees(answer[:, :, ARM], hands[:, :, ARM]).mean() < 3
    assert degrees(answer[:, :, HEAD], windows[:, :, HEAD]).mean() < 6  # nothing ties it to the arm


def test_a_hand_where_the_phrase_has_the_arm_anyway_changes_little(recorded: Tensor) -> None:
    windows = dance(torch.linspace(-0.6, 0.6, 20), torch.linspace(0.5, -0.5, 20))
    answer = repertoire(recorded).answers(windows, windows, held(20, ARM), NO_TAKE.expand(20))
    assert degrees(answer, windows).mean() < 1


def test_a_hand_that_no_dancer_had_gets_the_body_of_the_nearest_that_one_had(recorded: Tensor) -> None:
    windows = dance(torch.zeros(20), torch.zeros(20))
    hands = dance(torch.full((20,), 2.5), torch.zeros(20))
    answer = repertoire(recorded).answers(windows, hands, held(20, ARM), NO_TAKE.expand(20))
    leg = degrees(answer[:, :, LEG], windows[:, :, LEG])
    assert leg.min() > 40 and leg.max() < math.degrees(1.0) + 3  # as far as the leg was ever bent


def test_signs_of_quaternions_do_not_matter_to_the_search(recorded: Tensor) -> None:
    hands = dance(torch.full((4,), 0.7), torch.zeros(4))
    hands[:, ::2] *= -1
    torch.testing.assert_close(middle(hands).abs(), middle(hands.abs()))
    assert change(hands).abs().max() < 1e-6


SETTINGS = AnswerSettings(reserve=400, uses=2, nearness=NEAR)


def batches(recorded: Tensor, danced: Tensor | None = None, **changed: float) -> Answers:
    """Batches in which one joint is held: the arm. danced: without mirror images; None: there are none."""
    torch.manual_seed(2)
    chances = torch.tensor([1e-6, 1.0, 1e-6, 1e-6])
    own = recorded if danced is None else danced
    takes = torch.arange(len(own)) % 4
    return Answers(recorded, own, takes, chances, replace(SETTINGS, **changed))


def with_hands(answers: Answers) -> Batch:
    batch, _ = answers.draw(400)
    return batch


def without_hands(answers: Answers) -> Batch:
    _, batch = answers.draw(400)
    return batch


def hands_of(batch: Batch) -> HeldTargets:
    assert batch.hands is not None
    return batch.hands


def test_a_window_without_a_hand_should_come_out_as_it_went_in(recorded: Tensor) -> None:
    batch = without_hands(batches(recorded))
    assert batch.hands is None
    torch.testing.assert_close(batch.answer, batch.windows, atol=1e-3, rtol=0)


def test_mirror_images_are_copied_and_are_no_answers(recorded: Tensor) -> None:
    danced = recorded[recorded[:, 0, ARM, 3] > 0]  # the others bend the arm to the other side
    answers = batches(recorded, danced, wild=0.0)
    assert without_hands(answers).answer[:, :, ARM, 3].min() < -0.3
    batch = with_hands(answers)
    for windows in (batch.windows, batch.answer, hands_of(batch).goal):
        assert windows[:, :, ARM, 3].min() > -0.01


def test_a_light_hand_asks_for_a_part_of_the_answer(recorded: Tensor) -> None:
    answers = batches(recorded, light=1.0, wild=0.0, frozen=0.0)
    light, firm = [], []
    for _ in range(30):
        batch = with_hands(answers)
        hands = hands_of(batch)
        way = degrees(batch.windows[:, 0, LEG], batch.answer[:, 0, LEG])
        alone = (hands.held[:, LEG] == 0) & (hands.held[:, HEAD] == 0)
        light.append(way[alone & (hands.held[:, ARM] < 0.3)])
        firm.append(way[alone & (hands.held[:, ARM] > 0.7)])
    assert torch.cat(light).median() < 0.5 * torch.cat(firm).median()


def test_an_answer_does_not_come_from_the_take_that_the_window_is_of(recorded: Tensor) -> None:
    """Else a training knows each answer by heart, and a new phrase gets none."""
    takes = torch.arange(len(recorded)) % 2
    other = recorded[takes == 1]
    windows = dance(torch.full((5,), -0.4), torch.zeros(5))
    hands = dance(torch.full((5,), 0.6), torch.zeros(5))
    own = torch.zeros(5, dtype=torch.long)
    both = Repertoire(recorded, takes, NEAR).answers(windows, hands, held(5, ARM), own)
    alone = Repertoire(other, torch.ones(len(other)), NEAR).answers(windows, hands, held(5, ARM), own)
    torch.testing.assert_close(both, alone, atol=1e-4, rtol=0)


def test_the_answers_spread_is_the_dances_own(recorded: Tensor) -> None:
    """What the mean of all good answers fails: the head, which nothing ties to the arm, dances on."""
    head = torch.linspace(-0.7, 0.7, 40)
    windows, hands = dance(torch.full((40,), -0.3), head), dance(torch.full((40,), 0.4), torch.zeros(40))
    answer = repertoire(recorded).answers(windows, hands, held(40, ARM), NO_TAKE.expand(40))
    spread = [2 * torch.asin(each[:, 0, HEAD, 3]).std() for each in (answer, windows)]
    assert spread[0] == pytest.approx(float(spread[1]), rel=0.1)
