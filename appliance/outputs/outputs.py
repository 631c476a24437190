"""All outputs of the stage behind one call: OSC, PosiStageNet, and the frame that other processes read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.posistagenet import PosiStageNet
from appliance.outputs.receivers import OscOutputs
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from appliance.show.box import OutputsConfig


class Receiver(Protocol):
    """Somebody in the network who gets the dance."""

    @property
    def name(self) -> str:
        """How to call it in front of people."""

    @property
    def sent(self) -> int:
        """Datagrams handed to the network."""

    @property
    def dropped(self) -> int:
        """Datagrams that were not."""

    @property
    def last_error(self) -> str:
        """Why the last one was dropped; stays after the receiver is back."""


class Outputs:
    """Everybody who gets joint frames from the stage itself; lights and projector read the shared frame."""

    def __init__(self, config: OutputsConfig, skeleton: Skeleton) -> None:
        self._osc = OscOutputs(config.osc, skeleton)
        self._posistagenet = tuple(PosiStageNet(one, skeleton) for one in config.posistagenet)
        self.receivers: tuple[Receiver, ...] = (*self._osc.receivers, *self._posistagenet)
        self._shared: FrameWriter | None = None

    def share(self, shared: FrameWriter) -> None:
        """Write frames there too, from now on until `close`."""
        self._shared = shared

    def send(self, frame: JointFrame) -> None:
        """One frame to everyone. Never waits, never raises: receivers count what they do not get."""
        self._osc.send(frame)
        for output in self._posistagenet:
            output.send(frame)
        if self._shared is not None:
            self._shared.write(frame)

    def tell(self, health: Mapping[str, Any]) -> None:
        """How the box is, for whoever reads the shared frame; once a second, after the frame has left."""
        if self._shared is not None:
            self._shared.write_health(health)

    def close(self) -> None:
        """Close sockets and the shared frame; nothing may be sent afterwards."""
        self._osc.close()
        for output in self._posistagenet:
            output.close()
        if self._shared is not None:
            self._shared.close()
            self._shared = None
