"""A preflight that meets crashes, hangs, power cuts or another preflight still chooses a whole show."""

from __future__ import annotations

import os
import random
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from appliance.box.durable import alone_in
from appliance.cli import candidate
from appliance.cli import preflight as commands
from appliance.cli.preflight import candidate_problems, preflight
from appliance.cli.run_with_timeout import TimedOutError, run_with_timeout
from appliance.release.choice import APPLIANCE_BOX, CHOSEN, EMBEDDED_SHOW, Choice
from appliance.show.bundle import checksum_problems
from tests.system.box_folders import PATIENCE_S, PREFLIGHT, Machine


def test_the_show_that_danced_before_is_chosen_before_anything_new_is_read(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.bring("Spring")
    machine.preflight()
    (machine.run / CHOSEN).unlink()
    seen: list[Choice | None] = []

    def broken(source: str, folder: Path) -> None:
        seen.append(Choice.read(machine.run / CHOSEN))
        raise RecursionError("an unforeseen error")

    monkeypatch.setattr(commands, "look", broken)
    said: list[str] = []
    assert preflight(machine.options._replace(stick=machine.stick / "none"), said.append, 10.0) == 0
    assert seen[0] is not None and seen[0].first == machine.choice.first
    assert machine.dances == "Spring"
    assert "an unforeseen error" in said[0] and said[0] in machine.choice.refused


def test_a_preflight_that_never_ends_blocks_no_other(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine.bring("Spring")
    machine.preflight()
    (machine.run / CHOSEN).unlink()
    monkeypatch.setattr(commands, "TURN_S", 0.1)
    said: list[str] = []
    with alone_in(machine.data):
        assert preflight(machine.options, said.append, 10.0) == 0
    assert "Another preflight has not ended" in said[0]
    assert machine.dances == "Spring"


def test_two_preflights_at_once_take_turns(machine: Machine) -> None:
    machine.bring("Spring")
    both = [
        subprocess.Popen([*PREFLIGHT, *machine.arguments, *more], stdout=subprocess.DEVNULL)
        for more in ((), ("--late",))
    ]
    try:
        assert [process.wait(PATIENCE_S) for process in both] == [0, 0]
    finally:
        for process in both:
            process.kill()
            process.wait()
    assert machine.preflight().returncode == 0
    assert machine.dances == "Spring"
    assert not [path for path in machine.data.rglob("*") if ".part" in path.name]


def test_a_check_that_takes_all_memory_ends_alone(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise systemd would end the preflight with it: both belong to one unit."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    monkeypatch.setattr(candidate, "verified_parts", lambda show, box: bytearray(memory // 2))

    def check() -> bytes:
        return str(candidate.main("show", "box")).encode()

    assert run_with_timeout(60.0, check) == b"1"


def test_a_power_cut_at_any_moment_leaves_whole_shows_alone(machine: Machine, rng: random.Random) -> None:
    """Killed while it copies, checks or writes; the next preflight chooses a whole show."""
    machine.bring("Spring")
    machine.preflight()
    for number in range(8):
        machine.bring(f"Summer {number}")
        with subprocess.Popen([*PREFLIGHT, *machine.arguments], stdout=subprocess.DEVNULL) as process:
            time.sleep(rng.uniform(0.02, 1.2))
            process.send_signal(signal.SIGKILL)
        for pair in (Choice.read(machine.data / CHOSEN) or Choice()).pairs:
            assert not checksum_problems(pair.show)
    assert machine.preflight().returncode == 0
    assert machine.dances == "Summer 7"


def replace_checker(folder: Path, monkeypatch: pytest.MonkeyPatch, does: str) -> None:
    """Let a shell command stand in for the interpreter that checks a show."""
    script = folder / "python"
    script.write_text(f"#!/bin/sh\n{does}\n")
    script.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(script))


def test_a_check_that_crashes_refuses_the_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace_checker(tmp_path, monkeypatch, "kill -SEGV $$")
    assert "crashed (signal 11)" in candidate_problems(tmp_path, APPLIANCE_BOX)[0]


def test_a_check_that_hangs_refuses_the_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace_checker(tmp_path, monkeypatch, "exec sleep 60")
    monkeypatch.setattr(commands, "CHECK_S", 0.2)
    assert "did not end" in candidate_problems(tmp_path, APPLIANCE_BOX)[0]


def test_a_stick_that_hangs_is_given_up(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine.bring("Spring")
    monkeypatch.setattr(commands, "look", lambda source, folder: time.sleep(60))
    monkeypatch.setattr(commands, "STICK_S", 0.2)
    said: list[str] = []
    assert preflight(machine.options, said.append, 10.0) == 0
    assert "could not be read (not within 0.2 s)" in said[0]
    assert machine.choice.first.show == EMBEDDED_SHOW


def crash() -> bytes:
    os.kill(os.getpid(), signal.SIGSEGV)
    return b""


def test_a_crash_ends_the_wait_at_once() -> None:
    with pytest.raises(TimedOutError, match="crashed"):
        run_with_timeout(60.0, crash)


def test_a_timeout_ends_all_processes_that_were_started() -> None:
    reading, writing = os.pipe()
    os.set_inheritable(writing, True)

    def endless() -> bytes:
        with subprocess.Popen(["sleep", "600"], close_fds=False) as sleeper:
            sleeper.wait()
        return b""

    with pytest.raises(TimedOutError, match="not within"):
        run_with_timeout(0.5, endless)
    os.close(writing)
    assert select.select([reading], [], [], PATIENCE_S)[0], "a process still holds the other end"
    assert os.read(reading, 1) == b""
    os.close(reading)
