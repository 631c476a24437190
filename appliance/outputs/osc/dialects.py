"""The OSC dialects by the names that the box file knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, Protocol

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


class Addressed(NamedTuple):
    """A puppet as a receiver gets it. number: in its addresses; hands: their joints by their rows in the
    frame; has_live: a live dancer is told of with this puppet.
    """

    number: int = 0
    hands: Mapping[int, str] = MappingProxyType({})
    has_live: bool = False


# From a skeleton, a receiver and a puppet.
DIALECTS: dict[str, Callable[[Skeleton, OscConfig, Addressed], Encoder]] = {
    "ai-toolbox": lambda skeleton, config, _: AiToolbox(skeleton, config),
    "features": lambda skeleton, config, one: Features(skeleton, config, one.hands, one.number, one.has_live),
    "joint": lambda skeleton, _, one: Joint(skeleton, one.number),
    "vmc": lambda skeleton, _, __: Vmc(skeleton),
}
