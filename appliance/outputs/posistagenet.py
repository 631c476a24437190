"""PosiStageNet out: chosen joints as trackers for media servers and followspots (posistage.net)."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.outputs.axes import turn_of
from appliance.outputs.datagram_sender import DatagramPath, DatagramSender
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.posistagenet_packets import DataPackets, InfoPackets
from appliance.pose.skeleton import Skeleton
from appliance.show.posistagenet import PosiStageNetConfig

INFO_PERIOD_S = 1.0


class PosiStageNet(DatagramSender):
    """One receiver: data packets for every n-th joint frame, and the names once a second.

    A late frame repeats positions and speeds: the box stopped, not the dancer.
    """

    def __init__(
        self, config: PosiStageNetConfig, skeleton: Skeleton, puppets: Sequence[str] = ("",)
    ) -> None:
        """puppets: their names. Trackers have it before the joint's, but for those of puppet 0."""
        # Only multicast needs its interface named: the kernel knows the route to a single receiver.
        interface = config.interface if ipaddress.IPv4Address(config.host).is_multicast else None
        path = DatagramPath(config.host, config.port, interface)
        super().__init__(f"{config.host}:{config.port} (posistagenet)", path)
        names = tuple(config.joints) or skeleton.names
        self._joints = np.array([skeleton.names.index(name) for name in names])
        names += tuple(f"{puppet} {name}" for puppet in puppets[1:] for name in names)
        numbers = range(config.first_tracker, config.first_tracker + len(names))
        self._data = DataPackets(numbers, config.speed)
        self._info = InfoPackets(config.system_name, dict(zip(numbers, names, strict=True)))
        self._turn = turn_of(config.axes) * np.float32(config.scale)
        self._offset = np.array(config.offset, np.float32)
        self._taken, self._positions, self._before, self._speeds = np.zeros((4, len(names), 3), np.float32)
        self._taken_of = self._taken.reshape(len(puppets), -1, 3)
        self._with_speed = config.speed
        self._every, self._frames = config.every, 0
        self._started: float | None = None
        self._time_before = self._next_info = 0.0

    def send_frame(self, frame: JointFrame) -> None:
        """Send this frame, if it is an n-th one. Never waits, never raises."""
        is_due = self._frames % self._every == 0
        self._frames += 1
        if is_due:
            self.send_datagrams(self.encode(frame), frame.frame_time)

    def encode(self, frame: JointFrame) -> Sequence[memoryview]:
        """Datagrams of this frame, the same buffers each time; once a second the names first."""
        if self._started is None:
            self._started = self._next_info = self._time_before = frame.frame_time
            self._place(frame, self._before)
        self._place(frame, self._positions)
        if self._with_speed:
            self._note_speeds(frame)
        self._data.fill(self._positions, self._speeds)
        time_us = round(1e6 * (frame.frame_time - self._started))
        if frame.frame_time < self._next_info:
            return self._data.stamped(time_us)
        self._next_info = frame.frame_time + INFO_PERIOD_S
        return (*self._info.stamped(time_us), *self._data.stamped(time_us))

    def _place(self, frame: JointFrame, out: NDArray[np.float32]) -> None:
        """Positions of the trackers, (T, 3), in the receiver's axes and units."""
        for puppet, taken in zip(frame.puppets, self._taken_of, strict=True):
            np.take(puppet.positions, self._joints, axis=0, out=taken)
        np.matmul(self._taken, self._turn, out=out)
        np.add(out, self._offset, out=out)

    def _note_speeds(self, frame: JointFrame) -> None:
        """The trackers' movement since the last frame that was not late, a second."""
        passed_s = frame.frame_time - self._time_before
        if frame.late or passed_s <= 0.0:
            return
        np.subtract(self._positions, self._before, out=self._speeds)
        np.divide(self._speeds, passed_s, out=self._speeds)
        self._before[...] = self._positions
        self._time_before = frame.frame_time
