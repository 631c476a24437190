"""The stage's fallbacks: what it does when something goes wrong, counted from those who notice it."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.box.fallback import Fallback, Fallbacks, Fallen
from appliance.dancer.puppeteers import HOLD_S
from appliance.stage.admission import Admission
from appliance.stage.health import Health
from appliance.stage.resume import Resumption
from appliance.stage.stage_parts import StageParts

SENSOR_SILENT = Fallback(
    "sensor-silent",
    "A sensor was silent for 0.1 s: its joint holds, then moves freely over a second, and is taken again "
    "over half a second when readings return. Check its battery, then the network.",
)
READING_REFUSED = Fallback(
    "reading-refused",
    "Readings without an orientation were dropped. The audience sees nothing of it. Our firmware sends none: "
    "if it goes on, flash that wearable with the firmware of this version.",
)
PACKET_REFUSED = Fallback(
    "packet-refused",
    "Datagrams that are none of our sensors' were dropped. The audience sees nothing of it. If it goes on, "
    "somebody else is in the sensors' network.",
)
CABLE_AWAY = Fallback(
    "cable-away",
    "A sensor's cable is unplugged: its joint moves freely. It is taken again when it is plugged in.",
)
ADDRESS_ABSENT = Fallback(
    "address-absent",
    "This machine lacks the address at which it listens to sensors: joints move freely until it comes. "
    "Look at the network's cable or access point, then at sensors: udp: in the box file.",
)
NOT_LET_IN = Fallback(
    "sensor-not-let-in", "A sensor of the show has no key here: its joint moves freely. Provision it."
)
TICK_LATE = Fallback(
    "tick-late",
    "A tick was late: the last pose left once more. The audience sees nothing of one, a tremble of many. "
    "Look who else uses the processor: bunraku doctor.",
)
TICK_SKIPPED = Fallback(
    "tick-skipped",
    "Slots went by without a frame: the machine was held up. The dance goes on in its place. Look who else "
    "uses the processor: bunraku doctor.",
)
OVER_BUDGET = Fallback(
    "over-budget",
    "A tick cost more than its budget. The audience sees nothing of it while frames leave in time. Lower the "
    "iterations if it happens often.",
)
ITERATIONS_LOWERED = Fallback(
    "iterations-lowered",
    "The show's iterations do not fit this machine and are lowered: the dancer follows the phrase more "
    "closely.",
)
NETWORK_FAILED = Fallback(
    "network-not-finite",
    "The network gave poses that are not numbers: the last good pose is held. Copy the show bundle again.",
)
RECEIVER_GONE = Fallback(
    "receiver-gone",
    "A receiver does not get the dance; the others do, and it is tried again each second. Start it, or check "
    "its address.",
)
NOT_REALTIME = Fallback(
    "not-realtime",
    "The stage has no real-time rights: other programs can hold it up. bunraku doctor tells how.",
)
NOT_SHARED = Fallback(
    "frames-not-shared",
    "Frames cannot be shared: neither lights nor projector see the dance. Free memory in the runtime folder.",
)
NOT_RECORDED = Fallback(
    "journal-missing",
    "The journal cannot be recorded. The audience sees nothing of it. Free memory in the runtime folder.",
)
PLACE_NOT_NOTED = Fallback(
    "place-not-noted",
    "The place of the dance cannot be noted: after a crash it begins at the beginning. Free memory in the "
    "runtime folder.",
)
STAGE_RESTARTED = Fallback(
    "stage-restarted",
    "The stage hung or died and was started again: outputs paused, and the dance went on where it was. "
    "Export the journal for us: bunraku journal export.",
)
POWER_CUT = Fallback(
    "power-cut",
    "The power was cut: the dance went on where it was, less than a second before. Check the plug.",
)
OF_THE_STAGE = (
    *(SENSOR_SILENT, READING_REFUSED, PACKET_REFUSED, CABLE_AWAY, ADDRESS_ABSENT, NOT_LET_IN),
    *(TICK_LATE, TICK_SKIPPED, OVER_BUDGET, ITERATIONS_LOWERED, NETWORK_FAILED),
    *(RECEIVER_GONE, NOT_REALTIME, NOT_SHARED, NOT_RECORDED, PLACE_NOT_NOTED, STAGE_RESTARTED, POWER_CUT),
)

_FOREIGN = ("length", "magic", "version", "kind", "device", "tag", "old_session", "old_hello")


class StageFallbacks:
    """Sensors are watched at each tick, all else is looked at once a second, after the frame has left."""

    def __init__(self, cast: StageParts, admission: Admission) -> None:
        self._cast = cast
        self.all = Fallbacks(OF_THE_STAGE)
        self._worn = [joints[0] for joints in cast.worn.values()]
        self._silent = [False] * len(self._worn)
        self._dropped: dict[str, int] = {}
        self.all.set(ITERATIONS_LOWERED.name, not admission.fits, admission.sentence())
        self.all.set(NOT_LET_IN.name, bool(cast.complaints), " ".join(cast.complaints))

    def watch(self, now: float) -> None:
        """At each tick: who has just fallen silent. Some microseconds, nothing is made."""
        for place, worn in enumerate(self._worn):
            silent = HOLD_S < worn.silent_s(now) < float("inf")
            if silent != self._silent[place]:
                self._silent[place] = silent
                if silent:
                    self.all.count(SENSOR_SILENT.name, now)

    def begin(self, now: float, resuming: Resumption, not_shared: str, is_recorded: bool) -> None:
        """Right before the first tick: how it came to this start, and what the stage could not get.

        `not_shared`: why no frames can be shared, else "".
        """
        self.all.follow(STAGE_RESTARTED.name, resuming.restarts, now)
        self.all.follow(POWER_CUT.name, resuming.power_cuts, now)
        self.all.set(PLACE_NOT_NOTED.name, bool(resuming.complaint), resuming.complaint)
        self.all.set(NOT_SHARED.name, bool(not_shared), not_shared)
        self.all.set(NOT_RECORDED.name, not is_recorded)

    def lack_rights(self, missing: Sequence[str]) -> None:
        """Which real-time rights the stage did not get, sentences."""
        self.all.set(NOT_REALTIME.name, bool(missing), " ".join(missing))

    def look(self, now: float, health: Health) -> None:
        """Once a second: what others have counted."""
        counts, every = self._cast.link.counts, self.all
        every.hold(SENSOR_SILENT.name, any(self._silent))
        every.follow(READING_REFUSED.name, counts.get("norm", 0), now)
        every.follow(PACKET_REFUSED.name, sum(counts.get(one, 0) for one in _FOREIGN), now)
        every.follow(TICK_LATE.name, health.late, now)
        every.follow(TICK_SKIPPED.name, health.skipped, now)
        every.follow(OVER_BUDGET.name, health.over_budget, now)
        every.follow(NETWORK_FAILED.name, health.not_finite, now)
        cables = [getattr(one, "trouble", None) or "" for one in self._cast.link.intakes]
        every.set(CABLE_AWAY.name, any(cables), " ".join(filter(None, cables)))
        every.set(
            ADDRESS_ABSENT.name,
            any(getattr(one, "address_is_absent", False) for one in self._cast.link.intakes),
        )
        every.set(RECEIVER_GONE.name, self._receiver_is_gone())

    def told(self, now: float) -> Sequence[Fallen]:
        """For the shared frame's health."""
        return self.all.told(now)

    def _receiver_is_gone(self) -> bool:
        """Whether one of them has not taken a frame of the last second."""
        before, self._dropped = (
            self._dropped,
            {one.name: one.dropped for one in self._cast.outputs.receivers},
        )
        return any(dropped > before.get(name, 0) for name, dropped in self._dropped.items())
