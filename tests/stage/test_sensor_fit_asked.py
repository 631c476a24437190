"""A neutral pose taken anew or a heading reset, because the dancer taps the sensor or a person asks."""

from __future__ import annotations

import math

import pytest

from appliance.stage.sensor_memory import SensorMemory
from tests.stage.worn import HAND, HANGING, SENSOR, Evening, about_front, about_up, holds, multiply


def test_a_double_tap_takes_the_pose_at_the_next_half_second_of_stillness(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(1.0, taps=0)
    stage.dance(0.5, taps=1)
    assert stage.wants
    stage.stand(0.4, about_up(70.0), taps=1)
    assert stage.taken() == 1
    stage.stand(0.8, about_up(70.0), taps=1)
    assert stage.taken() == 2 and not stage.wants
    assert holds(stage.target(), HANGING)
    stage.stand(3.0, about_up(20.0), taps=1)
    assert stage.taken() == 2


def test_stillness_before_the_tap_does_not_count(evening: Evening) -> None:
    stage = evening()
    stage.stand(4.0, about_up(40.0))
    stage.stand(0.4, about_up(40.0), taps=255)
    assert stage.taken() == 1
    stage.stand(0.2, about_up(40.0), taps=255)
    assert stage.taken() == 2
    stage.stand(0.6, about_up(40.0), taps=0)  # the counter wraps
    assert stage.taken() == 3


def test_who_taps_and_dances_on_keeps_the_pose_and_is_told(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(2.9, taps=1)
    assert stage.wants and len(stage.said) == 2
    stage.dance(0.2, taps=1)
    assert not stage.wants and len(stage.said) == 3
    assert "did not keep still within 3 s" in stage.said[2]
    stage.stand(0.5, about_up(40.0), taps=1)
    assert stage.taken() == 1 and holds(stage.target(), HANGING)


def test_a_tap_before_the_first_pose_leaves_it_wanted(evening: Evening) -> None:
    stage = evening()
    stage.dance(0.2)
    stage.dance(3.5, taps=1)
    assert stage.wants and "did not keep still" in stage.said[-1]
    stage.stand(1.6, about_up(40.0), taps=1)
    assert stage.taken() == 1


def test_a_sensor_that_falls_silent_while_asked_is_told_of_too(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.stand(0.1, about_up(40.0), taps=1)
    stage.silence(3.1)
    assert not stage.wants and "did not keep still" in stage.said[-1]


@pytest.mark.parametrize("asked", [SENSOR, None])
def test_a_person_may_ask_for_the_pose(evening: Evening, asked: str | None) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(1.0)
    stage.wearing.take_neutral(asked, stage.now)
    stage.stand(1.2, about_up(80.0))
    assert stage.taken() == 2 and holds(stage.target(), HANGING)


def test_a_dancer_who_stands_still_already_need_not_wait(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(40.0))
    stage.dance(1.0)
    stage.stand(1.0, about_up(80.0))
    stage.wearing.take_neutral(SENSOR, stage.now)
    stage.hear(about_up(80.0))
    assert stage.taken() == 2


@pytest.mark.parametrize("asked", [SENSOR, None])
def test_the_heading_alone_is_reset(evening: Evening, memory: SensorMemory, asked: str | None) -> None:
    stage = evening()
    stage.stand(2.5, about_up(40.0))
    drifted = multiply(about_up(25.0), about_up(40.0))
    stage.stand(0.5, drifted)
    assert not holds(stage.target(), HANGING)
    stage.wearing.reset_heading(asked, stage.now)
    stage.stand(0.6, drifted)
    assert holds(stage.target(), HANGING)
    assert stage.said[-1] == f"Sensor {SENSOR}: this is the front now. Dance."
    saved = memory.neutral(SENSOR, "lShldr")
    assert saved is not None and saved.heading == pytest.approx(math.radians(25.0))
    assert stage.taken() == 1 and not stage.wants


def test_a_heading_reset_before_any_pose_is_for_now_alone(evening: Evening, memory: SensorMemory) -> None:
    stage = evening()
    stage.dance(0.3)
    stage.hear(about_up(90.0))
    stage.wearing.reset_heading(SENSOR, stage.now)
    stage.stand(0.6, about_up(90.0))
    assert holds(stage.target(), HANGING)
    assert memory.neutral(SENSOR, "lShldr") is None and stage.wants


def test_upside_down_no_heading_is_reset(evening: Evening) -> None:
    stage = evening()
    stage.stand(2.0, about_up(0.0))
    stage.stand(0.6, about_front(180.0))
    before = stage.target()
    stage.wearing.reset_heading(SENSOR, stage.now)
    stage.stand(0.6, about_front(180.0))
    assert "upside down" in stage.said[-1]
    assert (stage.target() == before).all()


def test_who_asks_for_a_stranger_or_a_silent_sensor_learns_that_nobody_is_asked(evening: Evening) -> None:
    stage = evening()
    with pytest.raises(ValueError, match=r"'left-wirst'.*Did you mean 'left-wrist'\?"):
        stage.wearing.take_neutral("left-wirst", stage.now)
    for asked in (SENSOR, None):
        assert not stage.wearing.take_neutral(asked, stage.now)
        assert not stage.wearing.reset_heading(asked, stage.now)
    assert stage.wearing.neutral_of("left-wirst") == ""
    assert stage.wearing.neutral_of(SENSOR) == "assumed"
    stage.stand(2.0, about_up(40.0))
    stage.silence(0.6)
    before = len(stage.said)
    assert not stage.wearing.take_neutral(SENSOR, stage.now)
    assert not stage.wearing.reset_heading(None, stage.now)
    stage.wearing.look(stage.now)
    assert len(stage.said) == before and not stage.wants


def test_who_is_heard_is_asked_though_another_sensor_is_silent(evening: Evening) -> None:
    stage = evening([HAND, {"sensor": "right-wrist", "joint": "lForeArm"}])
    stage.dance(1.0)
    assert stage.wearing.take_neutral(None, stage.now)
    assert not stage.wearing.take_neutral("right-wrist", stage.now)
    assert stage.parts.link.wants_neutral == {SENSOR}
