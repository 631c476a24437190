"""A sample of five seconds: how late this machine wakes a real-time thread, and what uses its processors."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from appliance.box.realtime import borrowed_priority

PERIOD_S = 0.005
SECONDS = 5.0
_BELOW = 1  # below the stage's priority, which never waits for this sample
_STEAL, _IRQ, _SOFTIRQ = 7, 5, 6  # columns of /proc/stat


@dataclass(frozen=True)
class Sample:
    """late_ms: of each wake-up, sorted. real_time: they ran in the real-time class, as the stage does.

    shares: (name, pid, processors used) of others, most first. interrupts, stolen: processors' worth of time
    (1.0 is one whole core).
    """

    late_ms: tuple[float, ...]
    shares: tuple[tuple[str, int, float], ...]
    interrupts: float
    stolen: float
    cores: int
    real_time: bool = True


def sample(priority: int, ours: frozenset[int]) -> Sample:
    """Measure for SECONDS. priority: the stage's. ours: the box's own processes, which are left out."""
    cores = os.cpu_count() or 1
    begun, before, all_before = time.monotonic(), _used(), _machine()
    late_ms, real_time = _wake_ups(max(1, priority - _BELOW))
    took_s, after, all_after = time.monotonic() - begun, _used(), _machine()
    tick = os.sysconf("SC_CLK_TCK") * took_s
    shares = [
        (name, pid, (ticks - before[pid][1]) / tick)
        for pid, (name, ticks) in after.items()
        if pid in before and pid not in ours
    ]
    used = [(now - then) / tick for then, now in zip(all_before, all_after, strict=True)]
    return Sample(
        late_ms=tuple(sorted(late_ms)),
        shares=tuple(sorted(shares, key=lambda one: -one[2])),
        interrupts=used[_IRQ] + used[_SOFTIRQ] if len(used) > _SOFTIRQ else 0.0,
        stolen=used[_STEAL] if len(used) > _STEAL else 0.0,
        cores=cores,
        real_time=real_time,
    )


def _wake_ups(priority: int) -> tuple[list[float], bool]:
    """How late each was, ms, as cyclictest measures it; and whether real-time priority was to be had."""
    late_ms = []
    with borrowed_priority(priority):
        real_time = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        due = time.monotonic()
        for _ in range(round(SECONDS / PERIOD_S)):
            due += PERIOD_S
            time.sleep(max(0.0, due - time.monotonic()))
            late_ms.append(1000.0 * (time.monotonic() - due))
            due = max(due, time.monotonic() - PERIOD_S)
    return late_ms, real_time


def _used() -> dict[int, tuple[str, int]]:
    """Process -> its name, ticks of processor time that it has used."""
    found = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                head, _, rest = (folder / "stat").read_text().rpartition(")")
                fields = rest.split()
            except OSError:
                continue
            found[int(folder.name)] = head.partition("(")[2], int(fields[11]) + int(fields[12])
    return found


def _machine() -> list[int]:
    """Ticks of all processors by kind: user, nice, system, idle, iowait, irq, softirq, steal ..."""
    return [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
