"""The soak: what it counts, when things happen, how it judges; and a short one with the whole box."""

from __future__ import annotations

import contextlib
import csv
import json
import signal
import socket
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from appliance.outputs.frame_reader import FrameReader
from hw_sim.peers import HOST
from hw_sim.soak.delays import Delays
from hw_sim.soak.desk import Desk
from hw_sim.soak.figures import limits_of, table
from hw_sim.soak.frames import FrameWatch
from hw_sim.soak.growth import growth
from hw_sim.soak.run import Soak
from hw_sim.soak.script import KILLS_UNTIL, script
from hw_sim.soak.unit import PAUSE_S, Unit
from hw_sim.soak.viewers import Viewers
from hw_sim.soak.vitals import Vitals
from hw_sim.soak.wakeups import Wakeups
from tests.bundles import write_show
from tests.system.processes import PATIENCE_S, wait_until

LATE_MS = 15.0


def frame(tick: int, deadline: float, late: bool = False, sequence: int = -1) -> bytes:
    """`/bunraku/frame ,iiiif` by hand."""
    second = int(deadline)
    numbers = tick, second, sequence, late, deadline - second
    return b"/bunraku/frame\0\0,iiiif\0\0" + struct.pack(">iiiif", *numbers)


class Stage:
    """Sends frames as a stage does."""

    def __init__(self, watch: FrameWatch) -> None:
        self._port = watch.port
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, tick: int, before_s: float = 0.0, late: bool = False, sequence: int = -1) -> float:
        """A frame whose deadline was `before_s` ago; how many ms later it left, at most."""
        now = time.monotonic()
        self._socket.sendto(frame(tick, now - before_s, late, sequence), (HOST, self._port))
        return 1000.0 * (time.monotonic() - now)

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def watch() -> Iterator[FrameWatch]:
    """The kernel stamps what comes: it begins with that some time after it was first asked to."""
    with contextlib.closing(FrameWatch(LATE_MS)) as watch, contextlib.closing(FrameWatch(LATE_MS)) as other:
        stage, until = Stage(other), time.monotonic() + PATIENCE_S
        while not other.heard or other.delays.worst_ms > 10.0:
            assert time.monotonic() < until, "the kernel stamps nothing"
            other.start(time.monotonic())
            stage.send(1)
            time.sleep(0.02)  # nobody reads
            other.poll(1.0)
        stage.close()
        yield watch


@pytest.fixture
def stage(watch: FrameWatch) -> Iterator[Stage]:
    with contextlib.closing(Stage(watch)) as stage:
        yield stage


def test_delays_are_counted_in_steps_and_long_ones_cost_whole_slots() -> None:
    delays = Delays()
    assert delays.percentile(50) is None
    for delay_ms in (0.04, 1.0, 1.04, 14.9, 15.1, 47.0, -3.0, 1e9):
        delays.add(delay_ms)
    assert delays.count == 8
    assert (delays.later_than(15.0), delays.later_than(-0.5), delays.later_than(-20.0)) == (3, 8, 8)
    assert delays.whole_slots() == 2 + 100  # of 47 ms two, of the endless one as many as are counted at all
    assert delays.percentile(50) == pytest.approx(1.0)
    assert delays.worst_ms == 1e9


def test_frames_are_counted_by_their_ticks_and_their_deadlines(watch: FrameWatch, stage: Stage) -> None:
    watch.start(time.monotonic())
    took_ms = {}
    for tick, before_s, late in ((10, 0.0, False), (11, 0.016, False), (12, 0.0, True), (15, 0.002, False)):
        took_ms[tick] = stage.send(tick, before_s, late)
        watch.poll(1.0)
    assert (watch.heard, watch.missing) == (4, 2)
    assert 2 <= watch.late <= 2 + sum(took_ms[tick] > LATE_MS - 3.0 for tick in (10, 15))
    assert 15.5 < watch.delays.worst_ms < 16.5 + max(took_ms.values())
    assert sum(watch.seconds.bad.values()) == watch.late + watch.missing


def test_a_frame_s_arrival_is_the_kernel_s_and_not_the_reader_s(watch: FrameWatch, stage: Stage) -> None:
    watch.start(time.monotonic())
    took_ms = stage.send(1)
    time.sleep(0.1)  # nobody reads
    watch.poll(1.0)
    assert watch.delays.worst_ms < took_ms + 50.0
    assert watch.late == (watch.delays.worst_ms > LATE_MS)


def test_a_stage_that_stopped_is_missing_at_the_end(watch: FrameWatch, stage: Stage) -> None:
    watch.start(time.monotonic())
    took_s = stage.send(1) / 1000.0
    now = time.monotonic()
    watch.poll(1.0)
    watch.end(now + 2.0)
    held_up_s = took_s + time.monotonic() - now
    assert 99 <= watch.missing <= 101 + 50 * held_up_s
    assert 1.99 < watch.longest_gap_s < 2.01 + held_up_s


def test_a_stage_that_begins_anew_is_counted_with_its_pause(watch: FrameWatch, stage: Stage) -> None:
    watch.start(time.monotonic())
    stage.send(500)
    watch.poll(1.0)
    time.sleep(0.1)
    stage.send(0)
    watch.poll(1.0)
    assert watch.stage_starts == 1
    assert watch.missing >= 4


def test_a_box_that_loses_its_sensors_is_noticed(watch: FrameWatch, stage: Stage) -> None:
    """Null: the frames go on, none of them late."""
    watch.start(began := time.monotonic())
    for tick, sequence in enumerate((-1, 3, 3, 4, 4, 4)):
        stage.send(tick, sequence=sequence)
    watch.poll(1.0)
    assert (watch.heard, watch.readings) == (6, 2)
    assert watch.without_reading_s(time.monotonic()) <= time.monotonic() - began
    assert watch.without_reading_s(time.monotonic() + 40.0) > 39.9


@contextlib.contextmanager
def soaked(tmp_path: Path) -> Iterator[Soak]:
    """A soak of 40 s in which all went well, and no process of the box was looked at."""
    box: Any = SimpleNamespace(units=[], sensors=Unit("sensors", ("true",), tmp_path / "output"))
    nothing: Any = None
    viewers = Viewers(0)
    viewers.visits, viewers.texts, viewers.frames = 3, 41, 1900
    with contextlib.closing(FrameWatch(LATE_MS)) as frames, contextlib.closing(Desk(1)) as desk:
        frames.start(1000.0)
        frames.heard, frames.readings, frames._reading_at = 2000, 1900, 1039.9
        frames.delays.add(4.0)
        desk.counts["done"] = 5
        soak = Soak(box, frames, Wakeups(), desk, nothing, viewers, nothing, 40.0, begun=1000.0, seconds=40.0)
        soak.universes = soak.timecodes = 9
        yield soak


def fails(soak: Soak) -> list[str]:
    return [limit.name for limit in limits_of(soak) if not limit.holds]


def test_a_soak_of_nothing_does_not_hold(tmp_path: Path) -> None:
    """Sensors, commands, lamps, browsers and load that never came are no evidence that the box bears them."""
    with soaked(tmp_path) as soak:
        assert fails(soak) == []
        soak.universes, soak.load_is_missing, soak.load_deaths = 0, True, 2
        soak.desk.counts["done"] = soak.timecodes = soak.viewers.texts = 0
        soak.box.sensors.deaths = 3
        soak.frames._reading_at = 1010.0
        assert fails(soak) == ["readings", "commands", "light", "timecode", "page", "load", "processes"]
        (died,) = [limit.found for limit in limits_of(soak) if limit.name == "processes"]
        assert died == "sensors ended 3 times, load ended 2 times"
        assert any("stress-ng is not there" in line for line in table(soak))


def test_a_slow_box_is_not_excused_by_the_machine(tmp_path: Path) -> None:
    """Its frames need 14 ms, so that any wake-up after 1 ms would have made one late."""
    with soaked(tmp_path) as soak:
        soak.frames.late = 100
        assert fails(soak) == ["late or missing ticks"]
        for _ in range(100):
            soak.wakeups.delays.add(1.5)
            soak.frames.delays.add(14.0)
        assert fails(soak) == ["usual lateness of a frame"]


def test_nobody_is_killed_in_the_second_half_and_everything_happens() -> None:
    acts = script(3600.0, ["control", "keeper", "lights"], 3, seed=1, load=True)
    kinds = Counter(act.kind for act in acts)
    assert set(kinds) == {"load", "network", "outage", "back", "guest", "command", "kill"}
    assert kinds["outage"] == kinds["back"]
    assert [act.at for act in acts] == sorted(act.at for act in acts)
    assert max(act.at for act in acts if act.kind == "kill") < KILLS_UNTIL * 3600.0
    assert {act.which for act in acts if act.kind == "kill"} == {"control", "keeper", "lights"}
    assert acts == script(3600.0, ["control", "keeper", "lights"], 3, seed=1, load=True)
    assert acts != script(3600.0, ["control", "keeper", "lights"], 3, seed=2, load=True)


def test_a_short_soak_has_the_same_acts_sooner() -> None:
    acts = script(30.0, ["control"], 3, seed=1, load=True)
    assert {act.kind for act in acts} >= {"load", "network", "outage", "guest", "command", "kill"}


def lived(tmp_path: Path, megabytes: list[float], handles: list[int]) -> Unit:
    unit = Unit("one", ("true",), tmp_path / "output")
    unit.history = [
        (float(second), Vitals(2 * mb, mb, count, 3))
        for second, (mb, count) in enumerate(zip(megabytes, handles, strict=True))
    ]
    return unit


def test_what_a_process_needs_at_first_is_no_growth(tmp_path: Path) -> None:
    start = [50.0 + second for second in range(60)]
    unit = lived(tmp_path, [*start, *[110.0] * 180, *[110.7] * 80], [9] * 320)
    grown = growth(unit, 320.0)
    assert grown is not None
    assert grown.own_mb == pytest.approx(1.4)
    assert grown.handles == 0


@pytest.mark.parametrize("peak_mb", [0.0, 60.0])
def test_a_leak_is_counted_whole_also_after_a_peak(tmp_path: Path, peak_mb: float) -> None:
    """2 MB an hour."""
    leak = [50.0 + 2.0 * second / 3600.0 + peak_mb * (600 <= second < 640) for second in range(3600)]
    grown = growth(lived(tmp_path, leak, [9] * 3600), 3600.0)
    assert grown is not None
    assert grown.own_mb == pytest.approx(2.0, abs=0.1)


def test_handles_that_come_and_go_are_no_leak_and_more_each_time_are(tmp_path: Path) -> None:
    breathing = [9 + second // 10 % 3 + (second == 390) for second in range(400)]
    steady = growth(lived(tmp_path, [50.0] * 400, breathing), 400.0)
    leaking = growth(lived(tmp_path, [50.0] * 400, [b + s // 130 for s, b in enumerate(breathing)]), 400.0)
    assert steady is not None
    assert leaking is not None
    assert steady.handles == 0
    assert leaking.handles > 0


def test_memory_that_comes_and_goes_is_no_leak_and_more_each_time_is(tmp_path: Path) -> None:
    """As a generator's: it is small until it makes its first phrase."""
    makes = [30.0] * 100 + [60.0 + 15.0 * (second // 20 % 3) for second in range(500)]
    steady = growth(lived(tmp_path, makes, [9] * 600), 600.0)
    leaking = growth(lived(tmp_path, [mb + 0.01 * s for s, mb in enumerate(makes)], [9] * 600), 600.0)
    assert steady is not None and leaking is not None
    assert steady.own_mb <= 0.0
    assert leaking.own_mb > 4.0


def test_the_longest_life_is_judged(tmp_path: Path) -> None:
    unit = lived(tmp_path, [50.0] * 240 + [53.0] * 160, [9] * 400)
    unit.longest, unit.history = unit.history, unit.history[:5]
    grown = growth(unit, 400.0)
    assert grown is not None
    assert grown.own_mb == pytest.approx(6.0)


def test_a_life_that_was_too_short_is_not_judged(tmp_path: Path) -> None:
    assert growth(lived(tmp_path, [50.0] * 65, [9] * 65), 3600.0) is None
    assert growth(lived(tmp_path, [], []), 3600.0) is None


def test_a_unit_is_started_again_and_only_unasked_ends_are_deaths(tmp_path: Path) -> None:
    unit = Unit("one", (sys.executable, "-c", "import time; time.sleep(60)"), tmp_path / "output")
    unit.update(0.0)
    first = unit.pid
    unit.kill()
    now, until = 1.0, time.monotonic() + PATIENCE_S
    while unit.starts < 2:
        assert time.monotonic() < until
        unit.update(now := now + PAUSE_S)
    assert unit.pid != first
    assert (unit.kills, unit.deaths) == (1, 0)
    unit.kill(signal.SIGTERM)  # as if it fell by itself
    while unit.starts < 3:
        assert time.monotonic() < until
        unit.update(now := now + PAUSE_S)
    assert (unit.kills, unit.deaths) == (1, 1)
    unit.end(5.0)
    assert unit.pid is None


@pytest.mark.realtime
def test_ended_early_it_gives_figures_verdict_picture_and_leaves_nobody_behind(tmp_path: Path) -> None:
    out, output = tmp_path / "out", tmp_path / "words.txt"
    show = write_show(tmp_path / "show")
    command = [sys.executable, "-m", "hw_sim.soak", "--minutes", "1", "--out", str(out), "--show", str(show)]
    with output.open("wb") as file:
        running = subprocess.Popen([*command, "--no-load"], stdout=file, stderr=subprocess.STDOUT)
    with contextlib.closing(FrameReader(Path(f"/dev/shm/bunraku-soak-{running.pid}"))) as frames:

        def has_danced() -> bool:
            assert running.poll() is None, output.read_text()
            newest = frames.newest(time.monotonic())
            return newest is not None and newest.tick > 250 and b"ticks" in output.read_bytes()

        wait_until(has_danced, output.read_text)
    running.send_signal(signal.SIGTERM)
    status = running.wait(PATIENCE_S)
    said = output.read_text()
    assert status in (0, 1), said  # 1: what is too short to tell does not hold
    assert "Verdict:" in said
    figures = json.loads((out / "soak.json").read_text())
    assert figures["is_over"]
    assert figures["planned_s"] == 60.0
    assert figures["frames"] > 100
    assert figures["slots"] == figures["frames"] + figures["missing"]
    assert figures["commands"]["done"] > 0
    assert figures["universes_of_light"] > 0 and figures["timecodes"] > 0
    assert figures["page"]["frames"] > 0
    assert figures["processes"]["stage"]["starts"] == 1
    assert all(limit["holds"] for limit in figures["limits"]) == (status == 0)
    machine = figures["cyclictest"]
    assert machine["complaint"] or machine["slots"] > 50
    with (out / "soak.csv").open() as file:
        seconds = list(csv.DictReader(file))
    assert len(seconds) >= 4
    assert float(seconds[-1]["stage_rss_mb"]) > 20.0
    assert (out / "soak.png").read_bytes().startswith(b"\x89PNG")
    left = subprocess.run(
        ["pgrep", "-f", str(out)], capture_output=True, text=True, check=False
    ).stdout.split()
    assert not left, left
