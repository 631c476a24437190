"""The preflight as a process: shows from a stick and releases, checked, and what is chosen or refused."""

from __future__ import annotations

import faulthandler
import os
import random
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from appliance.box.durable import alone_in, beside
from appliance.cli import candidate
from appliance.cli import preflight as commands
from appliance.cli.preflight import candidate_problems, late_candidate_problems, preflight
from appliance.cli.run_with_timeout import TimedOutError, run_with_timeout
from appliance.dancer.phrase_cache import FOLDER, SUFFIX
from appliance.keeper.mirror import Mirror
from appliance.keeper.mirror_process import MirrorProcess
from appliance.outputs.shared_frame import FrameWriter
from appliance.release.choice import APPLIANCE_BOX, CHOSEN, EMBEDDED_SHOW, Choice, ShowAndBox
from appliance.release.trial import ANEW, TRIES, MirroredProof, chosen_to_dance, ended_well
from appliance.show.box import load_box
from appliance.show.bundle import checksum_problems, write_checksums
from tests.bundles import FIGURE, write_show
from tests.logged import said
from tests.outputs.small_stage import one_puppet
from tests.show_control.doubles import facts
from tests.system.box_folders import PATIENCE_S, PREFLIGHT, Machine, choice_in, late
from tests.system.processes import run, wait_until

HEAVY = {
    *("numpy", "onnxruntime", "yaml", "pydantic", "typer"),
    *("argparse", "subprocess", "dataclasses", "hashlib"),
}


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
        "assert preflight(Options(*folders), 10.0) == 0\n"
        f"print(*({HEAVY} & set(sys.modules)))\n"
    )
    done = run([sys.executable, "-c", code], check=True)
    assert done.stdout.strip() == ""


def test_a_release_that_can_dance(machine: Machine) -> None:
    done = machine.preflight("--check-release")
    assert done.returncode == 0, done.stderr
    assert "This release can dance here." in done.stdout
    assert not list(machine.run.iterdir())


def test_a_release_that_does_not_dance_the_boxs_show_is_refused(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    assert machine.dances == "Spring"  # else the next line would damage the embedded show
    (machine.choice.first.show / "puppet.onnx").write_bytes(b"what another release could read")
    done = machine.preflight("--check-release")
    assert done.returncode == 1
    assert "does not dance it" in done.stderr


STARTS = 4  # at the fourth one a new show that never danced is put aside
SECONDS_AFTER_POWER_ON, MID_SHOW = 20.0, 3600.0


@pytest.fixture
def put_aside(tmp_path: Path) -> Machine:
    """A box that has danced Winter; its new show Spring, from the stick, failed to dance tonight."""
    machine = Machine(tmp_path)
    for name in ("Winter", "Spring"):
        machine.bring(name)
        assert machine.preflight().returncode == 0
    fail_to_start(machine)
    assert machine.dances == "Winter"
    assert "did not dance" in only_aside(machine)
    return machine


def fail_to_start(machine: Machine) -> None:
    """Start the stage until it gives up: each process dies before its first frame."""
    for _ in range(STARTS):
        run_with_timeout(60.0, lambda: chosen_to_dance(machine.run / CHOSEN, time.monotonic()).id.encode())


def only_aside(machine: Machine) -> str:
    [(_, message)] = machine.choice.aside
    return message


def dance_for_long(machine: Machine) -> None:
    """Let the keeper see the chosen show dance."""
    now = time.monotonic()
    shown = facts(started=now - 60.0, show_directory=machine.choice.first.show.resolve())
    writer, frame = FrameWriter(machine.run, shown), one_puppet(len(FIGURE))
    frame.frame_time = now
    writer.write(frame)
    proof = MirroredProof(machine.run, machine.run / CHOSEN)
    proof.copy(now)
    proof.close()
    writer.close()


def power_on(machine: Machine) -> None:
    for path in machine.run.iterdir():
        path.unlink()
    assert machine.preflight().returncode == 0


@pytest.mark.parametrize("arrival", ["the same stick", "a broken show"])
def test_a_show_put_aside_stays_so_whatever_is_plugged_in_late(put_aside: Machine, arrival: str) -> None:
    message = only_aside(put_aside)
    if arrival == "a broken show":
        (put_aside.bring("Summer") / "puppet.onnx").unlink()
    late(put_aside, MID_SHOW)
    refused = " ".join(put_aside.choice.refused)
    assert ("puppet.onnx" in refused) == (arrival == "a broken show")
    assert only_aside(put_aside) == message
    assert message not in refused
    dance_for_long(put_aside)
    (put_aside.stick / "show").rename(put_aside.stick / "gone")
    power_on(put_aside)
    assert put_aside.dances == "Winter"
    assert only_aside(put_aside) == message


def test_behind_a_new_show_that_dances_at_once_stands_the_one_that_danced_before(put_aside: Machine) -> None:
    bad = put_aside.choice.aside[0].id
    put_aside.bring("Summer")
    late(put_aside, SECONDS_AFTER_POWER_ON)
    assert put_aside.dances == "Summer"
    assert bad not in {pair.id for pair in put_aside.choice.pairs}
    fail_to_start(put_aside)
    assert put_aside.dances == "Winter"


def test_a_show_put_aside_while_a_stick_is_checked_stays_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(tmp_path)
    machine.bring("Spring")
    machine.preflight()
    bad = machine.choice.first.id
    machine.bring("Summer")
    check = commands.candidate_problems

    def while_the_stage_fails(show: Path, box: Path) -> list[str]:
        fail_to_start(machine)
        return check(show, box)

    monkeypatch.setattr(commands, "late_candidate_problems", while_the_stage_fails)
    late(machine, SECONDS_AFTER_POWER_ON)
    assert machine.dances == "Summer"
    assert bad not in {pair.id for pair in machine.choice.pairs}
    assert "did not dance" in only_aside(machine)


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


NEW, BEFORE = "new+", "before+"


class Evening:
    """The runtime folder of a box, and its stage, started and ended as a test wants."""

    def __init__(self, folder: Path) -> None:
        self.run, self.data = folder / "run", folder / "data"
        for one in (self.run, self.data):
            one.mkdir()
        self.said = said
        for name in ("new", "before"):
            (folder / name).mkdir()
            (folder / name / "show.yaml").touch()
        pairs = (
            ShowAndBox(folder / "new", id=NEW, source="show from the stick"),
            ShowAndBox(folder / "before", id=BEFORE, source="show from the boot partition", good=True),
            ShowAndBox(good=True),
        )
        Choice(pairs, data=self.data).write(self.run / CHOSEN)
        Choice(pairs[:2], data=self.data).write(self.data / CHOSEN)

    def start(self, danced_s: float | None) -> str:
        """Which pair a stage takes that dies after `danced_s` (None: before its first frame)."""

        def begin() -> bytes:
            pair = chosen_to_dance(self.run / CHOSEN, time.monotonic())
            if danced_s is not None:
                self._leave_frames(danced_s)
            return pair.id.encode()

        return run_with_timeout(60.0, begin).decode()

    def dance(self, seconds: float, rehearsal: bool = False) -> None:
        """A stage dances the chosen show for this long, and dies."""

        def dance() -> bytes:
            self._leave_frames(seconds, rehearsal)
            return b""

        run_with_timeout(60.0, dance)

    def _leave_frames(self, seconds: float, rehearsal: bool = False) -> None:
        """Leave a shared frame behind, as a killed stage does."""
        now = time.monotonic()
        directory = self.choice.first.show.resolve()
        started = {"pid": os.getpid(), "started": now - seconds, "rehearsal": rehearsal}
        writer = FrameWriter(self.run, facts(show_directory=directory, **started))
        frame = one_puppet(len(FIGURE))
        frame.frame_time = now
        writer.write(frame)

    @property
    def choice(self) -> Choice:
        return choice_in(self.run)

    @property
    def saved(self) -> Choice:
        return choice_in(self.data)


@pytest.fixture
def evening(tmp_path: Path) -> Evening:
    return Evening(tmp_path)


def test_a_new_show_that_does_not_dance_is_put_aside_at_the_fourth_start(evening: Evening) -> None:
    assert [evening.start(danced_s=None) for _ in range(4)] == [NEW, NEW, NEW, BEFORE]
    [(put_aside, message)] = evening.choice.aside
    assert put_aside == NEW
    assert "did not dance in 3 starts and is put aside" in message


def test_a_new_show_that_crashes_after_some_frames_is_put_aside(evening: Evening) -> None:
    assert [evening.start(danced_s=4.0) for _ in range(4)] == [NEW, NEW, NEW, BEFORE]


def test_starts_that_end_as_they_should_are_not_counted(evening: Evening) -> None:
    for _ in range(5):
        assert evening.start(danced_s=None) == NEW
        ended_well(evening.run / CHOSEN)


def test_a_new_show_that_once_danced_long_enough_is_tried_on(evening: Evening) -> None:
    assert [evening.start(danced_s=None) for _ in range(2)] == [NEW, NEW]
    assert evening.start(danced_s=11.0) == NEW
    assert [evening.start(danced_s=None) for _ in range(3)] == [NEW, NEW, NEW]


def test_a_good_show_may_be_killed_any_number_of_times(evening: Evening) -> None:
    evening.choice.with_good(NEW).write(evening.run / CHOSEN)
    assert {evening.start(danced_s=0.1) for _ in range(12)} == {NEW}


def test_a_good_show_that_gives_no_frame_any_more_is_put_aside_too(evening: Evening) -> None:
    evening.choice.with_good(NEW).write(evening.run / CHOSEN)
    assert [evening.start(danced_s=None) for _ in range(7)] == [NEW] * 6 + [BEFORE]


def test_what_comes_with_the_box_is_never_put_aside(evening: Evening) -> None:
    Choice().write(evening.run / CHOSEN)
    assert {evening.start(danced_s=None) for _ in range(8)} == {""}


def test_other_box_files_restart_the_other_processes(evening: Evening) -> None:
    evening.start(danced_s=None)
    other = evening.run / "other.yaml"
    first, *rest = evening.choice.pairs
    evening.choice._replace(pairs=(first._replace(box=other), *rest)).write(evening.run / CHOSEN)
    for _ in range(3):
        evening.start(danced_s=None)
    assert (evening.run / ANEW).exists()


@pytest.mark.parametrize("torn", [b"", b"[1]", b'["x", "many", 0]', b"\0\0"])
def test_a_torn_count_starts_over(evening: Evening, torn: bytes) -> None:
    (evening.run / TRIES).write_bytes(torn)
    assert evening.start(danced_s=None) == NEW


def test_without_a_choice_what_comes_with_the_box_dances(tmp_path: Path) -> None:
    assert chosen_to_dance(tmp_path / CHOSEN, 0.0) == ShowAndBox(good=True)
    assert "The audience sees the show that comes with the box" in said[0]


def proof_of(evening: Evening) -> Mirror:
    return Mirror(MirroredProof(evening.run, evening.run / CHOSEN))


def test_a_show_that_danced_for_ten_seconds_is_proven_on_the_disk_and_in_memory(evening: Evening) -> None:
    proof = proof_of(evening)
    evening.dance(seconds=9.0)
    proof.turn(time.monotonic())
    assert not evening.saved.first.good
    evening.dance(seconds=10.5)
    proof.turn(time.monotonic() + 1.0)
    assert evening.saved.first.good
    assert evening.choice.first.good
    assert proof.complaint == ""
    proof.last_turn(time.monotonic())


def test_a_keeper_that_starts_while_the_show_dances_keeps_the_proof(evening: Evening) -> None:
    evening.dance(seconds=10.5)
    process = MirrorProcess(MirroredProof(evening.run, evening.run / CHOSEN), evening.run, end_s=0.0)
    try:
        process.supervise(time.monotonic())
        wait_until(lambda: evening.saved.first.good)
    finally:
        process.request_end()
        while not process.has_ended:
            process.supervise(time.monotonic())
            time.sleep(0.005)


def test_a_rehearsal_proves_nothing(evening: Evening) -> None:
    proof = proof_of(evening)
    evening.dance(seconds=10.5, rehearsal=True)
    proof.turn(time.monotonic())
    assert not evening.saved.first.good
    proof.last_turn(time.monotonic())


def test_a_show_put_aside_is_dropped_once_another_one_has_danced(evening: Evening) -> None:
    for _ in range(4):
        evening.start(danced_s=None)
    proof = proof_of(evening)
    evening.dance(seconds=10.5)
    proof.turn(time.monotonic())
    assert [pair.id for pair in evening.saved.pairs] == [BEFORE]
    assert evening.saved.aside == evening.choice.aside
    assert [put_aside for put_aside, _ in evening.saved.aside] == [NEW]
    proof.last_turn(time.monotonic())


def test_a_preflight_that_reads_a_stick_does_not_block_the_keeper(evening: Evening) -> None:
    proof = proof_of(evening)
    evening.dance(seconds=10.5)
    now = time.monotonic()
    with alone_in(evening.data), alone_in(evening.run):
        proof.turn(now)
    assert (proof.complaint, evening.saved.first.good) == ("", False)
    proof.turn(now + 11.0)
    assert evening.saved.first.good
    proof.last_turn(time.monotonic())


def test_a_show_that_is_gone_with_its_disk_is_not_even_tried(evening: Evening) -> None:
    evening.choice.with_good(NEW).write(evening.run / CHOSEN)
    (evening.run.parent / "new" / "show.yaml").unlink()
    assert evening.start(danced_s=None) == BEFORE
    assert "cannot be found any more" in evening.choice.refused[0]
    assert evening.choice.aside == (), "it may be there again after the next power-on"
    (evening.run.parent / "before" / "show.yaml").unlink()
    assert evening.start(danced_s=None) == ""


def test_a_proof_that_cannot_be_kept_is_reported_and_tried_again(evening: Evening) -> None:
    proof = proof_of(evening)
    evening.dance(seconds=10.5)
    temporary = beside(evening.data / CHOSEN)
    temporary.mkdir()
    now = time.monotonic()
    proof.turn(now)
    assert "cannot be kept" in proof.complaint
    temporary.rmdir()
    proof.turn(now + 5.0)
    assert not evening.saved.first.good
    proof.turn(now + 11.0)
    assert evening.saved.first.good
    assert proof.complaint == ""
    proof.last_turn(time.monotonic())


def test_a_broken_chosen_show_gives_way_on_the_real_stage(evening: Evening, tmp_path: Path) -> None:
    """The real command, restarted as its unit does."""
    (tmp_path / "new" / "show.yaml").write_text("dancer: nobody\n")
    write_show(tmp_path / "before")
    box = tmp_path / "box.yaml"
    box.write_text("sensors: {udp: null}\noutputs: {osc: []}\ncontrol: null\nruntime: run\n")
    evening.run.chmod(0o700)
    pairs = tuple(pair._replace(box=box) for pair in evening.choice.pairs)
    evening.choice._replace(pairs=pairs).write(evening.run / CHOSEN)
    play = [sys.executable, "-m", "appliance.start", "play", "--alone", "--seconds", "0.3"]
    play += ["--chosen", str(evening.run / CHOSEN)]
    for _ in range(3):
        assert run(play).returncode == 2
    done = run(play)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "is put aside" in done.stdout
    assert "A test" in done.stdout


def test_the_show_that_danced_before_is_chosen_before_anything_new_is_read(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    machine.bring("Spring")
    machine.preflight()
    (machine.run / CHOSEN).unlink()
    seen: list[Choice | None] = []

    def broken(source: str, folder: Path) -> None:
        seen.append(Choice.read(machine.run / CHOSEN))
        raise RecursionError("an unforeseen error")

    monkeypatch.setattr(commands, "look", broken)
    assert preflight(machine.options._replace(stick=machine.stick / "none"), 10.0) == 0
    assert seen[0] is not None and seen[0].first == machine.choice.first
    assert machine.dances == "Spring"
    said = capsys.readouterr().out.splitlines()
    assert "an unforeseen error" in said[0] and said[0] in machine.choice.refused


def test_a_preflight_that_never_ends_blocks_no_other(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    machine.bring("Spring")
    machine.preflight()
    (machine.run / CHOSEN).unlink()
    monkeypatch.setattr(commands, "TURN_S", 0.1)
    with alone_in(machine.data):
        assert preflight(machine.options, 10.0) == 0
    said = capsys.readouterr().out.splitlines()
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
    assert "did not end within 0.2 s" in candidate_problems(tmp_path, APPLIANCE_BOX)[0]
    monkeypatch.setattr(commands, "LATE_CHECK_S", 0.3)
    assert "did not end within 0.3 s" in late_candidate_problems(tmp_path, APPLIANCE_BOX)[0]


def test_a_stick_that_hangs_is_given_up(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    machine.bring("Spring")
    monkeypatch.setattr(commands, "look", lambda source, folder: time.sleep(60))
    monkeypatch.setattr(commands, "STICK_S", 0.2)
    assert preflight(machine.options, 10.0) == 0
    said = capsys.readouterr().out.splitlines()
    assert "could not be read (not within 0.2 s)" in said[0]
    assert machine.choice.first.show == EMBEDDED_SHOW


def crash() -> bytes:
    faulthandler.disable()  # its report in the output of a suite that passes would alarm people
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
