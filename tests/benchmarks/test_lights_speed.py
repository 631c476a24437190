"""The lights' pass: two full universes from one frame, as often as a wire takes them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from appliance.levers.show_state import ShowState
from appliance.levers.table import LIGHTS
from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import default_show_path
from appliance.show.lights import LightsConfig
from appliance.show.show import load_show

GROUP = "lights, one pass: 48 moving heads, 60 LED PARs and 14 RGB lamps on two universes"
RULES = [
    {"reads": "place", "joint": "lHand", "drives": "aim"},
    {"reads": "speed", "joint": "lHand", "drives": "dimmer", "attack_s": 0.1, "release_s": 1.0},
    {"reads": "speed", "drives": "dimmer", "mix": "highest"},
    {"reads": "height", "joint": "head", "drives": "colour", "colours": [[1, 0, 0], [0, 0, 1]]},
    {"reads": "turn", "drives": "zoom"},
]


def full_universe(universe: int) -> list[dict[str, Any]]:
    """24 heads of 12 channels, 30 lamps of 6, 7 of 3: 489 of 512."""
    kinds = [("moving-wash", None, 12, 24), ("led-par", "RGBW", 6, 30), ("rgb", None, 3, 7)]
    fixtures: list[dict[str, Any]] = []
    address = 1
    for profile, mode, width, count in kinds:
        for number in range(count):
            place = [number / 4 - 3, 4, universe]
            one = {"name": f"{profile} {universe} {number}", "profile": profile, "universe": universe}
            fixtures.append({**one, "mode": mode, "address": address, "place": place})
            address += width
    return fixtures


@pytest.mark.parametrize("fading", [False, True], ids=["one mapping", "fading into another"])
def test_pass(measured: Callable[..., Any], fading: bool, request: pytest.FixtureRequest) -> None:
    skeleton = load_show(default_show_path()).skeleton
    values = {
        "fixtures": [*full_universe(1), *full_universe(2)],
        "mappings": [{"name": name, "rules": RULES} for name in ("one", "other")],
    }
    config = LightsConfig.model_validate(values)
    rig = Rig(config, Patch(config.fixtures, None), skeleton)
    rig.safety = 0.0
    show_state = ShowState().to(LIGHTS, "one").to(LIGHTS, "other", 0.0, 1e9) if fading else ShowState()
    frames = itertools.cycle(range(200))
    dance = [_frame(skeleton, number) for number in range(200)]
    clock = itertools.count()

    def one_pass() -> dict[int, bytes]:
        return rig.render(dance[next(frames)], 1, show_state, next(clock) * 0.025)

    levels = measured(request.node.callspec.id, GROUP)(one_pass)
    assert set(levels) == {1, 2}


def _frame(skeleton: Skeleton, number: int) -> JointFrame:
    """A figure that wanders."""
    pose = np.tile(np.array([1, 0, 0, 0], np.float32), (len(skeleton), 1))
    root = np.array([np.sin(number / 30), 0.9, np.cos(number / 30)], np.float32)
    positions, world = skeleton.forward_kinematics(pose, root)
    seconds = number * 0.02
    holds = np.zeros(len(positions), np.float32)
    puppet = PuppetFrame(root, pose, pose, world, positions, holds)
    return JointFrame((puppet,), number, seconds, left=seconds)
