"""One process of the box, kept running as its unit keeps it: started again 0.2 s after each death."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

from hw_sim.soak.vitals import Vitals, vitals

PAUSE_S = 0.2  # RestartSec= of the units
UNAVAILABLE, RETRY_S = 69, 10.0  # what it needs is not here: no display
_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None)


class Unit:
    """`deaths`: ends without a kill. `history`: (monotonic seconds, resources) of this life only.
    `longest`: the same of the longest life before this one.

    `is_away`: it says that what it needs is not here. `priority`: real-time, where it can be had.
    """

    def __init__(
        self,
        name: str,
        command: Sequence[str],
        output: Path,
        environment: Mapping[str, str] = os.environ,
        priority: int | None = None,
    ) -> None:
        self.name, self.command, self.output = name, tuple(command), output
        self.starts = self.kills = self.deaths = 0
        self.is_away = False
        self.history: list[tuple[float, Vitals]] = []
        self.longest: list[tuple[float, Vitals]] = []
        self._environment = {**environment, "PYTHONUNBUFFERED": "1"}
        self._priority = priority
        self._process: subprocess.Popen[bytes] | None = None
        self._starts_at = 0.0
        self._was_killed = False

    @property
    def pid(self) -> int | None:
        """None while it is not running."""
        return None if self._process is None else self._process.pid

    def update(self, now: float) -> None:
        """Notice its end; start it when it is time to."""
        if self._process is not None and (status := self._process.poll()) is not None:
            self._process = None
            self.is_away = status == UNAVAILABLE
            self.deaths += not self._was_killed and not self.is_away
            self._was_killed = False
            self._starts_at = now + (RETRY_S if self.is_away else PAUSE_S)
        if self._process is None and now >= self._starts_at:
            self._start()

    def sample(self, now: float) -> Vitals | None:
        """Its present resources."""
        held = None if self._process is None else vitals(self._process.pid)
        if held is not None:
            self.history.append((now, held))
        return held

    def kill(self, number: signal.Signals = signal.SIGKILL) -> None:
        """As the kernel does when memory is short."""
        if self._process is not None:
            self._was_killed = number == signal.SIGKILL
            self.kills += self._was_killed
            self._process.send_signal(number)

    def ask_to_end(self) -> None:
        """As systemd does, even while it is stopped."""
        if self._process is not None:
            self._process.send_signal(signal.SIGCONT)
            self._process.terminate()

    def end(self, within_s: float) -> None:
        """Ask it to end, and make it."""
        self.ask_to_end()
        process, self._process = self._process, None
        if process is None:
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(within_s)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def replace(self, command: Sequence[str]) -> None:
        """Another command from now on, in place of this one."""
        self.end(2.0)
        self.command, self._starts_at = tuple(command), 0.0

    def _start(self) -> None:
        self.starts += 1
        self.longest, self.history = max(self.longest, self.history, key=len), []
        with self.output.open("ab") as output:
            self._process = subprocess.Popen(
                self.command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=self._environment,
                start_new_session=True,  # Ctrl-C is for the soak, which then ends them
                preexec_fn=_end_with_parent,
            )
        if self._priority is not None:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(self._process.pid, os.SCHED_FIFO, os.sched_param(self._priority))


def _end_with_parent() -> None:
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
