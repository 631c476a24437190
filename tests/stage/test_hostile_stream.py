"""A live dancer's program that sends whatever numbers there are: the figure stays one, and goes on."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import numpy as np

from appliance.box.live_pose import LivePoseReader
from appliance.levers.sources import LIVE
from appliance.show_control.live_input import POSITIONS, ROTATIONS, LiveInput
from appliance.show_control.vmc_input import BONE, ROOT
from appliance.stage.sharing import facts_of
from tests.bundles import FIGURE, write_show
from tests.recorder.night import Night

BONES = ("Hips", "Chest", "LeftUpperArm", "LeftLowerArm", "LeftFoot", "nobody's")
NUMBERS = (0.0, 0.3, -0.7, 1.0, -1.0, 30.0, -900.0, 1e4, 1e30, -3.5e38, 1e300, float("inf"), float("nan"))
ROTATIONS_OF_BONES = ((0.0, 0.0, 0.0, 1.0), (0.6, 0.0, 0.8, 0.0), (0.0, 0.0, 0.0, 0.0), (0.0, 1.04, 0.0, 0.0))


def some_message(rng: random.Random) -> tuple[str, list[object]]:
    """One that may be well, or have numbers of any size in some places."""
    address = rng.choice([BONE] * 6 + [ROOT, ROTATIONS, POSITIONS])
    if address in (BONE, ROOT):
        numbers = [rng.choice(NUMBERS[:7]) for _ in range(3)] + [*rng.choice(ROTATIONS_OF_BONES)]
        values: list[object] = [rng.choice(BONES), *numbers]
    else:
        values = [0.5] * ((4 if address == ROTATIONS else 3) * len(FIGURE))
    if rng.random() < 0.2:
        values[rng.randrange(1, len(values))] = rng.choice(NUMBERS)
    return address, values


def test_whatever_a_live_stream_sends_no_frame_is_impossible(tmp_path: Path, rng: random.Random) -> None:
    show = write_show(tmp_path / "show", hands=[], motion={"live": True})
    night = Night(show, tmp_path / "runtime")
    facts = facts_of(night.show, None, night.parts.led.iterations, 0.0)
    first, heard = night.parts.led, 0
    with contextlib.closing(LiveInput(tmp_path / "runtime")) as live:
        night.parts.live_inbox = LivePoseReader(tmp_path / "runtime")
        night.command("/phrase", 0.0, text=LIVE)
        before = first.frame.positions.copy()
        for _ in range(1500):
            for _ in range(4):
                with contextlib.suppress(ValueError):
                    live.hear(*some_message(rng), facts, night.slot.deadline + 0.019)
            night.dance(1)
            heard += night.tick.live_heard is not None
            for numbers in (first.frame.positions, first.frame.pose, first.frame.world, first.frame.root):
                assert np.isfinite(numbers).all()
            assert np.abs(first.frame.positions[0] - before[0]).max() < 2.0  # it is turned upside down
            before = first.frame.positions.copy()
    assert heard > 200
    assert first.figures_refused == 0
