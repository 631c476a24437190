"""Gestures in show control: recorded from frames that a stage shares, call cues, and survive a restart."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.keeper.mirror import Mirror
from appliance.keeper.records import mirrored_gestures
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import FrameWriter
from appliance.sensor.gesture_memory import FILE_NAME
from appliance.sensor.gestures import RATE_HZ
from appliance.show_control.command import command
from appliance.show_control.gestures import RECORD_S, Gestures
from appliance.show_control.stage_observer import StageObserver
from tests.logged import said
from tests.outputs.small_stage import facts_of, one_puppet, small
from tools.gestures import made_gestures, repeated

JOINTS = 4
CUES = ({"name": "storm", "fade_s": 1.0}, {"name": "calm", "fade_s": 1.0})


class Hand:
    """A stage whose one hand moves, and show control's gestures beside it."""

    def __init__(self, folder: Path) -> None:
        self.runtime, self.state = folder / "run", folder / "state"
        for one in (self.runtime, self.state):
            one.mkdir(exist_ok=True)
        self.facts = replace(facts_of(small(JOINTS)), cues=CUES)
        self._writer = FrameWriter(self.runtime, self.facts)
        self.frame: JointFrame = one_puppet(JOINTS)
        self.frame.hands = np.zeros((1, 4), np.float32)
        self.called: list[str] = []
        self.said = said
        self.now = time.monotonic()
        self.start()

    def start(self) -> None:
        self._observer = StageObserver(self.runtime)
        self._observer.state(self.now)
        self.gestures = Gestures(
            self.runtime, self.state, self._observer, lambda cue, _: self.called.append(cue)
        )

    def move(self, orientations: np.ndarray[Any, Any]) -> None:
        """At RATE_HZ: two frames of the stage for each."""
        for orientation in orientations:
            for _ in range(round(50 / RATE_HZ)):
                self.frame.tick += 1
                self.now += 0.02
                self.frame.frame_time = self.now
                self.frame.hands[0] = orientation
                self._writer.write(self.frame)
            if self.frame.tick % 10 == 0:
                self.gestures.look(self.now)
        self.gestures.look(self.now)

    def rest(self, orientation: np.ndarray[Any, Any]) -> None:
        self.move(np.tile(orientation, (20, 1)))

    def make(self, name: str, rng: np.random.Generator) -> None:
        """The gesture, between two rests."""
        made = repeated(made_gestures()[name], rng, rng.uniform(0.9, 1.1), rng.uniform(0.95, 1.05))
        self.rest(made[0])
        self.move(made)
        self.rest(made[-1])

    def learned(self) -> dict[str, Any]:
        """What is reported once nothing is being learned any more."""
        while self.gestures._learning is not None:
            time.sleep(0.01)
            self.gestures.look(self.now)
        return self.gestures.reported()

    def close(self) -> None:
        self.gestures.close()
        self._observer.close()
        self._writer.close()


@pytest.fixture
def hand(tmp_path: Path) -> Iterator[Hand]:
    made = Hand(tmp_path)
    yield made
    made.close()


def test_a_gesture_is_recorded_calls_its_cue_and_survives_restart_and_power_cut(hand: Hand) -> None:
    rng = np.random.default_rng(5)
    hand.rest(np.array([1.0, 0.0, 0.0, 0.0]))
    assert "3 times" in hand.gestures.record("lift", "storm", hand.now)
    for count in range(1, 4):
        hand.make("salute", rng)
        if count < 3:
            assert hand.gestures.reported()["recording"] == {"name": "lift", "come": count}
    reported = hand.learned()
    assert reported["recording"] is None and reported["list"] == [
        {"name": "lift", "cue": "storm", "hand": "2"}
    ]
    hand.make("wave", rng)
    assert hand.called == []
    hand.make("salute", rng)
    assert hand.called == ["storm"]

    mirror = Mirror(mirrored_gestures(hand.runtime, hand.state))
    mirror.last_turn(0.0)
    assert (hand.state / FILE_NAME).stat().st_size > 1000
    hand.gestures.rename("lift", "up")
    for is_cut in (False, True):
        hand.gestures.close()
        if is_cut:
            (hand.runtime / FILE_NAME).unlink()
        hand.start()
        hand.gestures.look(hand.now)
        hand.make("salute", rng)
        assert hand.called == ["storm"] * (2 + is_cut)
        assert [one["name"] for one in hand.gestures.reported()["list"]] == ["lift" if is_cut else "up"]
    hand.gestures.forget("lift")
    hand.make("salute", rng)
    assert len(hand.called) == 3


def test_a_gesture_that_is_not_made_is_not_learned(hand: Hand) -> None:
    hand.rest(np.array([1.0, 0.0, 0.0, 0.0]))
    hand.gestures.record("lift", "storm", hand.now)
    hand.now += RECORD_S
    hand.rest(np.array([1.0, 0.0, 0.0, 0.0]))
    assert hand.gestures.reported()["recording"] is None and "none is learned" in hand.gestures.message
    hand.gestures.record("lift", "storm", hand.now)
    assert "not recorded" in hand.gestures.stop() and hand.gestures.reported()["list"] == []


def test_what_no_gesture_can_be(hand: Hand) -> None:
    hand.gestures.look(hand.now)
    with pytest.raises(ValueError, match=r"no cue 'strom'\. Did you mean 'storm'"):
        hand.gestures.record("lift", "strom", hand.now)
    with pytest.raises(ValueError, match="no gesture 'lift'"):
        hand.gestures.forget("lift")
    with pytest.raises(ValueError, match="no gesture 'lift'"):
        hand.gestures.rename("lift", "up")


def test_commands_about_gestures_take_two_names() -> None:
    one = command("/gesture/record", ["lift", "storm"])
    assert (one.text, one.also) == ("lift", "storm")
    for arguments in (["lift"], [], ["lift", ""], ["lift", "storm", 1.0]):
        with pytest.raises(ValueError, match="takes name, cue"):
            command("/gesture/record", arguments)
    with pytest.raises(ValueError, match="takes name"):
        command("/gesture/forget", ["lift", "storm"])
