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
        self.speaks_until: Callable[[], float] | None = None  # asked before each frame, on a box with a pair
        self.altered_by: Callable[[JointFrame], JointFrame] | None = None  # what receivers get instead
        self.shift_s = 0.0  # frames have times of a clock that is so much behind this machine's

    def share(self, shared: FrameWriter) -> None:
        """Write frames to `shared` too, until `close`."""
        self._shared = shared

    def publish_frame(self, frame: JointFrame) -> None:
        """Send a frame to every receiver and share it. Never waits, never raises.

        A box that follows another one encodes and shares it nonetheless: its receivers' state goes on.
        """
        if self.altered_by is not None:
            frame = self.altered_by(frame)
        shift_s = self.shift_s  # a box that learns now that it leads no longer has another one after that
        if self.speaks_until is not None:
            until = self.speaks_until()
            for one in self.receivers:
                one.speaks_until = until
        times = frame.frame_time, frame.sensor_arrival
        frame.frame_time, frame.sensor_arrival = (seconds + shift_s for seconds in times)
        self._osc.send_frame(frame)
        for output in self._posistagenet:
            output.send_frame(frame)
        if self._shared is not None:
            self._shared.write(frame)
        frame.frame_time, frame.sensor_arrival = times

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
