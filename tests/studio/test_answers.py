"""Lessons in answering: what the dancer does with a joint held so, and how a network learns to go there."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.answers import Answers, AnswerSettings
from appliance.studio.autoencoder.lessons import Hands, Lesson
from appliance.studio.autoencoder.repertoire import Nearness, Repertoire, change, middle

ROOT, ARM, LEG, HEAD = range(4)
NEAR = Nearness(neighbours=8)


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


SETTINGS = AnswerSettings(reserve=400, wandering=40, nearness=NEAR)
FULL = 1.0  # of the training


def lessons(recorded: Tensor, danced: Tensor | None = None, **changed: float) -> Answers:
    """Lessons in which one joint is held: the arm. danced: without mirror images; None: there are none."""
    torch.manual_seed(2)
    chances = torch.tensor([1e-6, 1.0, 1e-6, 1e-6])
    return Answers(recorded, recorded if danced is None else danced, chances, replace(SETTINGS, **changed))


def with_hands(answers: Answers, progress: float = FULL) -> Lesson:
    lesson, _ = answers.draw(400, progress)
    return lesson


def without_hands(answers: Answers) -> Lesson:
    _, lesson = answers.draw(400, FULL)
    return lesson


def hands_of(lesson: Lesson) -> Hands:
    assert lesson.hands is not None
    return lesson.hands


def test_a_window_without_a_hand_should_come_out_as_it_went_in(recorded: Tensor) -> None:
    lesson = without_hands(lessons(recorded, disturbed=0.0))
    assert lesson.hands is None and lesson.passes == 1
    torch.testing.assert_close(lesson.answer, lesson.windows, atol=1e-3, rtol=0)


def test_mirror_images_are_copied_and_are_no_answers(recorded: Tensor) -> None:
    danced = recorded[recorded[:, 0, ARM, 3] > 0]  # the others bend the arm to the other side
    answers = lessons(recorded, danced, wild=0.0, disturbed=0.0)
    assert without_hands(answers).answer[:, :, ARM, 3].min() < -0.3
    lesson = with_hands(answers)
    for windows in (lesson.windows, lesson.answer, hands_of(lesson).goal):
        assert windows[:, :, ARM, 3].min() > -0.01


def test_a_disturbed_window_is_led_back(recorded: Tensor) -> None:
    lesson = without_hands(lessons(recorded, disturbed=1.0))
    fresh = lesson.windows[:100]
    # The leg of an undisturbed window follows the arm: that is what should come out.
    assert degrees(lesson.answer[:100, :, LEG], lesson.answer[:100, :, ARM]).max() < 0.1
    assert degrees(fresh[:, :, LEG], fresh[:, :, ARM]).max() > 20


def test_a_window_that_wanders_off_is_pulled_back_to_what_the_dancer_does(recorded: Tensor) -> None:
    answers = lessons(recorded, disturbed=0.0)
    bent = dance(torch.full((40,), 0.5), torch.zeros(40))
    bent[:, :, LEG] = turned(torch.full((40, 8), -0.2))  # no leg was ever bent against the arm
    pulled = []
    for _ in range(33):  # the search comes around every 16 lessons
        lesson = without_hands(answers)
        assert lesson.rows is not None and len(lesson.rows) == 40
        lost, back = lesson.windows[-40:], lesson.answer[-40:]
        pulled.append(float(degrees(lost[:, :, LEG], back[:, :, LEG]).mean()))
        answers.follow(lesson, torch.cat([lesson.windows[:-40], bent]))
    assert pulled[0] < 0.1  # fresh windows wander by themselves
    assert pulled[-1] > 10 * pulled[0]
    against = [degrees(windows[:, :, LEG], windows[:, :, ARM]).mean() for windows in (lost, back)]
    assert against[1] < against[0] - 1


def test_passes_grow_with_the_training_from_two_to_all(recorded: Tensor) -> None:
    answers = lessons(recorded)
    assert {with_hands(answers, 0.0).passes for _ in range(20)} == {2}
    passes = [with_hands(answers).passes for _ in range(400)]
    assert set(passes) == set(range(2, SETTINGS.passes + 1))
    assert passes.count(SETTINGS.passes) > 150 and passes.count(2) > 75


def test_more_passes_are_asked_to_go_further_towards_the_answer(recorded: Tensor) -> None:
    """The way that is left shrinks by the step with each pass that has a hand."""
    answers = lessons(recorded, light=0.0, wild=0.0)
    shares = {}
    for _ in range(60):
        lesson = with_hands(answers)
        hands = hands_of(lesson)
        goal = degrees(lesson.windows[:, 0, ARM], hands.goal[:, 0, ARM])
        first = degrees(lesson.windows[:, 0, LEG], hands.first[:, 0, LEG])
        there = degrees(lesson.windows[:, 0, LEG], lesson.answer[:, 0, LEG])
        far = (goal > 30) & (hands.held[:, LEG] == 0)
        shares[lesson.passes] = float((first[far] / there[far]).median())
    for passes, share in shares.items():
        reached = 1 - (1 - SETTINGS.step) ** (passes - 1)
        assert share == pytest.approx(SETTINGS.step / reached, abs=0.02)
    assert len(shares) > 5


def test_a_held_joint_is_asked_for_at_once(recorded: Tensor) -> None:
    hands = hands_of(with_hands(lessons(recorded, light=0.0, wild=0.0, frozen=0.0)))
    assert degrees(hands.first[:, :, ARM], hands.goal[:, :, ARM])[hands.held[:, ARM] == 1].mean() < 4


def test_a_light_hand_asks_for_a_part_of_the_answer(recorded: Tensor) -> None:
    answers = lessons(recorded, light=1.0, wild=0.0, frozen=0.0)
    reached: dict[int, list[Tensor]] = {0: [], 1: [], 2: []}
    for _ in range(30):
        lesson = with_hands(answers)
        hands = hands_of(lesson)
        goal = degrees(lesson.windows[:, 0, ARM], hands.goal[:, 0, ARM])
        there = degrees(lesson.windows[:, 0, LEG], hands.first[:, 0, LEG])
        alone = (hands.held[:, LEG] == 0) & (hands.held[:, HEAD] == 0) & (goal > 30)
        third = (hands.held[:, ARM] * 3).long().clamp(max=2)
        for part, ratios in reached.items():
            ratios.append((there / goal)[alone & (third == part)])
    light, middling, firm = (float(torch.cat(ratios).median()) for ratios in reached.values())
    assert 0 < light < 0.6 * middling < middling < 0.85 * firm


def test_dances_come_in_pairs_a_few_poses_apart() -> None:
    moving = dance(torch.linspace(-1, 1, 4000), torch.zeros(4000))
    lesson = with_hands(lessons(moving))
    first, second = lesson.windows.chunk(2)
    apart = degrees(first[:, 0, ARM], second[:, 0, ARM])
    a_pose = math.degrees(2 / 3999)
    assert 0.9 * a_pose < apart[apart > 0].min() and apart.max() < 8.5 * a_pose
    torch.testing.assert_close(*hands_of(lesson).held.chunk(2))
