"""The run itself: one show on one box, from the open ports to the last frame."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from appliance.box.clock import Slot, TickClock
from appliance.box.live_pose import LivePoseReader
from appliance.box.log import log_sentence
from appliance.box.notify import Notifier
from appliance.box.orders import Order, OrderInbox
from appliance.box.realtime import enter_realtime, leave_realtime
from appliance.box.runtime_folder import renew_lost
from appliance.box.show_state import ShowStateReader
from appliance.box.snapshot import packed
from appliance.dancer.phrase_cache import MEMORY
from appliance.dancer.puppet import PuppetNetwork
from appliance.pair.part import forget_part
from appliance.recorder.record import ORDER, SAID, facts_of_run
from appliance.sensor.battery_life import BatteryLives
from appliance.show.box import BoxConfig
from appliance.show.show import Show
from appliance.stage.admission import Admission, SecondLook
from appliance.stage.admission_cache import admitted
from appliance.stage.carry_out import carry_out
from appliance.stage.health import Health
from appliance.stage.made_motions import open_made_motions
from appliance.stage.phase_lock import PhaseLock
from appliance.stage.reconcile import Reconciler
from appliance.stage.recorder import Recorder
from appliance.stage.resume import Resumption
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_lines import roster_lines
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.sharing import Sharing, facts_of
from appliance.stage.stage_error import StageError
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from appliance.stage.watch import Watch

if TYPE_CHECKING:
    from appliance.stage.paired import PairedStage

_log = logging.getLogger(__name__)

_ORDERS_A_TICK = 4  # show control sends no more in that time
_WARM_UP_MARGIN_MS = 0.5
_FIRST_FRAME_IN_S = 0.001
_LONGEST_WARM_UP_MS = 3.0  # a network this heavy comes from memory each time: warming it up gains nothing
GIVE_BACK = "pair/back"
_HUNG_SLOTS = 3  # skipped before a tick: what sensors sent meanwhile may not all be heard in it
_LONGEST_TICK_S = 0.1  # held up for longer, a tick knows too little of the sensors to take an order
_FORGET_PHASE_S = 5.0  # a sensor silent for longer may return at any phase: it is learned again


class Stage:
    """A show ready to dance, all ports open. Raises StageError or ConfigError before anything dances.

    rehearsal: journal and checkpoint go to a temporary folder that is deleted at the end.
    """

    def __init__(
        self,
        show: Show,
        box: BoxConfig,
        box_file: Path | None = None,
        rehearsal: bool = False,
    ) -> None:
        self.show, self.box, self.box_file, self.rehearsal = show, box, box_file, rehearsal
        self._now = 0.0
        self._comes_from_stop = self._held_up = self._is_ready = False
        self.health = Health()
        with ExitStack() as opened:
            self.sharing = Sharing(box, rehearsal)
            opened.callback(self.sharing.close)
            self.notifier = Notifier()
            opened.callback(self.notifier.close)
            self.resuming = Resumption(show.config.name, self.sharing.noted, box.state_folder, box.resume)
            opened.callback(self.resuming.close)
            self.memory = SensorMemory(box.state_folder, self.sharing.noted)
            opened.callback(self.memory.close)
            self.parts: StageParts = assemble(
                show,
                box,
                profiles=self.memory.profiles,
                box_file=box_file,
                memory=self.sharing.folder / MEMORY,
                network_of=_network_of(box),
            )
            opened.callback(self.parts.close)
            if self.parts.has_live:
                self.parts.live_inbox = LivePoseReader(self.sharing.folder)
            self.inbox = _open_inbox(self.sharing.folder)
            opened.callback(self.inbox.close)
            self.recorder = self._open_recorder()
            if self.recorder is not None:
                opened.callback(self.recorder.close)
            self.made = open_made_motions(self.sharing.folder, show, self.parts)
            for made in self.made:
                opened.callback(made.close)
            show_state = ShowStateReader(self.sharing.folder)
            opened.callback(show_state.close)
            self.admission: Admission = admitted(
                self.sharing.folder, self.parts, box, self.resuming.comes_back
            )
            self._closing = opened.pop_all()
        self.parts.run_with(self.admission)
        self.iterations = self.parts.led.iterations
        self.second_look = SecondLook(self.admission)
        self.reconciler = Reconciler(
            show.config.name, self.parts, show_state, made=self.made, source=show.config.motion.source
        )
        needed_ms = min(self.admission.p99_ms, box.limits.tick_budget_ms)
        latest_start_s = max(0.0, box.limits.late_ms - needed_ms) / 1000.0
        corrects_heading = box.sensors.heading == "auto"
        self.wearing = SensorFit(self.parts, self.memory, corrects_heading)
        self.batteries = BatteryLives()
        self._resume(TickClock().now())
        late_look_s = box.limits.wait_ms / 1000.0
        late_s = box.limits.late_ms / 1000.0
        self.tick = Tick(self.parts, self.wearing, latest_start_s, late_look_s, late_s)
        lead_ms = self.admission.one_ms + _WARM_UP_MARGIN_MS
        self.lead_s = lead_ms / 1000.0 if lead_ms < _LONGEST_WARM_UP_MS else 0.0
        primary, link = self.parts.primary, self.parts.link
        keeps_rate = primary is not None and not link.is_foreign(primary)
        self.lock = PhaseLock(1 / link.rate_hz) if box.phase_lock and keeps_rate else None
        self.watch = Watch(self.parts, self.admission, self.made)
        self.paired = self._open_pair()

    def dance(self, seconds: float | None, stopped: Callable[[], bool]) -> None:
        """Tick until `stopped` says so or the seconds are over; this thread is the real-time one."""
        if not self.box.realtime.enabled:
            leave_realtime()
            self._tick_on(seconds, stopped)
            return
        missing = enter_realtime(self.box.realtime.priority)
        for message in missing:
            _log.warning(message)
        self.watch.note_missing_rights(missing)
        try:
            self._tick_on(seconds, stopped)
        finally:
            leave_realtime()

    def close(self) -> None:
        if self.paired is not None:
            self.paired.close()
        self._closing.close()

    def _tick_on(self, seconds: float | None, stopped: Callable[[], bool]) -> None:
        clock = TickClock()
        shift_s = 0.0
        begun = clock.now()
        self.health.begin(begun)
        facts = facts_of(self.show, self.box_file, self.iterations, begun, self.rehearsal)
        self.sharing.begin(self.parts, facts)
        self.watch.note_start(begun, self.resuming, self.sharing.complaint, self.recorder is not None)
        self._publish_health(begun)
        self.resuming.write_start(self.reconciler)
        if self.recorder is not None:
            self.recorder.keyframe(self.tick)
        if self.show.config.dancer.seed is None:
            self._log_and_note(f"The answer's noise has the seed {self.parts.liveliness.seed}.")
        clock.begin(self.lead_s + _FIRST_FRAME_IN_S)
        if self.paired is not None:
            self.paired.begin(clock.now())
        while not stopped() and (seconds is None or clock.now() - begun < seconds):
            if self.paired is not None and not self._lead_or_follow(clock):
                continue
            slot = clock.wait(shift_s, self.lead_s, self.tick.warm_up if self.lead_s else None)
            self._now = slot.started
            if self.paired is not None and not self.paired.still_leads(slot.started):
                continue
            # only the first tick after a stop: a machine that is always slow is still reported
            self._comes_from_stop = slot.skipped >= _HUNG_SLOTS and not self._comes_from_stop
            self.tick.run(slot)
            self._note(slot)
            self._reconcile(slot.started)
            self._take_orders(slot.started, clock.now)
            if self.paired is not None:
                self.paired.flush(clock.now())
            if self.recorder is not None and self.recorder.wants_keyframe:
                self.recorder.keyframe(self.tick)
            shift_s = self._follow_sensor(slot)
            if self.health.is_due(slot.started) and not self._comes_from_stop:
                self._report(slot.started)
        self.resuming.write_end()
        self.notifier.stopping()

    def _note(self, slot: Slot) -> None:
        """Count the tick and write it into the journal; the frame has left already."""
        tick, health = self.tick, self.health
        cost_ms = tick.after(slot)
        self._log_news_of_sensors()
        left_ms = 1000.0 * (slot.lateness_s + tick.waited_s) + cost_ms
        late = tick.late or left_ms > self.box.limits.late_ms
        health.tick(cost_ms, self.box.limits.tick_budget_ms)
        health.late += late
        health.skipped += slot.skipped
        health.not_finite += any(one.network_failed for one in self.parts.puppets)
        if health.ticks == 1:
            self.notifier.ready()
        self.notifier.ping(slot.started)
        if not self._comes_from_stop:
            self.watch.count_silences(slot.started)
        self.resuming.write_checkpoint(self.reconciler, slot.tick)
        if self.recorder is not None:
            self.recorder.note_tick(slot, tick, late)
        if self.paired is not None:
            self.paired.publish(time.monotonic())

    def _open_pair(self) -> PairedStage | None:
        """The other box, where the box file names one. Raises ConfigError without its secret."""
        pair, locked = self.box.pair, self.box.locked
        if pair is None and locked is None:
            forget_part(self.sharing.folder)
            return None
        if self.recorder is None:
            return None  # what another box would follow is what the recorder notes; it was said why not
        from appliance.stage.paired import PairedStage, PairParts

        stage = PairParts(
            outputs=self.box.outputs,
            show=self.show,
            parts=self.parts,
            wearing=self.wearing,
            tick=self.tick,
            reconciler=self.reconciler,
            folder=self.sharing.folder,
            note=self._log_and_note,
            made=self.made[0].loop if self.made else None,
        )
        if pair is not None:
            paired = PairedStage(pair, stage)
        elif locked is not None:
            from appliance.stage.locked import LockedStage

            paired = LockedStage(locked, stage)
        self.recorder.tap = paired.note
        return paired

    def _lead_or_follow(self, clock: TickClock) -> bool:
        """Whether this box leads; else it follows for a moment, with its outputs silent."""
        paired = self.paired
        assert paired is not None
        if paired.leads:
            return True
        paired.follow(clock, self._note_followed)
        now = self._now = clock.now()
        if paired.leads:
            if self.recorder is not None:
                self.recorder.keyframe(self.tick)
            return False  # the reconciler and the orders come with the first tick
        if not self._is_ready:  # a supervisor need not hear it a hundred times a second
            self._is_ready = True
            self.notifier.ready()
        self.notifier.ping(now)
        while (order := self.inbox.take()) is not None:
            self.inbox.answer(order, False, paired.refused(order))
        if self.health.is_due(now):
            self.health.look(now)
            _log.info(self.health.line(*self.parts.led.iterations.asked, None, False) + "  follows")
            self._publish_health(now)
        return False

    def _note_followed(self, now: float, cost_ms: float) -> None:
        """A tick of the leader was run here."""
        self._log_news_of_sensors()
        self.health.tick(cost_ms, self.box.limits.tick_budget_ms)
        self.resuming.write_checkpoint(self.reconciler, self.tick.frame.tick)

    def _log_news_of_sensors(self) -> None:
        for message in self.wearing.messages:
            self._log_and_note(message)

    def _follow_sensor(self, slot: Slot) -> float:
        """The phase lock's correction to the next period, seconds."""
        newest = self.parts.newest_primary
        if self.lock is None or newest is None:
            return 0.0
        for arrival in self.parts.link.arrivals(newest.sensor):
            self.lock.observe(arrival)
        if slot.started - newest.arrival > _FORGET_PHASE_S:
            self.lock.forget()
        return self.lock.shift_s(slot.deadline)

    def _reconcile(self, now: float) -> None:
        """Apply what show control has declared since the last time."""
        before, orders = self.reconciler.generation, self.reconciler.pending(now)
        if orders or self.reconciler.generation != before:
            messages = [self._carry_out(order, now)[1] for order in orders]
            self.reconciler.message = " ".join(filter(None, messages))
            self.resuming.write_checkpoint(self.reconciler, self.tick.frame.tick)  # before it is reported
            self._publish_health(now)

    def _take_orders(self, started: float, monotonic: Callable[[], float]) -> None:
        """Carry out orders that have come meanwhile, and answer them.

        None is taken right after a stop, nor when one was within this tick, which began at `started`: its
        readings are old, and the next tick has newer ones. A box whose every tick takes that long still takes
        orders: they may mend it.
        """
        was_held_up, self._held_up = self._held_up, monotonic() - started > _LONGEST_TICK_S
        if self._comes_from_stop or (self._held_up and not was_held_up):
            return
        done: list[tuple[Order, bool, str]] = []
        while len(done) < _ORDERS_A_TICK and (order := self.inbox.take()) is not None:
            self._reconcile(started)  # what was declared before this order was sent comes before it
            done.append((order, *self._carry_out(order, monotonic())))
        if done:
            self.resuming.write_checkpoint(self.reconciler, self.tick.frame.tick)  # before it is reported
        if any(not order.quiet for order, _, _ in done):
            self._publish_health(started)  # the next question is answered with it
        for answer in done:
            self.inbox.answer(*answer)

    def _carry_out(self, order: Order, now: float) -> tuple[bool, str]:
        if order.name == GIVE_BACK:
            return self._give_back(now)
        done, message = carry_out(order, self.parts, self.wearing, now)
        if self.recorder is not None:
            asked = {"name": order.name, "values": order.values, "text": order.text}
            self.recorder.event(ORDER, now, order=asked, done=done, message=message)
        if message:
            _log.info(message)
        return done, message

    def _give_back(self, now: float) -> tuple[bool, str]:
        """The other box of the pair is to lead; no order of the dance, so no replay carries it out."""
        if self.paired is None:
            return False, "This box has no pair. Write `pair:` in its box file."
        return self.paired.give_back(now)

    def _resume(self, now: float) -> None:
        """After a crash or a power cut: go on where the show was, or else with what is declared."""
        if self.resuming.complaint:
            _log.warning(self.resuming.complaint)
        messages = [self.resuming.go_on(self.reconciler, now)]
        if not self.resuming.went_on:
            messages.append(self.reconciler.begin(now))
        for sentence in filter(None, messages):
            _log.info(sentence)

    def _publish_health(self, now: float) -> None:
        """Publish how the box is in the shared frame."""
        states, wearing, locked = self.parts.link.states(now), self.wearing, self._is_locked
        leaders_now = now
        if self.paired is not None and not self.paired.leads:  # that box has the sensors, and its own clock
            states, leaders_now = [], now - self.paired.ahead_s
        self.batteries.hear(states, now)
        roster = roster_lines(states, wearing.neutral_of, wearing.corrected_of, self.batteries.left_s)
        age_s = self._sensor_age_s(leaders_now)
        if self.paired is not None:
            self.paired.set_fallbacks(self.watch.fallbacks, now)
        self.sharing.publish_health(
            now,
            self.health,
            self.reconciler,
            sensor_age_s=age_s,
            locked=locked,
            sensors=roster,
            fallbacks=self.watch.fallbacks.happened(now),
            paired={} if self.paired is None else self.paired.reported(now),
        )

    def _log_and_note(self, message: str) -> None:
        """For the log, and for the journal."""
        log_sentence(_log, message)
        if self.recorder is not None:
            self.recorder.event(SAID, self._now, message=message)

    def _sensor_age_s(self, now: float) -> float | None:
        """None: the show has no sensor."""
        primary = self.parts.primary
        return None if primary is None else self.parts.worn[primary][0].silent_s(now)

    @property
    def _is_locked(self) -> bool:
        return self.lock is not None and self.lock.locked

    def _report(self, now: float) -> None:
        """Once a second, after the frame has left."""
        times = self.iterations
        self.health.look(now)
        if most := self.second_look.most_that_fits(self.health.slowest_ms, times.coding):
            self._carry_out(Order("allow", (float(most),)), now)
            self._log_and_note(self.watch.note_second_look(most))
        folder_news = self.watch.note_folder(now, renew_lost())
        news = self.watch.check(now, self.health, self.parts.link.states(now))
        line = self.health.line(times.coding, times.interaction, self._sensor_age_s(now), self._is_locked)
        line = "  ".join(filter(None, (line, self.watch.fallbacks.line(now))))
        self.notifier.status(line)
        _log.info(line)
        self._publish_health(now)
        for sentence in filter(None, (folder_news, *news)):
            self._log_and_note(sentence)
        for imu_id, offsets in self.parts.link.take_profiles():
            self.memory.keep_profile(imu_id, offsets)

    def _open_recorder(self) -> Recorder | None:
        """The flight recorder, unless there is no memory for it: that does not stop the show."""
        try:
            facts = facts_of_run(self.show, list(self.parts.worn))
            return Recorder(self.sharing.noted, facts, len(packed(self.parts)))
        except OSError as error:
            _log.warning(
                f"{self.sharing.noted}: no journal can be noted there ({error.strerror}). The dance goes on "
                "without one. Free memory there, or give another folder as `runtime:` in the box file."
            )
            return None


def _network_of(box: BoxConfig) -> type[PuppetNetwork]:
    """The class of the network; with other boxes, one that can be told where theirs failed."""
    if box.pair is None and box.locked is None:
        return PuppetNetwork
    from appliance.stage.rerun import RecordedNetwork

    return RecordedNetwork


def _open_inbox(folder: Path) -> OrderInbox:
    try:
        return OrderInbox(folder, "stage")
    except OSError as error:
        raise StageError(
            f"{folder}: no socket for show control's orders can be made ({error.strerror}). Nothing dances. "
            "Give another folder as `runtime:` in the box file."
        ) from error
