"""One tick: readings in, puppet, blending, joints out. The whole of it, in the order in which data flows."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.box.clock import Slot
from appliance.box.live_pose import LivePose
from appliance.outputs.joint_frame import JointFrame
from appliance.recorder.record import SECTIONS
from appliance.sensor.link import SensorReading
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.stage_parts import StageParts

_STANDING = ("pose", "world", "positions", "root")  # arrays of a frame
DRAIN, MOTION, HANDS, PUPPET, BLEND, FIGURE, SEND = range(len(SECTIONS))


class Tick:
    """Runs the stage's parts once a slot. Nothing here waits, logs, or allocates for the collector.

    A tick that starts so late that its frame could not leave in time does not dance: it sends the last pose
    again, marked late. The phrase stands still meanwhile, so nothing is jumped over and nothing is replayed.
    Where the network gives no sound poses, the last good pose stays.
    """

    def __init__(
        self,
        parts: StageParts,
        wearing: SensorFit,
        iterations: Iterations,
        latest_start_s: float,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.parts = parts
        self.wearing = wearing
        self.iterations = iterations
        self.latest_start_s = latest_start_s
        self.frame = JointFrame(len(parts.skeleton))
        self._whole, self._roots = parts.motion.window(), parts.motion.roots()
        self._danced = self._whole[0].copy()  # (J, 4), not yet grounded
        self.network_failed = False
        self.readings: Sequence[SensorReading] = ()
        self.live_heard: LivePose | None = None
        self.sections_ms: NDArray[np.float32] = np.zeros(len(SECTIONS), np.float32)
        self._section_ends = [0.0] * len(SECTIONS)
        self._monotonic = monotonic
        self._stand()

    def run(self, slot: Slot) -> None:
        """Everything from the sensors' datagrams to the receivers'."""
        parts, frame, ends, now = self.parts, self.frame, self._section_ends, self._monotonic
        frame.tick, frame.frame_time = slot.tick, slot.deadline
        frame.late = slot.lateness_s > self.latest_start_s

        self.readings = parts.link.drain(slot.started)
        for reading in self.readings:
            self.wearing.hear(reading)
            parts.hear(reading)
        self.live_heard = parts.hear_live()
        ends[DRAIN] = ends[MOTION] = ends[HANDS] = ends[PUPPET] = ends[BLEND] = ends[FIGURE] = now()

        if not frame.late:
            self._whole, self._roots = parts.starts_from(slot.started)
            window = parts.puppet.select(self._whole)
            ends[MOTION] = now()
            parts.hands.pull(slot.started, window)
            ends[HANDS] = now()
            if parts.blending.is_due:
                self._regenerate(window)
            ends[PUPPET] = now()
            if not self.network_failed:
                self._danced[:] = self._whole[0]
                parts.puppet.restore(parts.blending.take(), self._danced)
            ends[BLEND] = now()
            self._stand()
            ends[FIGURE] = now()

        parts.outputs.publish_frame(frame)
        ends[SEND] = now()

    def warm_up(self) -> None:
        """One pass over the last window, right before the deadline; its poses go nowhere.

        In 18 ms of pause the caches cool down: ten iterations of the default then took 1.45 ms (p50) and 2.1
        (p99), after this 1.1 and 1.5, against 0.87 and 1.3 back to back.
        """
        parts, hands = self.parts, self.parts.hands
        if parts.blending.is_due:
            window = parts.puppet.select(parts.motion.window())
            parts.puppet.dance(window, hands.mask, hands.targets, hands.weights, 1, 0)

    def after(self, slot: Slot) -> float:
        """What can wait until the frame has left: the motion moves on, sensors are answered and looked at,
        times are noted. The cost of what came before, in ms.
        """
        if not self.frame.late:
            self.parts.motion.advance()
            self.iterations.advance()
        self.parts.link.send_due(self._monotonic())
        self.wearing.look(slot.started)
        begin = slot.started
        for section, end in enumerate(self._section_ends):
            self.sections_ms[section] = 1000.0 * (end - begin)
            begin = end
        return 1000.0 * (begin - slot.started)

    def state(self) -> dict[str, Any]:
        """All that the frames to come depend on, beside readings and slots, for `restore`: plain values and
        copies of arrays.
        """
        frame = self.frame
        return {
            "parts": self.parts.state(),
            "wearing": self.wearing.state(),
            "iterations": self.iterations.state(),
            "latest_start_s": self.latest_start_s,
            "network_failed": self.network_failed,
            "danced": self._danced.copy(),
            "frame": {name: getattr(frame, name).copy() for name in _STANDING},
            "sensor": [frame.sensor_sequence, frame.sensor_arrival],
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on as the tick of the same show did that gave this state."""
        frame = self.frame
        self.parts.restore(state["parts"])
        self.wearing.restore(state["wearing"])
        self.iterations.restore(state["iterations"])
        self.latest_start_s, self.network_failed = state["latest_start_s"], state["network_failed"]
        self._danced[:] = state["danced"]
        for name in _STANDING:
            getattr(frame, name)[:] = state["frame"][name]
        frame.sensor_sequence, frame.sensor_arrival = state["sensor"]

    def _regenerate(self, window: NDArray[np.float32]) -> None:
        """Let the puppet dance a window and blend it in; the frame names the reading that went into it."""
        parts, frame, hands, times = self.parts, self.frame, self.parts.hands, self.iterations
        poses = parts.puppet.dance(
            window, hands.mask, hands.targets, hands.weights, times.coding, times.interaction
        )
        self.network_failed = parts.puppet.is_broken
        if not self.network_failed:
            parts.blending.add(poses)
        if parts.newest_primary is not None:
            frame.sensor_sequence = parts.newest_primary.sequence
            frame.sensor_arrival = parts.newest_primary.arrival

    def _stand(self) -> None:
        """Put the danced pose on the floor and into the world."""
        parts, frame, motion = self.parts, self.frame, self.parts.motion
        parts.puppet.restore(parts.hands.weights, frame.holds)
        figure = parts.grounding.ground_pose(
            self._danced,
            self._roots[0],
            parts.lift,
            motion.rest_heights,
            frame.holds,
        )
        frame.pose[:] = parts.grounding.pose
        frame.world[:] = figure.world
        frame.positions[:] = figure.positions
        frame.root[:] = parts.grounding.root
