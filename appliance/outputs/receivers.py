"""Receivers by OSC: joint frames out as UDP datagrams; what cannot be sent at once is dropped and counted."""

from __future__ import annotations

import socket
from collections.abc import Sequence

from appliance.outputs.datagram_sender import PASSING, DatagramPath, in_words
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.dialects import DIALECTS, Encoder
from appliance.outputs.osc.frame_message import FrameMessage
from appliance.pose.skeleton import Skeleton
from appliance.show.box import OscConfig

FIRST_PAUSE_FRAMES = 5  # 0.1 s
LONGEST_PAUSE_FRAMES = 50  # 1 s: a receiver that comes back sees the dancer again within it


class OscOutputs:
    """All OSC receivers of a box. Each dialect is encoded once a frame, however many receivers speak it."""

    def __init__(self, receivers: Sequence[OscConfig], skeleton: Skeleton) -> None:
        dialects = sorted({config.dialect for config in receivers})
        self._encoders: list[Encoder] = [DIALECTS[dialect](skeleton) for dialect in dialects]
        self._frame_message = FrameMessage() if any(config.frame_message for config in receivers) else None
        self.receivers = tuple(OscReceiver(config) for config in receivers)
        self._audiences = [
            [receiver for receiver in self.receivers if receiver.config.dialect == dialect]
            for dialect in dialects
        ]

    def send(self, frame: JointFrame) -> None:
        """One frame to everyone. Never waits, never raises: receivers count what they do not get."""
        mark = self._frame_message.encode(frame) if self._frame_message else ()
        for encoder, audience in zip(self._encoders, self._audiences, strict=True):
            datagrams = encoder.encode(frame)
            for receiver in audience:
                receiver.send(mark if receiver.config.frame_message else (), datagrams)

    def close(self) -> None:
        """Close all sockets; nothing may be sent afterwards."""
        for receiver in self.receivers:
            receiver.close()


class OscReceiver:
    """One receiver with a socket of its own.

    Its own, because the datagrams that wait for a machine that is switched off (address resolution, 3 s)
    fill a socket's buffer: with one socket for all, two such machines cost the others 85 % of their frames.
    Connected, because only then does Linux say that nobody listens there.
    """

    def __init__(self, config: OscConfig) -> None:
        self.config = config
        self._path = DatagramPath(config.host, config.port, broadcast=True)
        self.sent = 0  # datagrams handed to the network
        self.dropped = 0  # datagrams that were not
        self.last_error = ""  # why the last one was dropped; stays after the receiver is back
        self._socket: socket.socket | None = None
        self._pause_frames = FIRST_PAUSE_FRAMES
        self._frames_to_wait = 0
        self._frames_well = 0

    @property
    def name(self) -> str:
        """How to call it in front of people: address, port, dialect."""
        return f"{self.config.host}:{self.config.port} ({self.config.dialect})"

    @property
    def is_paused(self) -> bool:
        """Whether it failed and the next try is still to come."""
        return self._frames_to_wait > 0

    def send(self, *groups: Sequence[memoryview]) -> None:
        """Send the groups' datagrams in order, or drop them; never waits and never raises OSError."""
        if self._frames_to_wait > 0:
            self._frames_to_wait -= 1
            self.dropped += sum(map(len, groups))
            return
        sent_before, due = self.sent, sum(map(len, groups))
        try:
            connection = self._socket = self._socket or self._path.open()
            for datagrams in groups:
                for datagram in datagrams:
                    connection.send(datagram)
                    self.sent += 1
            self._count_well()
        except OSError as error:
            self.dropped += due - (self.sent - sent_before)
            self.last_error = in_words(error)
            if error.errno not in PASSING:
                self._back_off()

    def close(self) -> None:
        """Close the socket."""
        if self._socket:
            self._socket.close()
        self._socket = None

    def _count_well(self) -> None:
        """Only a good while makes up for a failure: a refusal comes back after the datagram that it means."""
        self._frames_well += 1
        if self._frames_well >= LONGEST_PAUSE_FRAMES:
            self._pause_frames = FIRST_PAUSE_FRAMES

    def _back_off(self) -> None:
        self.close()
        self._frames_well = 0
        self._frames_to_wait = self._pause_frames
        self._pause_frames = min(2 * self._pause_frames, LONGEST_PAUSE_FRAMES)
