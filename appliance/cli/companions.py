"""Companions: show control, lights, projector: child processes of `bunraku play`, restarted when they die."""

from __future__ import annotations

import logging
import math
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from appliance.box.child import await_end, environment, start_child
from appliance.box.notify import ALIVE, ENDING, READY, NotifyListener
from appliance.box.parent_death import REPORTED

_log = logging.getLogger(__name__)

SHORTEST_PAUSE_S, LONGEST_PAUSE_S = 0.2, 2.0
UNAVAILABLE = 69  # sysexits.h: what it needs is not here, or not yet: a projector is switched on late
RETRY_S = 10.0
_LIVED_S = 10.0  # after a life of this length the shortest pause counts again
_REPORTED = 3  # deaths in a row that are reported one by one
_MOST_DOUBLINGS = 10  # doublings of the pause: beyond it is the longest one anyway
_LOOK_S = 0.1
READY_S = 30.0  # from its start to its first sign, as its unit has it
_STOOD_STILL_S = 1.0  # between two looks: this process itself was held up, and blames nobody for it
_OF_OURS = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID")  # a supervisor's of this process
_LAST_LINE_S = 0.3  # after SIGABRT, at which Python prints where it hangs
LAST_OUTPUT_S = 3.0


@dataclass(frozen=True)
class Companion:
    """One process beside the stage.

    meanwhile: a sentence, what is missing while it is away. may_close: the user may end it for good.
    descriptors: the open files that it inherits. watchdog_s: without a sign for this long it is killed.
    """

    name: str
    command: tuple[str, ...]
    meanwhile: str
    may_close: bool = False
    descriptors: tuple[int, ...] = ()
    watchdog_s: float = math.inf


class Companions:
    """A context: starts them in its own thread once `may_start` holds, and ends them with itself.

    The stage's first frame does not wait for them. They end by themselves when this process is killed.
    """

    def __init__(self, companions: Sequence[Companion], may_start: Callable[[], bool]) -> None:
        self._may_start = may_start
        try:
            self._listener: NotifyListener | None = NotifyListener()
        except OSError:  # no descriptor is left: unwatched is better than not at all
            self._listener = None
        self._running = [_Running(companion, self._listener) for companion in companions]
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._supervise, name="companions", daemon=True)

    def __enter__(self) -> Companions:
        if self._running:
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._closing.set()
        if self._running:
            self._thread.join()
        if self._listener is not None:
            self._listener.close()

    def _supervise(self) -> None:
        """Start all children from this thread: Linux ends them when the thread that started them ends."""
        while not self._may_start():
            if self._closing.wait(_LOOK_S / 4):
                return
        while True:
            for process, message in () if self._listener is None else self._listener.heard():
                for running in self._running:
                    running.note(process, message, time.monotonic())
            for running in self._running:
                running.check(time.monotonic())
            if self._closing.wait(_LOOK_S):
                break
        for running in self._running:
            running.request_end()
        until = time.monotonic() + LAST_OUTPUT_S
        for running in self._running:
            running.await_end(max(0.0, until - time.monotonic()))


class Backoff:
    """How long a companion that died waits for its next start."""

    def __init__(self) -> None:
        self.deaths = 0  # in a row

    def pause_s(self, lived_s: float) -> float:
        """The pause after a life of this length: doubled with each death in a row."""
        self.deaths = 1 if lived_s > _LIVED_S else self.deaths + 1
        return min(SHORTEST_PAUSE_S * 2.0 ** min(self.deaths - 1, _MOST_DOUBLINGS), LONGEST_PAUSE_S)


class _Running:
    """A companion and its process."""

    def __init__(self, companion: Companion, listener: NotifyListener | None) -> None:
        self._companion, self._listener = companion, listener
        self._silent_at = self._looked_at = self._killed_at = math.inf
        self._process: subprocess.Popen[bytes] | None = None
        self._started_at = 0.0
        self._starts_at = 0.0
        self._backoff = Backoff()
        self._reported: int | None = None
        self._is_over = False

    def check(self, now: float) -> None:
        """Start it when it is due; notice when it has died."""
        if self._process is not None and (status := self._process.poll()) is not None:
            self._process = None
            self._note_exit(status, now)
        if self._process is None and not self._is_over and now >= self._starts_at:
            self._start(now)
        elif self._process is not None:
            self._watch(self._process, now)

    def note(self, process: int, message: str, now: float) -> None:
        """A sign came from a process, perhaps from this one."""
        if self._process is None or self._process.pid != process:
            return
        lines = message.splitlines()
        if ENDING in lines:
            self._silent_at = math.inf
        elif READY in lines or ALIVE in lines:
            self._silent_at = now + self._companion.watchdog_s

    def _watch(self, process: subprocess.Popen[bytes], now: float) -> None:
        """Kill it where it hangs; its end is noticed like any other."""
        stood_still = now - self._looked_at > _STOOD_STILL_S
        self._looked_at = now
        if stood_still:
            self._silent_at = max(self._silent_at, now + self._companion.watchdog_s)
        elif now >= self._killed_at + _LAST_LINE_S:
            process.kill()
        elif now >= self._silent_at and self._killed_at == math.inf:
            self._killed_at = now
            process.send_signal(signal.SIGABRT)

    def request_end(self) -> None:
        if self._process is not None:
            self._process.terminate()

    def await_end(self, within_s: float) -> None:
        """Wait for its end; kill what does not end, and leave behind what hangs in the kernel."""
        if self._process is not None:
            await_end(self._process, within_s)

    def _start(self, now: float) -> None:
        self._started_at = self._looked_at = now
        is_watched = self._listener is not None and self._companion.watchdog_s < math.inf
        self._silent_at, self._killed_at = now + READY_S if is_watched else math.inf, math.inf
        try:
            self._process = start_child(
                self._companion.command,
                env=self._environment(),
                descriptors=self._companion.descriptors,
                has_own_session=True,  # Ctrl-C is for the box, which then ends them
            )
        except OSError as error:
            self._start_later(f"cannot be started ({error.strerror})", now)

    def _environment(self) -> dict[str, str]:
        reported = {} if self._reported is None else {REPORTED: str(self._reported)}
        watched: dict[str, str] = {}
        if self._listener is not None and self._companion.watchdog_s < math.inf:
            watched = self._listener.environ(self._companion.watchdog_s) | {"PYTHONFAULTHANDLER": "1"}
        inherited = {name: value for name, value in os.environ.items() if name not in _OF_OURS}
        return environment(inherited, **reported, **watched)

    def _note_exit(self, status: int, now: float) -> None:
        companion = self._companion
        if companion.may_close and status == 0:
            self._is_over = True
            _log.info(f"{companion.name} was closed. The dance goes on.")
        elif status == UNAVAILABLE:
            if self._reported is None:
                _log.warning(
                    f"{companion.name} cannot run now. The dance goes on without it; it is retried "
                    f"every {RETRY_S:g} s."
                )
            self._reported = status
            self._starts_at = now + RETRY_S
        elif self._killed_at < math.inf:
            self._start_later(f"hung: it gave no sign for {self._companion.watchdog_s:g} s", now)
        elif status < 0:
            self._start_later(f"was killed (signal {-status})", now)
        else:
            self._start_later(f"ended by itself (status {status})", now)

    def _start_later(self, what: str, now: float) -> None:
        self._reported = None
        self._starts_at = now + self._backoff.pause_s(now - self._started_at)
        deaths = self._backoff.deaths
        if deaths <= _REPORTED:
            _log.warning(f"{self._companion.name} {what}. {self._companion.meanwhile} It is restarted.")
        elif deaths == _REPORTED + 1:
            _log.error(
                f"{self._companion.name} {what}, {deaths} times in a row. {self._companion.meanwhile} "
                f"It is retried every {LONGEST_PAUSE_S:g} s. Its messages above say why."
            )
