"""The whole stage follows the show state of its runtime folder, within a tick and without garbage."""

from __future__ import annotations

import gc
import time
from contextlib import closing

from appliance.box.checkpoint import CheckpointReader
from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, PHRASE, RATE
from appliance.outputs.frame_reader import FrameReader
from appliance.show.box import BoxConfig
from appliance.show.show import Show
from appliance.stage.run import Stage
from tests.stage.shows import NOW


def test_the_stage_begins_with_the_show_state_of_its_folder(show: Show, box: BoxConfig) -> None:
    for cue, phrase in (("storm", "slow"), ("", "main")):
        with closing(ShowStateWriter(box.runtime)) as writer:
            declared = ShowState(show="A test")
            writer.write(declared.to(CUE, cue, NOW).to(PHRASE, phrase, NOW) if cue else declared)
        said: list[str] = []
        stage = Stage(show, box, said.append)
        with closing(stage):
            stage.dance(0.1, lambda: False)
            assert (stage.reconciler.cue, stage.parts.led.motion.phrase) == (cue, phrase)
        assert any("goes on in the cue 'storm'" in message for message in said) == (cue == "storm")


def test_the_dance_follows_within_a_tick_reports_it_and_notes_it_before(show: Show, box: BoxConfig) -> None:
    with (
        closing(ShowStateWriter(box.runtime)) as writer,
        closing(Stage(show, box, print)) as stage,
        closing(CheckpointReader(box.runtime)) as checkpoint,
        closing(FrameReader(box.runtime)) as frames,
    ):
        declared = ShowState(show="A test").to(CUE, "storm", NOW).to(PHRASE, "slow", NOW, 1.0)
        ticks: list[int] = []

        def follows() -> bool:
            """The stage asks this before each tick."""
            ticks.append(stage.health.ticks)
            if len(ticks) == 2:
                writer.write(declared)
            return len(ticks) == 4

        stage.dance(None, follows)
        frames.state(time.monotonic())
        health, place = frames.health(), checkpoint.read()
        assert health is not None and place is not None
        assert health["applied"] == [declared.generation, ""]
        assert health["cue"] == place.cue == "storm"
        assert (place.puppets[0].phrase, place.applied) == ("slow", declared.generation)
        reads = [stage.reconciler.pending(time.monotonic()) for _ in range(100)]
        assert reads == [[]] * 100


def test_an_unchanged_show_state_leaves_nothing_to_the_collector(show: Show, box: BoxConfig) -> None:
    with closing(ShowStateWriter(box.runtime)) as writer, closing(Stage(show, box, print)) as stage:
        writer.write(ShowState(show="A test").to(RATE, 1.0, NOW))
        stage.reconciler.pending(NOW)
        gc.collect()
        gc.disable()
        before = gc.get_count()[0]
        for _ in range(100):
            stage.reconciler.pending(NOW)
        grown = gc.get_count()[0] - before
        gc.enable()
    assert grown < 20
