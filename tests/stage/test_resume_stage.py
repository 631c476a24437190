"""The whole stage notes its place, and the next one goes on there unless the show was ended."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.box.checkpoint import CheckpointReader, boot_id
from appliance.box.clock import TICK_S, Slot
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, PHRASE
from appliance.show.box import BoxConfig
from appliance.show.show import Show
from appliance.stage.run import Stage
from tests.stage.places import PLACE, declare, put
from tests.stage.shows import NOW
from tests.standing import moved


@pytest.fixture
def show(walking_show: Show) -> Show:
    return walking_show


def test_the_whole_stage_goes_on_where_it_was(show: Show, box: BoxConfig) -> None:
    stage = Stage(show, box, lambda message: None)
    with closing(stage), pytest.raises(ZeroDivisionError):
        stage.dance(None, lambda: stage.parts.led.motion.position_s > 0.3 and bool(1 / 0))  # late ticks stand
    was_at_s = stage.parts.led.motion.position_s
    said: list[str] = []
    again = Stage(show, box, said.append)
    with closing(again):
        assert again.parts.led.motion.position_s == pytest.approx(was_at_s, abs=1e-3)
        assert any("After a restart of the stage the show goes on at" in message for message in said)
        # The figure stands where it stood: no step through the room.
        np.testing.assert_allclose(
            again.tick.frame.puppets[0].root, stage.tick.frame.puppets[0].root, atol=0.02
        )
        again.dance(0.1, lambda: False)
    fresh = Stage(show, box, said.append)  # that one ended as it should
    with closing(fresh):
        assert fresh.parts.led.motion.position_s == 0.0
        assert not fresh.resuming.went_on


def test_a_place_goes_before_what_was_declared_before_it(show: Show, box: BoxConfig, runtime: Path) -> None:
    """The cue was called, and another part of the phrase after it."""
    declared = ShowState(show="A test").to(CUE, "storm", NOW).to(PHRASE, "walk", NOW)
    declare(runtime, declared)
    place = moved(PLACE, excerpt=(1.0, 3.0), cue="storm", applied=declared.generation, boot=boot_id())
    put(runtime, place)
    with closing(Stage(show, box, lambda message: None)) as stage:
        assert (stage.reconciler.cue, stage.parts.led.motion.phrase) == ("storm", "walk")
        assert stage.parts.led.motion.position_s == pytest.approx(2.0, abs=1e-3)
        stage.dance(0.1, lambda: False)
        assert stage.parts.led.motion.excerpt_s == (1.0, 3.0)


def test_slots_are_not_needed_to_know_the_place(runtime: Path, show: Show, box: BoxConfig) -> None:
    """A late tick does not dance: the phrase stands, and so does its place."""
    stage = Stage(show, box, lambda message: None)
    with closing(stage):
        for number in range(3):
            slot = Slot(number, 10.0 + number * TICK_S, 10.019 + number * TICK_S)
            stage.tick.run(slot)
            stage._note(slot)
        with closing(CheckpointReader(runtime)) as reader:
            place = reader.read()
    assert place is not None and (place.tick, place.puppets[0].position_s) == (2, 0.0)
