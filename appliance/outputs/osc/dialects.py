"""The OSC dialects by the names that the box file knows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.osc.ai_toolbox import AiToolbox
from appliance.outputs.osc.features import Features
from appliance.outputs.osc.joint import Joint
from appliance.outputs.osc.vmc import Vmc
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig


class Encoder(Protocol):
    """Turns the frames of one puppet into datagrams, always into the same buffers."""

    def encode(self, frame: JointFrame, puppet: PuppetFrame) -> Sequence[memoryview]:
        """Datagrams of this puppet in this frame, valid until the next call."""
        ...


# From a skeleton and a receiver: the dialect for the puppet with this number in its addresses.
DIALECTS: dict[str, Callable[[Skeleton, OscConfig, int], Encoder]] = {
    "ai-toolbox": lambda skeleton, config, _: AiToolbox(skeleton, config),
    "features": lambda skeleton, config, _: Features(skeleton, config),
    "joint": lambda skeleton, _, puppet: Joint(skeleton, puppet),
    "vmc": lambda skeleton, _, __: Vmc(skeleton),
}
