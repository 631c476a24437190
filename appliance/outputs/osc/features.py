"""Dialect of what moves, as numbers: see outputs/motion_features.py."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.motion_features import MotionFeatures
from appliance.outputs.osc.template import message, single
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig

_DERIVATIVES = ("velocity", "acceleration", "jerk")


class Features:
    """Velocity, acceleration and jerk (J x x, y, z; metres and seconds), and numbers of the whole body.

    A late frame repeats the numbers before it.
    """

    def __init__(self, skeleton: Skeleton, config: OscConfig | None = None) -> None:
        joints, prefix = len(skeleton), (config or OscConfig()).prefix
        whole = prefix.removesuffix("/joint")
        self._features = MotionFeatures(joints)
        lists = [message(f"{prefix}/{name}", floats=3 * joints) for name in _DERIVATIVES]
        numbers = self._features.numbers.items()
        self._template = single(
            [*lists, *(message(f"{whole}/{name}", floats=len(values)) for name, values in numbers)]
        )

    def encode(self, frame: JointFrame, puppet: PuppetFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        features, template = self._features, self._template
        if not frame.late and features.take_frame(puppet.positions, frame.frame_time):
            for values, place in zip(
                [*features.derived, *features.numbers.values()], template.places, strict=True
            ):
                template.numbers[place] = values.ravel()
        return template.datagrams
