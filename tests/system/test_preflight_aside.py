"""A show put aside because it did not dance stays so when a stick is plugged in late."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from appliance.cli import preflight as commands
from appliance.cli.preflight import preflight
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.outputs.shared_frame import FrameWriter
from appliance.release.choice import CHOSEN
from appliance.release.trial import MirroredProof, pair_to_dance
from tests.bundles import FIGURE
from tests.outputs.small_stage import one_puppet
from tests.show_control.doubles import facts
from tests.system.box_folders import Machine, late

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
        run_with_timeout(
            60.0, lambda: pair_to_dance(machine.run / CHOSEN, time.monotonic(), print).id.encode()
        )


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

    monkeypatch.setattr(commands, "candidate_problems", while_the_stage_fails)

    def stick() -> bytes:
        return bytes([preflight(machine.options._replace(late=True), print, SECONDS_AFTER_POWER_ON)])

    assert run_with_timeout(60.0, stick) == b"\0"
    assert machine.dances == "Summer"
    assert bad not in {pair.id for pair in machine.choice.pairs}
    assert "did not dance" in only_aside(machine)
