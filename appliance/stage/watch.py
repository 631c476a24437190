"""Notices trouble: keeps the stage's fallbacks, and says each change once to people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from appliance.box.fallback import Fallbacks
from appliance.box.log import Trouble
from appliance.dancer.live import SILENT_S as LIVE_SILENT_S
from appliance.dancer.puppeteers import HOLD_S
from appliance.levers.sources import LIVE
from appliance.sensor import wire
from appliance.sensor.link import FOREIGN
from appliance.sensor.state import LOW_BATTERY, SensorState
from appliance.stage import fallback
from appliance.stage.admission import Admission
from appliance.stage.health import Health
from appliance.stage.made_motions import MadeMotions
from appliance.stage.resume import Resumption
from appliance.stage.stage_parts import StageParts

SILENT_S = 0.5
CHARGED = 25  # percent: above it a low battery may be said again


class Watch:
    """Checks for silent sensors at each tick, for all else once a second, after the frame has left."""

    def __init__(self, parts: StageParts, admission: Admission, made: Sequence[MadeMotions] = ()) -> None:
        self._parts, self._made = parts, made
        self.fallbacks = Fallbacks(fallback.OF_THE_STAGE)
        self._worn = [joints[0] for joints in parts.worn.values()]
        self._silent = [False] * len(self._worn)
        self._fell_silent = [False] * len(self._worn)  # since the last check
        self._refused: dict[str, int] = {}
        self._is_source_late = False
        self._dropped: dict[str, int] = {}
        self._ways: dict[str, str] = {}
        self._said: set[tuple[str, str]] = set()  # conditions that hold, and were reported
        self.fallbacks.set(fallback.ITERATIONS_LOWERED.name, "" if admission.fits else admission.sentence())
        self.fallbacks.concern(fallback.NOT_LET_IN.name, parts.not_let_in)
        self._missing = parts.not_let_in
        self.fallbacks.set(fallback.NOT_LET_IN.name, self._why_not_let_in())

    def count_silences(self, now: float) -> None:
        """At each tick: sensors, and a live dancer, that have just fallen silent. Allocates nothing."""
        late = False
        for puppet in self._parts.puppets:
            live = puppet.live
            late |= live is not None and live.is_chosen and LIVE_SILENT_S < live.silent_s(now) < math.inf
        for made in self._made:
            late |= made.is_late
        if late and not self._is_source_late:
            self.fallbacks.count(fallback.SOURCE_LATE.name, now)
        self._is_source_late = late
        for place, worn in enumerate(self._worn):
            silent = HOLD_S < worn.silent_s(now) < math.inf
            if silent != self._silent[place]:
                self._silent[place] = silent
                if silent:
                    self._fell_silent[place] = True
                    self.fallbacks.count(fallback.SENSOR_SILENT.name, now)

    def note_start(self, now: float, resuming: Resumption, not_shared: str, is_recorded: bool) -> None:
        """Right before the first tick: how it came to this start, and what the stage could not get.

        `not_shared`: why no frames can be shared, else "".
        """
        self.fallbacks.follow(fallback.STAGE_RESTARTED.name, resuming.restarts, now)
        self.fallbacks.follow(fallback.POWER_CUT.name, resuming.power_cuts, now)
        self.fallbacks.set(fallback.PLACE_NOT_NOTED.name, resuming.complaint)
        if resuming.dropped:
            self.fallbacks.count(fallback.PLACE_DROPPED.name, now)
        self.fallbacks.set(fallback.NOT_SHARED.name, not_shared)
        self.fallbacks.set(fallback.NOT_RECORDED.name, not is_recorded)

    def note_missing_rights(self, missing: Sequence[str]) -> None:
        """Which real-time rights the stage did not get, sentences."""
        self.fallbacks.set(fallback.NOT_REALTIME.name, " ".join(missing))

    def note_second_look(self, most: int) -> str:
        """Iterations that admission lowered fit after all: up to `most`. The sentence about it."""
        self.fallbacks.set(fallback.ITERATIONS_LOWERED.name, "")
        return (
            f"Up to {most} coding iterations fit by now. The dancer dances the show's own iterations again."
        )

    def note_folder(self, now: float, lost: str | None) -> str:
        """Once a second, as renew_lost told it; a sentence where that is news."""
        if lost is None:
            self.fallbacks.set(fallback.FOLDER_LOST.name, False)
            return ""
        if not lost:
            self.fallbacks.count(fallback.FOLDER_LOST.name, now)
            return Trouble(fallback.FOLDER_LOST.message)
        message = Trouble(
            f"The folder where the box's processes meet was deleted, or files in it: {lost} The dance goes "
            "on, but commands, lights and picture may not come back once they end. Start the box again: "
            "systemctl restart bunraku.target, or `bunraku play`."
        )
        self.fallbacks.set(fallback.FOLDER_LOST.name, message)
        return message if self._changes("folder", lost, True) else ""

    def check(self, now: float, health: Health, sensors: Sequence[SensorState] = ()) -> list[str]:
        """Once a second: bring the fallbacks up to date; sentences about what changed since the last call.

        now: monotonic seconds; sensors: as the link sees them at this moment.
        """
        before, self._dropped = (
            self._dropped,
            {one.name: one.dropped for one in self._parts.outputs.receivers if one.is_asked_for},
        )
        gone = {name for name, dropped in self._dropped.items() if dropped > before.get(name, 0)}
        for receiver in self._parts.outputs.receivers:
            receiver.is_gone = receiver.name in gone
        self._update_fallbacks(now, health, gone)
        return [
            *(sentence for sensor in sensors for sentence in self._sensor_news(sensor)),
            *self._silence_news(now, {sensor.name for sensor in sensors}),
            *self._source_news(now),
            *self._output_news(gone),
            *self._stamp_news(),
        ]

    def _update_fallbacks(self, now: float, health: Health, gone: set[str]) -> None:
        every, link = self.fallbacks, self._parts.link
        counts = link.counts
        self._name_them(now, gone)
        every.hold(fallback.SENSOR_SILENT.name, any(self._silent))
        every.hold(fallback.SOURCE_LATE.name, self._is_source_late)
        every.follow(fallback.READING_REFUSED.name, counts.get("norm", 0), now)
        every.follow(fallback.PACKET_REFUSED.name, sum(counts.get(one, 0) for one in FOREIGN), now)
        every.follow(fallback.POSE_REFUSED.name, self._parts.live_refused, now)
        puppets = self._parts.puppets
        jumps = max(one.live.jumps if one.live is not None else 0 for one in puppets)
        every.follow(fallback.SOURCE_JUMPED.name, jumps, now)
        every.follow(fallback.FIGURE_REFUSED.name, sum(one.figures_refused for one in puppets), now)
        every.follow(fallback.TICK_LATE.name, health.late, now)
        every.follow(fallback.TICK_SKIPPED.name, health.skipped, now)
        every.follow(fallback.OVER_BUDGET.name, health.over_budget, now)
        every.follow(fallback.NETWORK_FAILED.name, health.not_finite, now)
        cables = filter(None, (getattr(one, "trouble", None) for one in link.intakes))
        every.set(fallback.CABLE_AWAY.name, " ".join(cables))
        is_absent = any(getattr(one, "address_is_absent", False) for one in link.intakes)
        every.set(fallback.ADDRESS_ABSENT.name, is_absent)
        every.set(fallback.RECEIVER_GONE.name, bool(gone))
        every.set(fallback.NOT_LET_IN.name, self._why_not_let_in())

    def _why_not_let_in(self) -> bool | str:
        """As at the start, or that keys were removed or added since."""
        missing = self._parts.not_let_in
        return bool(missing) and (missing != self._missing or " ".join(self._parts.complaints) or True)

    def _name_them(self, now: float, gone: set[str]) -> None:
        """The subjects of each fallback: the sensors, cables, addresses and receivers by name."""
        every, link = self.fallbacks, self._parts.link
        silences = zip(self._parts.worn, self._silent, self._fell_silent, strict=True)
        every.concern(fallback.SENSOR_SILENT.name, [name for name, is_so, fell in silences if is_so or fell])
        self._fell_silent[:] = [False] * len(self._fell_silent)
        refused = link.refused()
        grown = [name for name, count in refused.items() if count > self._refused.get(name, 0)]
        self._refused = refused
        every.concern(fallback.READING_REFUSED.name, grown)
        every.concern(fallback.PACKET_REFUSED.name, filter(None, [link.stranger]))
        away = [one.name for one in link.intakes if getattr(one, "trouble", None)]
        every.concern(fallback.CABLE_AWAY.name, away)
        absent = [one.name for one in link.intakes if getattr(one, "address_is_absent", False)]
        every.concern(fallback.ADDRESS_ABSENT.name, absent)
        every.concern(fallback.RECEIVER_GONE.name, sorted(gone))
        every.concern(fallback.NOT_LET_IN.name, self._parts.not_let_in)
        chosen = [one.live for one in self._parts.puppets if one.live is not None and one.live.is_chosen]
        late = [LIVE for live in chosen if LIVE_SILENT_S < live.silent_s(now) < math.inf]
        late += [one.wanted for one in self._made if one.is_late]
        every.concern(fallback.SOURCE_LATE.name, dict.fromkeys(late))

    def _changes(self, what: str, name: str, is_so: bool) -> bool:
        """Whether this is news: it was not so at the last call and is now, or the reverse."""
        if is_so == ((what, name) in self._said):
            return False
        self._said ^= {(what, name)}
        return True

    def _sensor_news(self, sensor: SensorState) -> Iterator[str]:
        """A person's view of one sensor's link, battery and firmware."""
        name, way_before = sensor.name, self._ways.get(sensor.name)
        if sensor.state == "linked" and sensor.way and sensor.way != way_before:
            self._ways[name] = sensor.way
            joints = ", ".join(puppeteer.joint for puppeteer in self._parts.worn.get(name, ()))
            no_joint = "no joint of this show"
            yield (
                f"Sensor {name} now speaks by {sensor.way}. The dance goes on."
                if way_before
                else f"Sensor {name} is linked by {sensor.way}, and holds {joints or no_joint}."
            )
        if sensor.complaint and self._changes("complaint", sensor.complaint, True):
            yield Trouble(sensor.complaint)
        is_charged = CHARGED <= sensor.battery != wire.BATTERY_UNKNOWN
        is_low = sensor.battery < LOW_BATTERY or (("low", name) in self._said and not is_charged)
        if self._changes("low", name, is_low) and is_low:
            yield Trouble(
                f"Sensor {name}: {sensor.battery} % of its battery left. The dance goes on. Charge it soon."
            )

    def _silence_news(self, now: float, known: set[str]) -> Iterator[str]:
        """known: sensors that have a key; a revoked one is silent for good, and that was said."""
        for name, joints in self._parts.worn.items():
            silent_s = joints[0].silent_s(now)
            was_said = ("silent", name) in self._said
            is_silent = silent_s > SILENT_S and (was_said or (silent_s < math.inf and name in known))
            if self._changes("silent", name, is_silent):
                yield (
                    Trouble(
                        f"Sensor {name} silent for {silent_s:.1f} s. The dancer moves freely. Check its "
                        "battery."
                    )
                    if is_silent
                    else f"Sensor {name} is back. It takes its joint again."
                )

    def _source_news(self, now: float) -> Iterator[str]:
        """A person's view of the live dancer."""
        chosen = [one.live for one in self._parts.puppets if one.live is not None and one.live.is_chosen]
        if not chosen:
            return
        heard = chosen[0].silent_s(now) <= LIVE_SILENT_S
        if self._changes("source", LIVE, not heard):
            yield (
                "The live dancer takes the phrase's place."
                if heard
                else Trouble("No live dancer is heard: the phrase plays on. Check the program that sends it.")
            )

    def _stamp_news(self) -> Iterator[str]:
        """Once: that this system does not say when a datagram came."""
        for intake in self._parts.link.intakes:
            if self._changes("stamps", intake.name, not getattr(intake, "has_stamps", True)):
                yield Trouble(
                    f"This system does not stamp what comes in on {intake.name}: a reading counts as arrived "
                    "when it is read, up to 20 ms late. The dance goes on, a little less in step with the "
                    "sensor. Linux itself stamps; emulators (qemu-user) do not."
                )

    def _output_news(self, gone: set[str]) -> Iterator[str]:
        """A person's view of the receivers, and of the network."""
        for receiver in self._parts.outputs.receivers:
            is_gone = receiver.name in gone
            if self._changes("gone", receiver.name, is_gone):
                yield (
                    Trouble(
                        f"Receiver {receiver.name} does not get the dance: {receiver.last_error}. "
                        "The others go on, and it is tried again each second. Start it, or check its address."
                    )
                    if is_gone
                    else f"Receiver {receiver.name} gets the dance again."
                )
        is_broken = any(one.puppet.is_broken for one in self._parts.puppets)
        if self._changes("network", "", is_broken):
            yield (
                Trouble(
                    "The network gives poses that are not numbers. The dancer holds the last good pose. "
                    "Copy the show bundle again and restart."
                )
                if is_broken
                else "The network gives poses again. The dancer moves."
            )
