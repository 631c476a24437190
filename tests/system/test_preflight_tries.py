"""A chosen show that does not dance is put aside; one that has danced is kept, however often it is killed."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

from appliance.box.durable import alone_in
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.keeper.mirror import Mirror
from appliance.keeper.mirror_process import MirrorProcess
from appliance.outputs.shared_frame import FrameWriter
from appliance.release.choice import CHOSEN, Choice, Pair
from appliance.release.trial import ANEW, TRIES, MirroredProof, ended_well, pair_to_dance
from tests.bundles import FIGURE, write_show
from tests.outputs.small_stage import one_puppet
from tests.show_control.doubles import facts
from tests.system.box_folders import choice_in
from tests.system.processes import run, wait_until

NEW, BEFORE = "new+", "before+"


class Evening:
    """The runtime folder of a box, and its stage, started and ended as a test wants."""

    def __init__(self, folder: Path) -> None:
        self.run, self.data = folder / "run", folder / "data"
        for one in (self.run, self.data):
            one.mkdir()
        self.said: list[str] = []
        for name in ("new", "before"):
            (folder / name).mkdir()
            (folder / name / "show.yaml").touch()
        pairs = (
            Pair(folder / "new", id=NEW, source="show from the stick"),
            Pair(folder / "before", id=BEFORE, source="show from the boot partition", good=True),
            Pair(good=True),
        )
        Choice(pairs, data=self.data).write(self.run / CHOSEN)
        Choice(pairs[:2], data=self.data).write(self.data / CHOSEN)

    def start(self, danced_s: float | None) -> str:
        """Which pair a stage takes that dies after `danced_s` (None: before its first frame)."""

        def begin() -> bytes:
            pair = pair_to_dance(self.run / CHOSEN, time.monotonic(), lambda message: None)
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
    said: list[str] = []
    assert pair_to_dance(tmp_path / CHOSEN, 0.0, said.append) == Pair(good=True)
    assert "The audience sees the show that comes with the box" in said[0]


def proof_of(evening: Evening) -> Mirror:
    return Mirror(MirroredProof(evening.run, evening.run / CHOSEN), print)


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
    process = MirrorProcess(
        MirroredProof(evening.run, evening.run / CHOSEN), evening.run, end_s=0.0, say=print
    )
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
    temporary = evening.data / f".{CHOSEN}.new"
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
