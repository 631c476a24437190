"""cyclictest beside the box: how late this machine wakes a thread of the same rank that does nothing."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess

from hw_sim.soak.delays import SLOT_MS, Delays, Seconds

PRIORITY = 70  # the stage's
PERIOD_US = 20_000  # the stage's
_NO_WISH_US = 1_000_000  # else it keeps the processor from sleeping deeply, and the box would profit
_LAST_OUTPUT_S = 5.0


class Wakeups:
    """Runs cyclictest (Debian package rt-tests) with the stage's priority and period, and counts."""

    def __init__(self) -> None:
        self.delays, self.seconds = Delays(), Seconds()
        self._rest = b""
        self._begun = 0.0
        self._process: subprocess.Popen[bytes] | None = None
        self.complaint = ""
        if shutil.which("cyclictest") is None:
            self.complaint = "cyclictest is not there. Install it: sudo apt-get install -y rt-tests"

    def start(self, now: float) -> None:
        """Start it; seconds of the run count from `now`, monotonic."""
        self._begun = now
        if self.complaint:
            return
        self._process = subprocess.Popen(
            [
                *(("stdbuf", "-oL") if shutil.which("stdbuf") else ()),
                *("cyclictest", "--policy=fifo", f"-p{PRIORITY}", f"-i{PERIOD_US}", "-d0", "-t1", "-m", "-v"),
                f"--latency={_NO_WISH_US}",
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)

    def poll(self, now: float) -> None:
        """Take what it has said: a line `thread: number: microseconds` for each time it woke."""
        process = self._process
        if process is None or process.stdout is None:
            return
        with contextlib.suppress(BlockingIOError):
            while data := os.read(process.stdout.fileno(), 65536):
                self._take(data, now)
        if process.poll() is not None and not self.complaint:
            message = self._rest.decode(errors="replace").strip() or f"status {process.returncode}"
            self.complaint = f"cyclictest ended by itself ({message}). It needs real-time rights: be root."

    def later_than(self, limit_ms: float) -> int:
        """How many of its wake-ups came later than this, and slots that it slept through."""
        return self.delays.later_than(limit_ms) + self.delays.whole_slots()

    @property
    def slots(self) -> int:
        """How many moments there were at which it should have woken: after a long sleep it skips some."""
        return self.delays.count + self.delays.whole_slots()

    def close(self) -> None:
        """End it."""
        if self._process is None:
            return
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_LAST_OUTPUT_S)
        self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _take(self, data: bytes, now: float) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            parts = line.split(b":")
            if len(parts) == 3 and parts[2].strip().isdigit():
                delay_ms = int(parts[2]) / 1000.0
                self.delays.add(delay_ms)
                self.seconds.note(int(now - self._begun), delay_ms, int(delay_ms > SLOT_MS / 2))
