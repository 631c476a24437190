"""One tick: readings in, puppets, blending, joints out. The whole of it, in the order in which data flows."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from appliance.box.clock import Slot
from appliance.box.live_pose import LivePose
from appliance.dancer.puppeteers import HOLD_S
from appliance.outputs.joint_frame import JointFrame
from appliance.recorder.record import SECTIONS
from appliance.sensor.link import SensorReading
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.stage_parts import StageParts

_SPARE_S = 0.001  # left at the end of a wait, beside the cost of the slowest tick
_FADES = 0.999  # a slow tick is remembered for some 10 s
DRAIN, MOTION, HANDS, PUPPET, BLEND, FIGURE, SEND = range(len(SECTIONS))


class Tick:
    """Runs the stage's parts once a slot. Nothing here logs, or allocates for the collector; it waits only
    for a late reading of the primary sensor, late_look_s at the longest.

    A tick that starts so late that its frame could not leave in time does not dance: it sends the last pose
    again, marked late. The phrase stands still meanwhile, so nothing is jumped over and nothing is replayed.
    Where the network gives no sound poses, the last good pose stays.
    """

    SNAPSHOT = ("parts", "wearing", "latest_start_s", "frame")

    def __init__(
        self,
        parts: StageParts,
        wearing: SensorFit,
        latest_start_s: float,
        late_look_s: float = 0.0,
        late_s: float = math.inf,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """late_look_s: how long a tick waits for a late reading of the primary sensor; 0: not at all.

        late_s: a frame that leaves this long after its deadline is late.
        """
        self.parts = parts
        self.wearing = wearing
        self.latest_start_s, self.late_look_s = latest_start_s, late_look_s
        self.late_s = late_s
        self.waited_s = 0.0  # for a late reading, in this tick
        self._slowest_s = 0.0  # cost of the slowest tick lately
        hands = sum(len(one.hands.puppeteers) for one in parts.puppets)
        joints = 0 if parts.live_figure is None else len(parts.skeleton)
        self.frame = JointFrame(
            tuple(one.frame for one in parts.puppets),
            hands=np.zeros((hands, 4), np.float32),
            live=np.zeros((joints, 3), np.float32),
        )
        self.late = False  # in this slot the last poses were sent again
        self.readings: Sequence[SensorReading] = ()
        self.live_heard: LivePose | None = None
        self.sections_ms: NDArray[np.float32] = np.zeros(len(SECTIONS), np.float32)
        self._section_ends = [0.0] * len(SECTIONS)
        self._monotonic = monotonic
        for puppet in parts.puppets:
            puppet.stand()

    @property
    def network_failed(self) -> bool:
        """Whether the network gave a puppet no sound poses."""
        return any(one.network_failed for one in self.parts.puppets)

    def run(self, slot: Slot) -> None:
        """Everything from the sensors' datagrams to the receivers'."""
        parts, ends, now = self.parts, self._section_ends, self._monotonic
        self.late = slot.lateness_s > self.latest_start_s
        frame = self.frame
        frame.tick, frame.frame_time, frame.late = slot.tick, slot.deadline, self.late

        self.readings = parts.link.drain(slot.started)
        self.waited_s = 0.0
        self.live_heard = parts.hear_live()
        ends[DRAIN] = ends[MOTION] = ends[HANDS] = ends[PUPPET] = ends[BLEND] = ends[FIGURE] = now()

        if not self.late:
            for puppet in parts.puppets:
                puppet.start(slot.started)
            if parts.continuing is not None:
                parts.continuing.lay_over(slot.tick, slot.started, parts.liveliness.seed)
            ends[MOTION] = now()
            parts.liveliness.dance(slot.tick)
            self._look_again(slot)
        for reading in self.readings:
            self.wearing.hear(reading)
            parts.hear(reading)
        if not self.late:
            for puppet in parts.puppets:
                puppet.pull(slot.started)
            parts.point_hands(frame.hands)
            parts.show_live(slot.started, frame.live)
            ends[HANDS] = now()
            if parts.are_due:
                parts.network.dance()
                self._name_reading()
            ends[PUPPET] = now()
            for puppet in parts.puppets:
                puppet.blend()
            ends[BLEND] = now()
            if parts.space is not None:
                parts.space.keep()
            for puppet in parts.puppets:
                puppet.stand()
            if parts.continuing is not None:
                parts.continuing.watch()
            ends[FIGURE] = now()

        parts.outputs.publish_frame(frame)
        ends[SEND] = now()

    def warm_up(self) -> None:
        """One pass over the last windows, right before the deadline; its poses go nowhere.

        In 18 ms of pause the caches cool down: ten iterations of the default then took 1.45 ms (p50) and 2.1
        (p99), after this 1.1 and 1.5, against 0.87 and 1.3 back to back.
        """
        if self.parts.are_due:
            self.parts.network.warm_up()

    def after(self, slot: Slot) -> float:
        """Work that can wait until the frame has left: the motion moves on, sensors are answered and looked
        at, times are noted. The cost of what came before, in ms, without the wait for a late reading.
        """
        if not self.late:
            for puppet in self.parts.puppets:
                puppet.advance()
            self.parts.liveliness.advance()
        self.parts.link.send_due(self._monotonic())
        self.wearing.look(slot.started)
        begin = slot.started
        for section, end in enumerate(self._section_ends):
            self.sections_ms[section] = 1000.0 * (end - begin)
            begin = end
        self.sections_ms[HANDS] -= 1000.0 * self.waited_s
        cost_s = begin - slot.started - self.waited_s
        self._slowest_s = max(cost_s, _FADES * self._slowest_s)
        return 1000.0 * cost_s

    def _look_again(self, slot: Slot) -> None:
        """Wait for the primary sensor's reading where it is late: without it the hand would be a tick old.

        Only for a sensor that still holds its joint. The wait ends before the frame would count as late.
        """
        link, newest = self.parts.link, self.parts.newest_primary
        if (
            newest is None
            or not self.late_look_s
            or any(one.sensor == newest.sensor for one in self.readings)
        ):
            return
        if slot.started - newest.arrival > HOLD_S:
            return
        before = self._monotonic()
        late = slot.deadline + self.late_s - self._slowest_s - _SPARE_S
        until = min(slot.started + self.late_look_s, late)
        self.readings = link.drain_late(newest.sensor, until, self._monotonic)
        self.waited_s = self._monotonic() - before

    def _name_reading(self) -> None:
        """The frame names the reading that went into it."""
        newest = self.parts.newest_primary
        if newest is not None:
            self.frame.sensor_sequence, self.frame.sensor_arrival = newest.sequence, newest.arrival
