"""Gestures: learned from three repetitions, found again at other speeds and sizes, and not elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.sensor.gesture_memory import gestures_text, read_gestures
from appliance.sensor.gestures import (
    RATE_HZ,
    REPETITIONS,
    Gesture,
    Recogniser,
    Repetitions,
    learned,
    nearest,
)
from hw_sim.motions import dance
from tools.gestures import in_dance, made_gestures, repeated

Stream = np.ndarray[Any, Any]
MADE = {name: one for name, one in made_gestures().items() if name in ("circle", "wave", "salute", "key")}


def three(name: str, seed: int = 1) -> list[Stream]:
    rng = np.random.default_rng(seed)
    return [
        repeated(MADE[name], rng, rng.uniform(0.95, 1.05), rng.uniform(0.95, 1.05)).astype(np.float32)
        for _ in range(REPETITIONS)
    ]


def dancing(seconds: float, seed: int = 0) -> Stream:
    """The emulated wearable's own dance."""
    motion = dance(seed)
    return np.array([motion(tick / RATE_HZ) for tick in range(round(seconds * RATE_HZ))], np.float32)


def found(gestures: list[Gesture], stream: Stream) -> list[tuple[int, str]]:
    recogniser = Recogniser()
    recogniser.gestures = tuple(gestures)
    seen = []
    for place, one in enumerate(stream.astype(np.float32)):
        if (gesture := recogniser.take(one, place / RATE_HZ)) is not None:
            seen.append((place, gesture.name))
    return seen


@pytest.fixture(scope="module")
def gestures() -> list[Gesture]:
    usual = dancing(10.0)
    return [learned(name, f"cue {name}", "lHand", three(name), usual) for name in MADE]


def test_each_gesture_is_found_where_it_ends_and_under_its_own_name(gestures: list[Gesture]) -> None:
    rng, hits = np.random.default_rng(3), 0
    for gesture in gestures:
        again = repeated(MADE[gesture.name], rng, 1.1, 1.05)
        stream, end = in_dance(again, dancing(12.0, seed=4), 150, rng)
        seen = [name for place, name in found(gestures, stream) if end - 8 <= place <= end + 12]
        hits += seen[:1] == [gesture.name]
    assert hits >= len(gestures) - 1


def test_dance_without_a_gesture_calls_nothing_and_neither_does_a_still_hand(gestures: list[Gesture]) -> None:
    assert len(found(gestures, dancing(12.0, seed=9))) <= 1
    assert found(gestures, np.tile(quaternion.IDENTITY, (200, 1))) == []


def test_where_the_dancer_faces_does_not_matter(gestures: list[Gesture]) -> None:
    take = gestures[0].takes[0]
    turned = quaternion.multiply(quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 2.0), take)
    tipped = quaternion.multiply(quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 2.0), take)
    plain, other, wrong = (
        nearest(gestures[0], one.astype(np.float32)).min() for one in (take, turned, tipped)
    )
    assert other == pytest.approx(plain, abs=0.01) and wrong > plain + 0.1


def test_it_is_called_once_for_each_time_that_it_is_made(gestures: list[Gesture]) -> None:
    wave = gestures[list(MADE).index("wave")]
    stream = np.concatenate(
        [np.tile(wave.takes[0][:1], (30, 1)), wave.takes[0], wave.takes[0][-1:].repeat(40, 0)]
    )
    places = [place for place, _ in found([wave], stream)]
    assert len(places) == 1


def test_repetitions_are_found_between_stillnesses_and_nothing_else_is() -> None:
    takes, still = three("salute"), np.tile(quaternion.IDENTITY, (20, 1))
    tremor = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), 0.004 * np.sin(np.arange(60)))
    stream = [dancing(3.0), still, tremor]
    for take in takes:
        level = quaternion.multiply(quaternion.inverse(take[:1]), take)
        stream += [still, level, level[-1:].repeat(20, 0)]
    repetitions, before = Repetitions(), None
    for one in np.concatenate(stream).astype(np.float32):
        if before is not None and not repetitions.is_done:
            repetitions.take(one, before)
        before = one
    assert repetitions.is_done
    assert [len(one) for one in repetitions.takes] == pytest.approx([len(one) for one in takes], abs=8)


def test_three_unlike_movements_are_refused() -> None:
    unlike = [three(name)[0] for name in ("circle", "wave", "salute")]
    with pytest.raises(ValueError, match="too unlike each other"):
        learned("it", "a cue", "lHand", unlike)


def test_what_was_learned_comes_back_and_damage_is_refused(gestures: list[Gesture]) -> None:
    text = gestures_text({"Evening": gestures, "Matinee": []})
    again = read_gestures(text)
    assert [*again] == ["Evening", "Matinee"] and [one.name for one in again["Evening"]] == list(MADE)
    stream = dancing(10.0, seed=2)
    assert nearest(again["Evening"][1], stream)[-40:] == pytest.approx(
        nearest(gestures[1], stream)[-40:], rel=0.05, abs=1e-2
    )
    for damaged in (text[:-20], b"[]", text.replace(b'"within"', b'"without"'), b'{"a": [{"name": 1}]}'):
        with pytest.raises(ValueError):
            read_gestures(damaged)
