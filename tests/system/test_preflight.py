"""The preflight as a process: real shows from a stick, checked and chosen; crashes, hangs and power cuts."""

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
from appliance.cli.preflight import ANEW, Options, candidate_problems, preflight
from appliance.cli.run_with_timeout import TimedOutError, run_with_timeout
from appliance.dancer.phrase_cache import FOLDER, SUFFIX
from appliance.release.choice import APPLIANCE_BOX, CHOSEN, EMBEDDED_SHOW, Choice
from appliance.show.box import load_box
from appliance.show.bundle import checksum_problems, write_checksums
from appliance.show.show import load_show
from tests.bundles import write_show
from tests.system.processes import run

PATIENCE_S = 120.0
PREFLIGHT = (sys.executable, "-m", "appliance.cli.preflight")
HEAVY = {
    *("numpy", "onnxruntime", "yaml", "pydantic", "typer"),
    *("argparse", "subprocess", "dataclasses", "hashlib"),
}


def choice_in(folder: Path) -> Choice:
    """The choice that a preflight has left in a folder."""
    choice = Choice.read(folder / CHOSEN)
    assert choice is not None
    return choice


class Machine:
    """The folders of a box, with a stick that is plugged in."""

    def __init__(self, folder: Path) -> None:
        self.boot, self.stick, self.data, self.run = (
            folder / name for name in ("boot", "stick", "data", "run")
        )
        for one in (self.boot, self.stick, self.data, self.run):
            one.mkdir()

    @property
    def arguments(self) -> list[str]:
        names = ("boot", "stick", "data", "run")
        return [f"--{name}={getattr(self, name)}" for name in names]

    @property
    def options(self) -> Options:
        return Options(self.boot, self.stick, self.data, self.run)

    def bring(self, name: str) -> Path:
        """Put a sound show of this name onto the stick."""
        show = write_show(self.stick / "show", name=name)
        write_checksums(show)
        return show

    def preflight(self, *more: str) -> subprocess.CompletedProcess[str]:
        return run([*PREFLIGHT, *self.arguments, *more], timeout=PATIENCE_S)

    @property
    def choice(self) -> Choice:
        return choice_in(self.run)

    @property
    def dances(self) -> str:
        return load_show(self.choice.first.show).config.name


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_a_show_from_the_stick_is_chosen_and_the_built_in_box_file(machine: Machine) -> None:
    machine.bring("Spring")
    done = machine.preflight()
    assert (done.returncode, done.stderr) == (0, "")
    assert machine.dances == "Spring"
    box = load_box(machine.choice.first.box)
    assert (box.runtime, box.state) == (machine.run, machine.data / "state")
    assert box.sensors.udp is not None
    assert box.sensors.udp.host == "0.0.0.0"


def test_the_built_in_box_file_is_sound() -> None:
    box = load_box(APPLIANCE_BOX)
    assert box.sensors.keys == Path("/data/bunraku/keys/sensors.keys")
    assert (box.runtime, box.journal.folder) == (Path("/run/bunraku"), Path("/data/bunraku/journal"))


def test_a_show_that_was_checked_is_prepared_for_its_first_start(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    show = machine.choice.first.show
    assert list((show / FOLDER).glob(f"*{SUFFIX}")), "each power-on would read its phrase again"
    assert not checksum_problems(show)


def test_without_a_show_what_comes_with_the_box_is_chosen(machine: Machine) -> None:
    assert machine.preflight().returncode == 0
    assert machine.choice.first.show == EMBEDDED_SHOW


def test_a_typing_error_is_refused_with_file_line_and_cure(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    file = machine.stick / "show" / "show.yaml"
    file.write_text(file.read_text().replace("coding_iterations", "coding_iteratons"))
    write_checksums(machine.stick / "show")
    done = machine.preflight()
    assert done.returncode == 0
    assert machine.dances == "Spring"
    refused = " ".join(machine.choice.refused)
    assert f"{file}:" in refused
    assert "Did you mean 'coding_iterations'?" in refused
    assert set(machine.choice.refused) <= set(done.stdout.splitlines())


@pytest.mark.parametrize("name", ["puppet.onnx", "phrase.bvh"])
def test_a_damaged_file_is_refused(machine: Machine, name: str) -> None:
    show = machine.bring("Spring")
    with (show / name).open("r+b") as stream:
        stream.seek(100)
        stream.write(b"\0\1\2\3 damaged \0")
    machine.preflight()
    assert machine.choice.first.show == EMBEDDED_SHOW
    assert name in " ".join(machine.choice.refused)


def test_a_box_file_that_does_not_fit_leaves_the_show(machine: Machine) -> None:
    machine.bring("Spring")
    (machine.stick / "box.yaml").write_text("outputs:\n  osc:\n    - {hots: 10.0.0.1}\n")
    machine.preflight()
    assert machine.dances == "Spring"
    assert f"{machine.stick}/box.yaml:3" in " ".join(machine.choice.refused)


def test_a_missing_run_folder_is_reported(machine: Machine) -> None:
    machine.run.rmdir()
    done = machine.preflight()
    assert done.returncode == 1
    assert "The audience sees the show that comes with the box" in done.stdout


def test_a_wrong_option_ends_with_two(machine: Machine) -> None:
    assert machine.preflight("--stik=x").returncode == 2


def test_with_nothing_new_nothing_heavy_is_imported(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from appliance.cli.preflight import Options, preflight\n"
        f"folders = [Path(one) for one in {[str(one) for one in machine.options[:4]]}]\n"
        "assert preflight(Options(*folders), print, 10.0) == 0\n"
        f"print(*({HEAVY} & set(sys.modules)))\n"
    )
    done = run([sys.executable, "-c", code], check=True)
    assert done.stdout.strip() == ""


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


def test_a_power_cut_at_any_moment_leaves_whole_shows_alone(machine: Machine, chance: random.Random) -> None:
    """Killed while it copies, checks or writes; the next preflight chooses a whole show."""
    machine.bring("Spring")
    machine.preflight()
    for number in range(8):
        machine.bring(f"Summer {number}")
        with subprocess.Popen([*PREFLIGHT, *machine.arguments], stdout=subprocess.DEVNULL) as process:
            time.sleep(chance.uniform(0.02, 1.2))
            process.send_signal(signal.SIGKILL)
        for pair in (Choice.read(machine.data / CHOSEN) or Choice()).pairs:
            assert not checksum_problems(pair.show)
    assert machine.preflight().returncode == 0
    assert machine.dances == "Summer 7"


def late(machine: Machine, uptime_s: float) -> list[str]:
    """As when a stick is plugged in; in a fork, because a late preflight lowers its own priority."""
    said: list[str] = []

    def in_a_fork() -> bytes:
        assert preflight(machine.options._replace(late=True), said.append, uptime_s) == 0
        return "\n".join(said).encode()

    return run_with_timeout(60.0, in_a_fork).decode().splitlines()


def test_a_stick_right_after_power_on_dances_at_once(machine: Machine) -> None:
    machine.preflight()
    machine.bring("Spring")
    assert "dances at once" in " ".join(late(machine, uptime_s=20.0))
    assert machine.dances == "Spring"
    assert (machine.run / ANEW).exists()


def test_a_stick_in_the_middle_of_the_show_waits_for_the_next_power_on(machine: Machine) -> None:
    machine.preflight()
    machine.bring("Spring")
    assert "after the next power-on" in " ".join(late(machine, uptime_s=3600.0))
    assert machine.choice.first.show == EMBEDDED_SHOW
    assert not (machine.run / ANEW).exists()
    machine.preflight()
    assert machine.dances == "Spring"


def test_a_broken_stick_in_the_middle_of_the_show_is_reported(machine: Machine) -> None:
    machine.preflight()
    show = machine.bring("Spring")
    (show / "puppet.onnx").unlink()
    late(machine, uptime_s=3600.0)
    assert "puppet.onnx" in " ".join(machine.choice.refused)
    assert machine.choice.first.show == EMBEDDED_SHOW


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


def test_a_release_that_can_dance(machine: Machine) -> None:
    done = machine.preflight("--check-release")
    assert done.returncode == 0, done.stderr
    assert "This release can dance here." in done.stdout
    assert not list(machine.run.iterdir())


def test_a_release_that_does_not_dance_the_boxs_show_is_refused(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    (machine.choice.first.show / "puppet.onnx").write_bytes(b"what another release could read")
    done = machine.preflight("--check-release")
    assert done.returncode == 1
    assert "does not dance it" in done.stderr
