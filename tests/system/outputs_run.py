"""The long run: all outputs of a real box at once, each counted by its receiver; memory and handles watched.

`python -m tests.system.outputs_run --minutes 10 --report out/outputs` runs it and writes outputs.json; exit
status 1 if frames are missing, lamps do not follow, or a process grows or ends. A test runs it for seconds.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path
from tests.system.processes import wait_until
from tests.system.venue import LAMPS, Venue, venue

SETTLED_SHARE = 0.2  # of the run: growth before that is start-up
MOST_GROWTH_MB, MOST_HANDLES = 6.0, 2
LOOK_S, FEWEST_LOOKS = 1.0, 5
HEARD_S = 1.0  # a lamp may show a height of the joint that is this old
FOLLOWED_SHARE = 0.9  # of the samples: lights or olad may be held up for longer than that
OFF_BY = 3  # of 255: rounding, and the height between two frames
LAST_FRAME_S = 5.0
STALL_S, NAP_S = 0.02, 0.005


@dataclass
class Heard:
    """What one receiver got: ticks in order of arrival, and how many were marked late."""

    ticks: list[int] = field(default_factory=list)
    late: int = 0

    @property
    def missing(self) -> int:
        """Ticks between the first and the last that never arrived."""
        return max(self.ticks) - min(self.ticks) + 1 - len(set(self.ticks)) if self.ticks else 0


class Stalls:
    """How long this machine delays a thread that only naps: its own share in late frames."""

    def __init__(self) -> None:
        self.count, self.worst_s = 0, 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._nap, daemon=True)
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()

    def _nap(self) -> None:
        while not self._ended.is_set():
            before = time.monotonic()
            time.sleep(NAP_S)
            over_s = time.monotonic() - before - NAP_S
            self.count += over_s > STALL_S
            self.worst_s = max(self.worst_s, over_s)


class Measurement:
    """One run: receives, samples once a second, and gives figures at the end."""

    def __init__(self, running: Venue) -> None:
        self._venue = running
        self._heard = {name: Heard() for name in running.osc}
        names = read_bvh(default_show_path() / "skeleton.bvh", metres_per_unit=0.01).skeleton.names
        self._lamps = {universe: (names.index(joint), full) for universe, (joint, full) in LAMPS.items()}
        self._heights: dict[int, deque[tuple[float, float]]] = {u: deque() for u in LAMPS}
        self._frames: list[int] = []  # PosiStageNet's, each once
        self.lamps = {universe: {"looks": 0, "followed": 0, "levels": set[int]()} for universe in LAMPS}
        self.memory_mb: dict[str, list[float]] = {}
        self.handles: dict[str, list[int]] = {}

    def await_dance(self) -> None:
        """Wait until all of it runs: frames at every receiver, lamps lit, projector and sensor at work."""
        is_ready: dict[str, bool] = {}

        def output() -> str:
            outputs = [f"{name}: {self._venue.output(name)}" for name in ("stage", "sensor", "projector")]
            return "\n".join([str(is_ready), *outputs])

        def all_ready() -> bool:
            self.receive(0.1)
            is_ready.update(
                frames=all(heard.ticks for heard in self._heard.values()) and bool(self._frames),
                processes={"control", "lights"} <= self._venue.pids().keys(),
                lamps=all(self._follows(self._level(universe), universe) for universe in LAMPS),
                sensor="neutral pose taken" in self._venue.output("stage"),
                picture=self._is_picture_there(self._venue.output("projector")),
            )
            ended = [name for name, process in self._venue.processes.items() if process.poll() is not None]
            assert not ended, f"{ended} ended: {output()}"
            return all(is_ready.values())

        wait_until(all_ready, output)

    @staticmethod
    def _is_picture_there(said: str) -> bool:
        """Without a graphics card the projector says so after some pictures of the dance."""
        return "The picture is" in said and ("llvmpipe" not in said or "No graphics card draws here" in said)

    def run(self, seconds: float) -> None:
        """Receive and sample for this long, longer on a machine so busy that it had few looks."""
        end = time.monotonic() + seconds
        look_at, looks = 0.0, 0
        while (now := time.monotonic()) < end or looks < FEWEST_LOOKS:
            self.receive(0.02)
            if now >= look_at:
                look_at, looks = now + LOOK_S, looks + 1
                self._sample_lamps()
                self._sample_processes()

    def receive(self, wait_s: float) -> None:
        """Take what has arrived at the receivers."""
        for name, receiver in self._venue.osc.items():
            for arrival, address, arguments in receiver.poll(wait_s):
                if address == "/bunraku/frame":
                    self._heard[name].ticks.append(int(str(arguments[0])))
                    self._heard[name].late += bool(arguments[3])
                elif address.endswith("/pos_world"):
                    self._note_heights(arrival, arguments)
            wait_s = 0.0
        for packet in self._venue.positions.poll():
            if packet.is_data and (not self._frames or packet.frame != self._frames[-1] % 256):
                step = (packet.frame - self._frames[-1]) % 256 if self._frames else 0
                self._frames.append(self._frames[-1] + step if self._frames else packet.frame)

    def figures(self, seconds: float, statuses: dict[str, int], stalls: Stalls) -> dict[str, Any]:
        """All figures, for JSON, once the stage has ended and every receiver had time for the last frame."""
        until = time.monotonic() + LAST_FRAME_S
        self.receive(0.2)
        heard = {**self._heard, "oscdump": _dumped(self._venue.dump)}
        while len({one.ticks[-1] for one in heard.values() if one.ticks}) > 1 and time.monotonic() < until:
            self.receive(0.2)
            heard["oscdump"] = _dumped(self._venue.dump)
        receivers = {
            name: {
                "frames": len(one.ticks),
                "missing": one.missing,
                "late": one.late,
                "lost": self._venue.lost(name),
            }
            for name, one in {**heard, "PosiStageNet": Heard(self._frames)}.items()
        }
        malformed = sum(one.malformed for one in (*self._venue.osc.values(), self._venue.positions))
        return {
            "seconds": round(seconds, 1),
            "receivers": receivers,
            "malformed": malformed,
            "lamps": {
                str(universe): {**lamp, "levels": len(lamp["levels"])}
                for universe, lamp in self.lamps.items()
            },
            "memory_mb": {name: _ends(values) for name, values in self.memory_mb.items()},
            "handles": {name: _ends(values) for name, values in self.handles.items()},
            "projector": self._venue.output("projector").strip().splitlines()[-1],
            "stage": [line for line in self._venue.output("stage").splitlines() if line.startswith("Danced")],
            "statuses": statuses,
            "stalls_over_20_ms": stalls.count,
            "worst_stall_ms": round(1e3 * stalls.worst_s, 1),
        }

    def _note_heights(self, arrival: float, arguments: list[Any]) -> None:
        for universe, (joint, full) in self._lamps.items():
            heights = self._heights[universe]
            heights.append((arrival, min(max(arguments[3 * joint + 1] / full, 0.0), 1.0)))
            while heights[0][0] < arrival - HEARD_S:
                heights.popleft()

    def _sample_lamps(self) -> None:
        """Note whether each lamp shows a recent height of its joint."""
        for universe, lamp in self.lamps.items():
            level = self._level(universe)
            lamp["looks"] += 1
            lamp["followed"] += self._follows(level, universe)
            lamp["levels"].add(level)

    def _level(self, universe: int) -> int:
        return self._venue.daemon.levels(universe)[0]

    def _follows(self, level: int, universe: int) -> bool:
        self.receive(0.0)
        shares = [255.0 * share for _, share in self._heights[universe]]
        return bool(shares) and min(shares) - OFF_BY <= level <= max(shares) + OFF_BY

    def _sample_processes(self) -> None:
        for name, pid in self._venue.pids().items():
            try:
                status = Path(f"/proc/{pid}/status").read_text()
                open_files = sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
            except OSError:
                continue  # it has ended: its exit status tells
            resident = re.search(r"VmRSS:\s+(\d+)", status)
            self.memory_mb.setdefault(name, []).append(int(resident[1]) / 1024 if resident else 0.0)
            self.handles.setdefault(name, []).append(open_files)


def faults(figures: dict[str, Any], judge_growth: bool = True) -> list[str]:
    """What is wrong; empty when all is well. Growth cannot be judged in a run of seconds.

    Not counted as missing: slots that the stage skipped because this machine stood still, and datagrams that
    the kernel dropped because the receiver's socket was full.
    """
    skipped = sum(int(number) for line in figures["stage"] for number in re.findall(r"skipped (\d+)", line))
    found = [
        f"{name}: {one['missing']} of {one['frames']} frames missing, {skipped} skipped by the stage, "
        f"{one['lost']} datagrams lost here"
        for name, one in figures["receivers"].items()
        if one["missing"] > skipped + one["lost"] or not one["frames"]
    ]
    found += [
        f"lamp {name}: followed in {lamp['followed']} of {lamp['looks']} looks, {lamp['levels']} levels"
        for name, lamp in figures["lamps"].items()
        if lamp["followed"] < FOLLOWED_SHARE * lamp["looks"] or lamp["levels"] < 2
    ]
    found += [f"{name} ended with status {status}" for name, status in figures["statuses"].items() if status]
    if figures["malformed"]:
        found.append(f"{figures['malformed']} datagrams malformed")
    for what, most in (("memory_mb", MOST_GROWTH_MB), ("handles", MOST_HANDLES)):
        for name, (start, end) in figures[what].items():
            if judge_growth and end - start > most:
                found.append(f"{name}: {what} grew from {start:g} to {end:g}")
    return found


def measure(seconds: float, folder: Path, picture: str = "320x180") -> dict[str, Any]:
    """Build the venue, run it, end it, and return the figures."""
    stalls = Stalls()
    with venue(folder, picture) as running:
        measurement = Measurement(running)
        measurement.await_dance()
        begun = time.monotonic()
        measurement.run(seconds)
        lasted = time.monotonic() - begun
        stalls.end()
        return measurement.figures(lasted, running.end(), stalls)


def table(figures: dict[str, Any]) -> list[str]:
    """The figures as lines of text."""
    lines = [f"{figures['seconds']:g} s"]
    lines += [f"  {name:<14} {one}" for name, one in figures["receivers"].items()]
    lines += [f"  lamp {name:<9} {lamp}" for name, lamp in figures["lamps"].items()]
    for name, (start, end) in figures["memory_mb"].items():
        handles = figures["handles"][name]
        lines.append(f"  {name:<14} {start:.1f} to {end:.1f} MB, {handles[0]:g} to {handles[1]:g} handles")
    lines += [f"  {figures['projector']}", *(f"  {line}" for line in figures["stage"])]
    stalls = f"{figures['stalls_over_20_ms']} stalls over 20 ms, the worst {figures['worst_stall_ms']:g} ms"
    return [*lines, f"  the machine itself: {stalls}"]


def _dumped(file: Path) -> Heard:
    """The real oscdump's output: address, type tags, tick, second, sequence, late, its rest."""
    heard = Heard()
    for line in file.read_text().splitlines():
        if found := re.search(r"/bunraku/frame \S+ (\d+) \d+ -?\d+ (\d) [\d.]+$", line.strip()):
            heard.ticks.append(int(found[1]))
            heard.late += int(found[2])
    return heard


def _ends(values: list[float] | list[int]) -> tuple[float, float]:
    """The value once settled and at the end: medians of a tenth of the run each."""
    few = max(1, len(values) // 10)
    settled = values[int(SETTLED_SHARE * len(values)) :]
    return round(median(settled[:few]), 1), round(median(values[-few:]), 1)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--report", type=Path, help="folder for outputs.json")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        figures = measure(60.0 * options.minutes, Path(name))
    wrong = faults(figures)
    print("\n".join([*table(figures), *([f"FAIL  {message}" for message in wrong] or ["ok"])]))
    if options.report is not None:
        options.report.mkdir(parents=True, exist_ok=True)
        report = json.dumps({**figures, "faults": wrong}, indent=2)
        (options.report / "outputs.json").write_text(report + "\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
