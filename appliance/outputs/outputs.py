"""All outputs of the stage behind one call: OSC, PosiStageNet, and the frame that other processes read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from appliance.outputs.datagram_sender import DatagramSender
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.posistagenet import PosiStageNet
from appliance.outputs.receivers import OscOutputs
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from appliance.show.box import OutputsConfig


class Outputs:
    """The receivers that the stage sends joint frames to; lights and projector read the shared frame."""

    def __init__(
        self,
        config: OutputsConfig,
        skeleton: Skeleton,
        puppets: Sequence[str] = ("",),
        hands: Sequence[Sequence[str]] = (),
        has_live: bool = False,
    ) -> None:
        """puppets: their names; hands: of each the joints of its hands; has_live: a live dancer may come."""
        hands = hands or [()] * len(puppets)
        self._osc = OscOutputs(config.osc, skeleton, "osc" in config.model_fields_set, hands, has_live)
        self._posistagenet = tuple(PosiStageNet(one, skeleton, puppets) for one in config.posistagenet)
        self.receivers: tuple[DatagramSender, ...] = (*self._osc.receivers, *self._posistagenet)
        self._shared: FrameWriter | None = None
        self.may_speak: Callable[[], bool] | None = None  # asked before each frame, on a box with a pair

    def mute(self, is_muted: bool) -> None:
        """Whether receivers get nothing; the shared frame is written nonetheless."""
        for one in self.receivers:
            one.is_muted = is_muted

    def share(self, shared: FrameWriter) -> None:
        """Write frames to `shared` too, until `close`."""
        self._shared = shared

    def publish_frame(self, frame: JointFrame) -> None:
        """Send a frame to every receiver and share it. Never waits, never raises."""
        if self.may_speak is not None:
            self.mute(not self.may_speak())
        self._osc.send_frame(frame)
        for output in self._posistagenet:
            output.send_frame(frame)
        if self._shared is not None:
            self._shared.write(frame)

    def shift_shared(self, seconds: float) -> None:
        """Frames have times of a clock that is so much behind this machine's."""
        if self._shared is not None:
            self._shared.shift_s = seconds

    def publish_health(self, health: Mapping[str, Any]) -> None:
        """Share how the box is; once a second, after the frame has left."""
        if self._shared is not None:
            self._shared.write_health(health)

    def close(self) -> None:
        """Close the sockets and the shared frame."""
        self._osc.close()
        for output in self._posistagenet:
            output.close()
        if self._shared is not None:
            self._shared.close()
            self._shared = None
