"""Small rigs for the lights' tests, and frames of a dance that a test makes up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.show.lights import LightsConfig

SKELETON = Skeleton(("hip", "hand"), (-1, 0), np.array([[0, 0, 0], [0, 1, 0]], float))
PERIOD_S = 0.02


def frame(
    tick: int,
    hand: Sequence[float] = (0.0, 1.0, 0.0),
    hip: Sequence[float] = (0.0, 1.0, 0.0),
    turned: Any = quaternion.IDENTITY,
    late: bool = False,
) -> JointFrame:
    """A frame at tick * 20 ms; `turned` is the hand's orientation (w, x, y, z) in the world."""
    world = np.array([quaternion.IDENTITY, turned], np.float32)
    puppet = PuppetFrame(
        root=np.array(hip, np.float32),
        pose=world.copy(),
        source=world.copy(),
        world=world,
        positions=np.array([hip, hand], np.float32),
        holds=np.zeros(2, np.float32),
    )
    return JointFrame((puppet,), tick, tick * PERIOD_S, late, left=tick * PERIOD_S)


def lights(
    fixtures: Sequence[Mapping[str, Any]],
    *rules: Mapping[str, Any],
    safe: Mapping[str, Any] | None = None,
    **mappings: Sequence[Mapping[str, Any]],
) -> LightsConfig:
    """A show's lights; `rules` are those of its first mapping, called `first`."""
    sets = [{"name": "first", "rules": list(rules)}]
    sets += [{"name": name, "rules": list(more)} for name, more in mappings.items()]
    return LightsConfig.model_validate(
        {"fixtures": list(fixtures), "mappings": sets, "safe": safe or {}}, context={"joints": SKELETON.names}
    )


def rig(config: LightsConfig) -> Rig:
    """Its rig, already in the dance: not in the safe look in which each rig begins."""
    made = Rig(config, Patch(config.fixtures, None), SKELETON)
    made.safety = 0.0
    return made
