"""The real box over real sockets: it dances at 50 Hz, ends on a signal, and survives bad datagrams."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pythonosc.udp_client import SimpleUDPClient

from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import read_journal
from appliance.recorder.record import LATE, NOT_FINITE
from hw_sim.peers import HOST, free_ports
from tests.bundles import write_show
from tests.system.box import JOURNAL, PLAY, Box, is_free, playing
from tests.system.processes import PATIENCE_S, run, wait_until

pytestmark = pytest.mark.realtime

# Drops the rights that a box needs for real time, also root's, and becomes the box.
WITHOUT_RIGHTS = (
    sys.executable,
    "-c",
    "import ctypes, os, resource, sys\n"
    "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))\n"
    "resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))\n"
    "for capability in (14, 23): ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)\n"
    f"os.execv({sys.executable!r}, [{sys.executable!r}, '-m', 'appliance.cli', 'play', *sys.argv[1:]])",
)
WITHOUT_TORCH = (
    sys.executable,
    "-c",
    "import sys\n"
    "for name in ('torch', 'onnx', 'hw_sim', 'appliance.studio'): sys.modules[name] = None\n"
    "from appliance.cli.app import main\n"
    "main(['play', *sys.argv[1:]])",
)


def test_frames_leave_on_a_grid_of_20_ms_and_carry_the_readings(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, settings=JOURNAL) as box, box.wearables():
        box.frame_that(lambda frame: frame[2] > 20)
        frames = box.frames(100)
        box.await_output("Hz  tick")
        assert box.end() == 0
    numbers = [frame[0] for frame in frames]
    assert numbers == sorted(set(numbers))
    ticks = read_journal(tmp_path / "run.journal").ticks
    periods = np.diff(ticks["frame_time"]) / np.diff(ticks["tick"])
    assert np.abs(periods - 0.02).max() <= 0.0002 + 1e-9  # the grid holds on a busy machine too
    assert max(frame[2] for frame in frames) > 20
    assert "left-wrist holds lShldr" in box.output


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_in_the_middle_ends_the_dance_cleanly(show: Path, tmp_path: Path, number: int) -> None:
    with playing(show, tmp_path) as box:
        box.frames(20)
        assert not is_free(box.sensors)
        assert box.end(number) == 0
        assert is_free(box.sensors)
        assert is_free(box.control)
        assert "Danced" in box.output
        assert "Traceback" not in box.output


def test_ends_by_itself_after_its_seconds(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, "--seconds", "0.5") as box:
        assert box.process.wait(PATIENCE_S) == 0
    assert "Danced" in box.output


@pytest.mark.parametrize("taken", ["sensors", "control"])
def test_a_port_that_is_taken_is_named_with_what_to_do(show: Path, tmp_path: Path, taken: str) -> None:
    with playing(show, tmp_path) as first:
        first.frames(1)
        [other] = free_ports(1)
        ports = {"sensors": other, "control": other, taken: getattr(first, taken)}
        second = tmp_path / "second"
        second.mkdir()
        settings = {
            "sensors": {"udp": {"host": HOST, "port": ports["sensors"]}},
            "control": {"host": HOST, "port": ports["control"]},
        }
        with playing(show, second, settings=settings) as refused:
            assert refused.process.wait(PATIENCE_S) == 2
            assert f"UDP port {ports[taken]}" in refused.output
            assert "second bunraku" in refused.output
            assert "Traceback" not in refused.output
        first.frames(5)


def test_a_missing_receiver_does_not_disturb_the_other(show: Path, tmp_path: Path) -> None:
    [unused] = free_ports(1)
    with playing(show, tmp_path, more_receivers=[{"host": HOST, "port": unused}]) as box:
        frames = box.frames(120)
        box.await_output(f"{HOST}:{unused} (ai-toolbox) does not get the dance")
        assert box.end() == 0
    assert len({frame[0] for frame in frames}) == len(frames)


def test_without_real_time_rights_it_dances_and_says_what_that_costs(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, command=WITHOUT_RIGHTS) as box:
        box.frames(20)
        assert box.end() == 0
    assert "No real-time priority" in box.output
    assert "Memory is not locked" in box.output


def test_the_whole_box_runs_where_torch_and_the_simulation_cannot_be_imported(
    show: Path, tmp_path: Path
) -> None:
    with playing(show, tmp_path, command=WITHOUT_TORCH) as box:
        box.frames(20)
        assert box.end() == 0, box.output


def test_a_flood_of_bad_datagrams_moves_nothing(
    show: Path, tmp_path: Path, rng: random.Random, long_run: bool
) -> None:
    lengths = [0, 1, 3, 20, 45, 60, 400, 1400]
    bad = [rng.randbytes(rng.choice(lengths)) for _ in range(1000)]
    with playing(show, tmp_path, settings=JOURNAL) as box, box.wearables():
        box.frame_that(lambda frame: frame[2] > 20)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flood:
            for number in range(100_000 if long_run else 30_000):
                flood.sendto(bad[number % len(bad)], (HOST, box.sensors))
        before = box.frames(1)[-1][2]
        box.frame_that(lambda frame: frame[2] > before)  # readings arrive again
        box.frames(50)
        assert box.end() == 0
    assert "Traceback" not in box.output
    ticks = read_journal(tmp_path / "run.journal").ticks
    assert not (ticks["flags"] & NOT_FINITE).any()
    assert np.isfinite(ticks["pose"]).all()
    assert float(np.median(ticks["sections_ms"].sum(axis=1))) < 20.0
    assert "refused" in box.output  # counted, and reported at the end


def test_a_network_that_gives_no_numbers_holds_the_last_good_pose(tmp_path: Path) -> None:
    fragile = write_show(tmp_path / "show", network="fragile")
    with playing(fragile, tmp_path, settings=JOURNAL) as box:
        box.frames(30)
        SimpleUDPClient(HOST, box.control).send_message("/iterations", [7, 6])
        box.await_output("holds the last good pose")
        box.frames(30)
        assert box.end() == 0
    ticks = read_journal(tmp_path / "run.journal").ticks
    in_time, fails = (ticks["flags"] & LATE) == 0, ticks["iterations"][:, 0, 0] == 7
    failed = (ticks["flags"] & NOT_FINITE) != 0
    assert failed[in_time & fails].all() and not failed[~fails].any() and fails.sum() > 20
    assert np.isfinite(ticks["pose"]).all()
    assert "network not finite" in box.output


def test_commands_change_the_running_show(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, settings=JOURNAL) as box:
        box.frames(30)
        client = SimpleUDPClient(HOST, box.control)

        def send_commands() -> None:
            client.send_message("/player/stop", [])
            client.send_message("/iterations", [5, 4])
            client.send_message("/mocap/setjointrot", ["Chest", 1.0, 0.0, 0.0, 1.0])
            box.frames(20)

        wait_until(
            lambda: "No hand of this show holds 'Chest' by OSC" in box.output,
            lambda: box.output,
            send_commands,
        )
        box.receiver.poll()
        box.frames(80)
        assert box.end() == 0
    ticks = read_journal(tmp_path / "run.journal").ticks
    assert ticks["iterations"][-1].tolist() == [[5, 4]]
    np.testing.assert_array_equal(ticks["pose"][-1], ticks["pose"][-2])  # the phrase stands still


def test_a_killed_box_leaves_a_journal_that_can_be_read(show: Path, tmp_path: Path) -> None:
    journal = tmp_path / "run.journal"
    with playing(show, tmp_path, settings=JOURNAL) as box:
        box.frames(1)
        await_journal(journal, 0)
        frames = box.frames(60)
        assert box.end(signal.SIGKILL) == -signal.SIGKILL
        frames += box.last_frames()
    # A tick is recorded after its frame has left: only the tick of the kill may be missing.
    *_, before, _ = (frame[0] for frame in frames)
    ticks = await_journal(journal, before)["tick"].tolist()
    assert {frame[0] for frame in frames[:-1]} <= set(ticks)


def await_journal(path: Path, tick: int) -> np.ndarray:
    """Its ticks, once it has this one: the keeper of a killed box writes for a moment longer."""

    def has_tick() -> bool:
        with contextlib.suppress(JournalError):
            found = read_journal(path).ticks
            return len(found) > 0 and found["tick"][-1] >= tick
        return False

    wait_until(has_tick, f"tick {tick} never came to the disk")
    return read_journal(path).ticks


def test_emulated_sensors_come_and_go_with_the_run(
    show: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # a killed box leaves its folder behind
    picture = tmp_path / "dance.png"
    with playing(show, tmp_path, "--emulate", "--filmstrip", str(picture)) as box:
        box.frame_that(lambda frame: frame[2] > 5)
        box.frames(100)
        assert box.end() == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert str(picture) in box.output
    assert not emulators_at(box)


def test_a_killed_box_leaves_no_emulator_behind(
    show: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with playing(show, tmp_path, "--emulate") as box:
        box.frame_that(lambda frame: frame[2] > 5)
        assert emulators_at(box)
        box.process.kill()
        wait_until(lambda: not emulators_at(box))


def emulators_at(box: Box) -> list[str]:
    """Command lines of running emulators that send to the box's port."""
    running = run(["ps", "-ww", "-eo", "args"], check=True).stdout.splitlines()
    return [line for line in running if f"--port {box.sensors}" in line]


def test_a_closed_output_does_not_stop_the_dance(show: Path, tmp_path: Path) -> None:
    reading, writing = os.pipe()
    command = [*PLAY, "--show", str(show), "--box", str(tmp_path / "box.yaml"), "--seconds", "3"]
    with playing(show, tmp_path) as box:
        box.frames(1)
        assert box.end() == 0
        os.close(reading)
        process = subprocess.Popen(command, stdout=writing, stderr=subprocess.DEVNULL)
        os.close(writing)
        try:
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()
            process.wait()
