"""The run itself: one show on one box, from the open ports to the last frame."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from appliance.control.orders import Order
from appliance.sensor.link import SensorState
from appliance.sensor.memory import SensorMemory
from appliance.show.box import BoxConfig
from appliance.show.show import Show
from appliance.stage.budget import Admission
from appliance.stage.cast import Cast, Iterations, admission, assemble
from appliance.stage.clock import Slot, TickClock
from appliance.stage.control import Control
from appliance.stage.health import Health
from appliance.stage.journal import JUMPED, LATE, NOT_FINITE, Journal, JournalError
from appliance.stage.obey import SENSOR_ORDERS, obey, obey_for_sensors
from appliance.stage.phase_lock import PhaseLock
from appliance.stage.realtime import enter_realtime, leave_realtime
from appliance.stage.roster import Roster
from appliance.stage.stage_error import StageError
from appliance.stage.tick import Tick
from appliance.stage.watch import Watch
from appliance.stage.wearing import Wearing

_COMMANDS_A_TICK = 4
_WARM_UP_MARGIN_MS = 0.5
_LONGEST_WARM_UP_MS = 3.0  # a network this heavy comes from memory each time: warming it up gains nothing
_FORGET_PHASE_S = 5.0  # a sensor silent for longer may come back anywhere: the phase is learnt anew


class Stage:
    """A show ready to dance, all ports open. Raises StageError or ConfigError before anything dances."""

    def __init__(self, show: Show, box: BoxConfig, journal: Path | None, say: Callable[[str], None]) -> None:
        self.show, self.box, self.say = show, box, say
        self.health = Health()
        with ExitStack() as opened:
            self.memory = SensorMemory(box.state_folder, say)
            opened.callback(self.memory.close)
            self.cast: Cast = assemble(show, box, self.memory.profiles)
            opened.callback(self.cast.close)
            self.roster = Roster(str(box.sensors.keys or ""))
            self.control = _open_control(box, self.roster)
            if self.control is not None:
                opened.callback(self.control.close)
            self.journal = self._open_journal(journal)
            if self.journal is not None:
                opened.callback(self.journal.close)
            self.admission: Admission = admission(self.cast, show, box)
            self._closing = opened.pop_all()
        self.iterations = Iterations(
            self.admission.coding, self.admission.interaction, self.admission.most_coding
        )
        needed_ms = min(self.admission.p99_ms, box.limits.tick_budget_ms)
        latest_start_s = max(0.0, box.limits.late_ms - needed_ms) / 1000.0
        self.wearing = Wearing(self.cast, self.memory, say)
        self.tick = Tick(self.cast, self.wearing, self.iterations, latest_start_s)
        lead_ms = self.admission.one_ms + _WARM_UP_MARGIN_MS
        self.lead_s = lead_ms / 1000.0 if lead_ms < _LONGEST_WARM_UP_MS else 0.0
        self.lock = PhaseLock() if box.phase_lock and self.cast.primary else None
        self.watch = Watch(self.cast)

    def dance(self, seconds: float | None, stopped: Callable[[], bool]) -> None:
        """Tick until `stopped` says so or the seconds are over; this thread is the real-time one."""
        if not self.box.realtime.enabled:
            self._tick_on(seconds, stopped)
            return
        for words in enter_realtime(self.box.realtime.priority):
            self.say(words)
        if self.journal is not None:
            self.journal.unlock()
        try:
            self._tick_on(seconds, stopped)
        finally:
            leave_realtime()

    def close(self) -> None:
        """Free every port, socket and file."""
        self._closing.close()

    def _tick_on(self, seconds: float | None, stopped: Callable[[], bool]) -> None:
        clock = TickClock()
        shift_s = 0.0
        begun = clock.now()
        self.health.begin(begun)
        self._look_at_sensors(begun)
        while not stopped() and (seconds is None or clock.now() - begun < seconds):
            slot = clock.wait(shift_s, self.lead_s, self.tick.warm_up if self.lead_s else None)
            self.tick.run(slot)
            self._note(slot)
            self._obey(slot.started)
            shift_s = self._follow_sensor(slot)
            if self.health.is_due(slot.started):
                self._report(slot.started)

    def _note(self, slot: Slot) -> None:
        """Count the tick and write it into the journal; the frame has left already."""
        tick, health = self.tick, self.health
        cost_ms = tick.after(slot)
        late = tick.frame.late or 1000.0 * slot.lateness_s + cost_ms > self.box.limits.late_ms
        health.tick(cost_ms, self.box.limits.tick_budget_ms)
        health.late += late
        health.skipped += slot.skipped
        health.not_finite += tick.network_failed
        if self.journal is not None:
            flags = late * LATE | tick.network_failed * NOT_FINITE | self.cast.motion.jumped * JUMPED
            self._write(self.journal, slot, flags)

    def _write(self, journal: Journal, slot: Slot, flags: int) -> None:
        frame, field, row = self.tick.frame, journal.field, journal.row
        field["tick"][row] = slot.tick
        field["frame_time"][row] = frame.frame_time
        field["started"][row] = slot.started
        field["sensor_sequence"][row] = frame.sensor_sequence
        field["sensor_arrival"][row] = frame.sensor_arrival
        field["flags"][row] = flags
        field["skipped"][row] = slot.skipped
        field["coding_iterations"][row] = self.iterations.coding
        field["interaction_iterations"][row] = self.iterations.interaction
        field["sections_ms"][row] = self.tick.sections_ms
        for hand, place in enumerate(self.cast.hand_places):
            field["targets"][row, hand] = self.cast.hands.targets[place]
            field["weights"][row, hand] = self.cast.hands.weights[place]
        field["root"][row] = frame.root
        field["pose"][row] = frame.pose
        journal.commit()

    def _follow_sensor(self, slot: Slot) -> float:
        """The phase lock's correction to the next period, seconds."""
        newest = self.cast.newest_primary
        if self.lock is None or newest is None:
            return 0.0
        for arrival in self.cast.link.arrivals(newest.sensor):
            self.lock.observe(arrival)
        if slot.started - newest.arrival > _FORGET_PHASE_S:
            self.lock.forget()
        return self.lock.shift_s(slot.deadline)

    def _obey(self, now: float) -> None:
        if self.control is None:
            return
        for _ in range(_COMMANDS_A_TICK):
            command = self.control.take()
            if command is None:
                return
            order = Order(command.name, command.values, command.sensor or command.joint, command.keys)
            if order.name in SENSOR_ORDERS:
                done, words = obey_for_sensors(order, self.cast, self.wearing, now)
                self._look_at_sensors(now)
                self.control.answer(command, done, words)
            else:
                done, words = obey(order, self.cast, self.iterations, self.show.config.motion.rate)
            if words:
                self.say(words)

    def _look_at_sensors(self, now: float) -> list[SensorState]:
        """How the sensors are, also for whoever asks over the control port."""
        states = self.cast.link.states(now)
        self.roster.refresh(states, self.wearing.neutral_of, now)
        return states

    def _report(self, now: float) -> None:
        """Once a second, after the frame has left."""
        age_s = None
        if self.cast.primary is not None:
            age_s = self.cast.worn[self.cast.primary][0].silent_s(now)
        locked = self.lock is not None and self.lock.locked
        times = self.iterations
        self.say(self.health.line(now, times.coding, times.interaction, age_s, locked))
        sensors = self._look_at_sensors(now)
        for sentence in self.watch.news(now, sensors):
            self.say(sentence)
        for imu_id, offsets in self.cast.link.take_profiles():
            self.memory.keep_profile(imu_id, offsets)

    def _open_journal(self, path: Path | None) -> Journal | None:
        """The flight recorder, if one is wanted and can be had: a full disk does not stop the show."""
        if path is None:
            return None
        hands = [
            {"joint": hand.joint, "kind": hand.kind, "sensor": hand.sensor} for hand in self.show.config.hands
        ]
        try:
            return Journal(path, self.show.skeleton, hands, self.box.journal.minutes)
        except JournalError as error:
            self.say(str(error))
            return None


@contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """While inside, SIGTERM, Ctrl-C and a closed terminal end the dance after the tick at hand."""
    caught: list[int] = []
    signals = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
    before = [signal.signal(number, lambda came, _: caught.append(came)) for number in signals]
    try:
        yield lambda: bool(caught)
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


def _open_control(box: BoxConfig, roster: Roster) -> Control | None:
    control = box.control
    if control is None:
        return None
    try:
        return Control(control.host, control.port, roster, box.sensors.keys)
    except OSError as error:
        raise StageError(
            f"UDP port {control.port} on {control.host} cannot be opened for commands ({error.strerror}). "
            "Nothing dances. Is a second bunraku running? Stop it, or give another port under control: "
            "in the box file, or `control: null` for none."
        ) from error
