"""Dialect of what moves, as numbers: see outputs/motion_features.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.motion_features import Floats, MotionFeatures, TurnFeatures
from appliance.outputs.osc.template import address_part, message, single
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig

BUNRAKU = "/bunraku"
_DERIVATIVES = ("velocity", "acceleration", "jerk")


class Features:
    """Velocity, acceleration and jerk (J x x, y, z; metres and seconds), and numbers of the whole body; of
    each hand the same of its turns, and of a live dancer the same as of a puppet.

    A late frame repeats the numbers before it. Nothing is sent of a live dancer who is not there.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        config: OscConfig | None = None,
        hands: Mapping[int, str] | None = None,
        number: int = 0,
        has_live: bool = False,
    ) -> None:
        """hands: their joints by their rows in the frame; number: the puppet's, in its hands' addresses;
        has_live: a live dancer's features come too.
        """
        joints, prefix = len(skeleton), (config or OscConfig()).prefix
        of_hands = f"{BUNRAKU}/{number}/hand" if number else f"{BUNRAKU}/hand"
        self._body = _Told(MotionFeatures(joints), prefix, prefix.removesuffix("/joint"))
        self._hands = {
            row: _Told(TurnFeatures(), *[f"{of_hands}/{address_part(name)}"] * 2)
            for row, name in (hands or {}).items()
        }
        self._live = _Told(MotionFeatures(joints), *[f"{BUNRAKU}/live"] * 2) if has_live else None

    def encode(self, frame: JointFrame, puppet: PuppetFrame) -> Sequence[memoryview]:
        """Datagrams of this frame; the same buffers each time."""
        found = self._body.datagrams(puppet.positions, frame)
        for row, reported in self._hands.items():
            found = (*found, *reported.datagrams(frame.hands[row], frame))
        if self._live is not None and frame.live.any():
            found = (*found, *self._live.datagrams(frame.live, frame))
        return found


class _Told:
    """Features of one thing that moves, and their messages."""

    def __init__(self, features: MotionFeatures | TurnFeatures, lists: str, numbers: str) -> None:
        self._features = features
        count = features.derived[0].size
        self._template = single(
            [
                *(message(f"{lists}/{name}", floats=count) for name in _DERIVATIVES),
                *(
                    message(f"{numbers}/{name}", floats=len(values))
                    for name, values in features.numbers.items()
                ),
            ]
        )

    def datagrams(self, moving: Floats, frame: JointFrame) -> tuple[memoryview, ...]:
        features, template = self._features, self._template
        if not frame.late and features.take_frame(moving, frame.frame_time):
            values = (*features.derived, *features.numbers.values())
            for one, place in zip(values, template.places, strict=True):
                template.numbers[place] = one.ravel()
        return template.datagrams
