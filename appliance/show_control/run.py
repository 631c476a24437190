"""Show control as a process: the port, the show state, orders and the heartbeat, until a stop signal."""

from __future__ import annotations

import contextlib
import logging
import select
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from appliance.box.notify import Notifier
from appliance.box.orders import OrderSender
from appliance.box.process_health import COMMANDS_DROPPED, ProcessHealthWriter
from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.box.stop_signals import stop_signals
from appliance.levers.show_state import ShowState
from appliance.levers.table import MASTER
from appliance.pair.part import PartReader
from appliance.show_control.command_handler import CommandHandler
from appliance.show_control.fallback import LIVE_DROPPED, SENDER_NOT_LISTED
from appliance.show_control.feedback import Feedback
from appliance.show_control.foreign_sensors import ForeignSensors
from appliance.show_control.gestures import Gestures
from appliance.show_control.intake import Intake
from appliance.show_control.key_file import KeyFile
from appliance.show_control.listeners import Heartbeat, Listeners
from appliance.show_control.live_input import LiveInput
from appliance.show_control.order_dispatch import OrderDispatch
from appliance.show_control.packet import Message
from appliance.show_control.port import Address, Port
from appliance.show_control.settings import ControlSettings
from appliance.show_control.stage_observer import StageObserver

_log = logging.getLogger(__name__)

_PAUSE_S = 0.5  # a fader that moves all the time never floods the terminal

_LONGEST_SLEEP_S = 0.25  # a restarted stage is found within this
_FOLLOWING_SLEEP_S = 0.04  # what the leader declares is in force here within this
_AT_ONCE = 16  # datagrams; then answers, heartbeat and signals have their turn
_LIVE_AT_ONCE = 64  # datagrams of a live dancer: most programs send a frame in fewer
_LIVE_S = 0.003  # for these; a whole figure takes up to 1 ms
_SAY_EVERY_S = 60.0
_REST_S = 0.002  # after as many: a flood leaves the processor to others


class ControlProcess:
    """Everything open. Raises OSError where the folder takes no file, or another one is at work there."""

    def __init__(self, settings: ControlSettings, monotonic: Callable[[], float] = time.monotonic) -> None:
        folder, now = Path(settings.folder), monotonic()
        self._monotonic = monotonic
        with ExitStack() as opened:
            self.port = Port(socket.socket(fileno=settings.descriptor), settings.senders)
            opened.callback(self.port.close)
            self._intake = Intake(self.port)
            show_state = _left_in_force(folder, now)
            writer = ShowStateWriter(folder)
            opened.callback(writer.close)
            sender = OrderSender(folder)
            opened.callback(sender.close)
            self.observer = StageObserver(folder)
            opened.callback(self.observer.close)
            self._health = ProcessHealthWriter(folder, "control", self.observer.own)
            opened.callback(self._health.close)
            self._pair = PartReader(folder)
            opened.callback(self._pair.close)
            self._dispatch = OrderDispatch(sender)
            self._heartbeat = Heartbeat(settings.heartbeat, now)
            opened.callback(self._heartbeat.close)
            self._replies = Listeners(settings.replies)
            opened.callback(self._replies.close)
            self._feedback = Feedback(settings.feedback, now)
            opened.callback(self._feedback.close)
            self._foreign = ForeignSensors(settings.foreign, folder)
            opened.callback(self._foreign.close)
            keys = KeyFile(Path(settings.key_file) if settings.key_file else None)
            live = LiveInput(folder)
            opened.callback(live.close)
            self.handler = CommandHandler(
                show_state, self.observer, self._dispatch, keys, self._answer, writer.write, live
            )
            state = Path(settings.state) if settings.state else None
            self._gestures = Gestures(folder, state, self.observer, self.handler.call_cue)
            opened.callback(self._gestures.close)
            self.handler.gestures = self._gestures
            self._poll = select.poll()
            for one in (self.port, sender):
                self._poll.register(one.fileno(), select.POLLIN)
            self._closing = opened.pop_all()
        writer.write(show_state)
        self._failures_said, self._failures_said_at = 0, float("-inf")
        self._news = ConsoleMessages(show_state)
        if message := held_back(show_state):
            _log.warning(f"Still from before: {message}")

    def run(self, ended: Callable[[], bool], wake: int, notifier: Notifier) -> None:
        """Until `ended` says so; `wake` is a descriptor that can be read when it may."""
        self._poll.register(wake, select.POLLIN)
        notifier.ready("Commands are heard.")
        while not ended():
            self._poll.poll(1000.0 * self._sleep_s(self._monotonic()))
            self.turn()
            notifier.ping(self._monotonic())
        notifier.stopping()
        self._health.end(self._monotonic())

    def turn(self) -> None:
        """Handle up to _AT_ONCE datagrams, urgent ones first, and what is due.

        The clock is read after each datagram: this process may have been held up while it received one.
        """
        self._guarded(lambda: self._foreign.take(self._monotonic()))
        taken = 0
        while taken < _AT_ONCE and (found := self._intake.take()) is not None:
            taken += 1
            self.handler.handle_datagram(*found, self._monotonic())
            self._feedback.look(self.handler.show_state, self._monotonic(), found[1])
        ends_at = self._monotonic() + _LIVE_S
        for _ in range(_LIVE_AT_ONCE):
            if (found := self._intake.take_live()) is None:
                break
            self.handler.handle_datagram(*found, now := self._monotonic())
            if now > ends_at:
                break
        self._guarded(self._look_after)
        if message := self._failures(self._monotonic()):
            _log.error(message)
        if taken == _AT_ONCE:
            time.sleep(_REST_S)

    def _guarded(self, step: Callable[[], None]) -> None:
        """An error about data of other programs is noted, and PANIC is heard."""
        try:
            step()
        except Exception as error:
            self.handler.note_failure("", error, self._monotonic())
            time.sleep(_REST_S)

    def _look_after(self) -> None:
        """Does what is due even if no datagram comes."""
        self._dispatch.exchange(self._monotonic())
        now = self._monotonic()
        self._count(now)
        self._follow_leader(now)
        self.handler.follow_stage(now)
        self._gestures.look(now)
        self._health.reported = self.handler.report(self.port.strangers, now)
        self._health.publish_health(now)
        self._feedback.look(self.handler.show_state, now)
        if now >= self._heartbeat.due:
            self._heartbeat.beat(self.handler.status(self.port.strangers, now), now)
        for descriptor in self._foreign.opened(now):
            self._poll.register(descriptor, select.POLLIN)
        for trouble in filter(None, (self.port.news(now), *self._foreign.news(now))):
            _log.warning(trouble)
        if news := self._news.look(self.handler.show_state, now):
            _log.info(news)

    def _follow_leader(self, now: float) -> None:
        """On a box of a pair that follows: declare what the other one has declared."""
        self.handler.follows = self._pair.follows(now)
        if self.handler.follows and (show_state := self._pair.state()) is not None:
            self.handler.follow_leader(show_state)

    def _count(self, now: float) -> None:
        """Tell of what came to the port and was not heard."""
        own, intake, port = self.observer.own, self._intake, self.port
        intake.note_kernel()
        own.follow(COMMANDS_DROPPED.name, intake.dropped, now)
        own.follow(LIVE_DROPPED.name, intake.live_dropped, now)
        own.follow(SENDER_NOT_LISTED.name, port.strangers, now)
        own.concern(SENDER_NOT_LISTED.name, filter(None, [port.newest_stranger]))

    def _failures(self, now: float) -> str:
        """A sentence about commands that ended in an error of this program, at most once a minute."""
        failed = self.handler.failed
        if failed == self._failures_said or now < self._failures_said_at + _SAY_EVERY_S:
            return ""
        self._failures_said, self._failures_said_at = failed, now
        return f"Show control met an error of this program ({failed} so far): {self.handler.failure}"

    def _answer(self, asker: Address, message: Message) -> None:
        """To the sender of a command, and to every listener that waits for replies elsewhere."""
        self.port.send(asker, message)
        self._replies.send(message, but=asker)

    def conclusion(self) -> str:
        """How many commands were refused, in a sentence; empty when none was."""
        refused = self.handler.refused
        return f"Commands: {refused} refused, the last one: {self.handler.reason}" if refused else ""

    def close(self) -> None:
        self._closing.close()

    def _sleep_s(self, now: float) -> float:
        if not self._intake.is_empty:
            return 0.0
        due = [self._heartbeat.due, self._dispatch.due(now), self.handler.acknowledgements.due(now)]
        longest_s = _FOLLOWING_SLEEP_S if self.handler.follows else _LONGEST_SLEEP_S
        longest_s = min(longest_s, self._gestures.sleeps_s)
        return max(min(*due, now + longest_s) - now, 0.0)


def control(settings: ControlSettings) -> int:
    """Show control until SIGTERM, Ctrl-C or a closed terminal; the exit status."""
    with _waking_stop_signals() as (ended, wake):
        process = ControlProcess(settings)
        try:
            process.run(ended, wake, Notifier())
        finally:
            process.close()
        if message := process.conclusion():
            _log.info(message)
    return 0


def _left_in_force(folder: Path, now: float) -> ShowState:
    """The show state of an earlier show control: panic stays panic."""
    with contextlib.closing(ShowStateReader(folder)) as reader:
        return reader.read().settled(now)


@contextmanager
def _waking_stop_signals() -> Iterator[tuple[Callable[[], bool], int]]:
    """While inside: whether one came, and a descriptor that can be read when one did."""
    reading, writing = socket.socketpair()
    for one in (reading, writing):
        one.setblocking(False)
    with reading, writing, stop_signals() as came:
        wake_before = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
        try:
            yield came, reading.fileno()
        finally:
            signal.set_wakeup_fd(wake_before)


def held_back(show_state: ShowState) -> str:
    """Why the audience sees nothing, and what lifts it; empty where nothing is held back."""
    if show_state.panic:
        return "Panic is in force: black, lights safe. /go lifts it."
    if not show_state.going:
        return "The show is stopped: dark. /go lets it go on."
    if show_state.blackout:
        return "Blackout is in force. /blackout 0 lifts it."
    return (
        ""
        if show_state[MASTER].value > 0.0
        else "Master is at 0 %: dark. /master 1 brings picture and lights back."
    )


class ConsoleMessages:
    """Tells each change once; of several within half a second the last."""

    def __init__(self, show_state: ShowState) -> None:
        self._said_at = float("-inf")
        self._held_back, self._cue = held_back(show_state), show_state.cue

    def look(self, show_state: ShowState, now: float) -> str:
        """A sentence when something is new; call it often."""
        held, cue = held_back(show_state), show_state.cue
        if (held, cue) == (self._held_back, self._cue) or now - self._said_at < _PAUSE_S:
            return ""
        messages = [f"Cue {cue}."] if cue and cue != self._cue else []
        if held != self._held_back:
            messages.append(held or "Picture and lights are back.")
        self._said_at, self._held_back, self._cue = now, held, cue
        return " ".join(messages)
