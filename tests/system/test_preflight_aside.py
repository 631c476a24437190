"""A show that did not dance stays away when a stick comes late, and each is told with words of its own."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from appliance.cli import preflight as commands
from appliance.cli.preflight import preflight
from appliance.cli.run_with_timeout import within
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import FrameWriter
from appliance.release.choice import CHOSEN
from appliance.release.trial import MirroredProof, pair_to_dance
from tests.bundles import FIGURE
from tests.show_control.doubles import facts
from tests.system.test_preflight import Machine, late

STARTS = 4  # the fourth one puts a new show aside that never danced
SECONDS_AFTER_POWER_ON, MID_SHOW = 20.0, 3600.0


@pytest.fixture
def put_aside(tmp_path: Path) -> Machine:
    """A box that had Winter before, whose new show Spring, from the stick, did not dance tonight."""
    machine = Machine(tmp_path)
    for name in ("Winter", "Spring"):
        machine.bring(name)
        assert machine.preflight().returncode == 0
    starts_that_fail(machine)
    assert machine.dances == "Winter"
    assert "did not dance" in only_aside(machine)
    return machine


def starts_that_fail(machine: Machine) -> None:
    """The stage, each start in a process of its own that dies before its first frame."""
    for _ in range(STARTS):
        within(60.0, lambda: pair_to_dance(machine.run / CHOSEN, time.monotonic(), print).id.encode())


def only_aside(machine: Machine) -> str:
    [(_, words)] = machine.choice.aside
    return words


def dances_for_long(machine: Machine) -> None:
    """The keeper sees that what was chosen dances."""
    now = time.monotonic()
    shown = facts(started=now - 60.0, show_directory=machine.choice.first.show.resolve())
    writer, frame = FrameWriter(machine.run, shown), JointFrame(len(FIGURE))
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
def test_what_was_put_aside_stays_so_whatever_comes_late(put_aside: Machine, arrival: str) -> None:
    words = only_aside(put_aside)
    if arrival == "a broken show":
        (put_aside.bring("Summer") / "puppet.onnx").unlink()
    late(put_aside, MID_SHOW)
    refused = " ".join(put_aside.choice.refused)
    assert ("puppet.onnx" in refused) == (arrival == "a broken show")
    assert only_aside(put_aside) == words
    assert words not in refused
    dances_for_long(put_aside)
    (put_aside.stick / "show").rename(put_aside.stick / "gone")
    power_on(put_aside)
    assert put_aside.dances == "Winter"
    assert only_aside(put_aside) == words


def test_a_new_show_that_dances_at_once_has_what_danced_behind_it(put_aside: Machine) -> None:
    bad = put_aside.choice.aside[0].id
    put_aside.bring("Summer")
    late(put_aside, SECONDS_AFTER_POWER_ON)
    assert put_aside.dances == "Summer"
    assert bad not in {pair.id for pair in put_aside.choice.pairs}
    starts_that_fail(put_aside)
    assert put_aside.dances == "Winter"


def test_what_is_put_aside_while_a_stick_is_checked_stays_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(tmp_path)
    machine.bring("Spring")
    machine.preflight()
    bad = machine.choice.first.id
    machine.bring("Summer")
    check = commands.candidate_problems

    def while_the_stage_fails(show: Path, box: Path) -> list[str]:
        starts_that_fail(machine)
        return check(show, box)

    monkeypatch.setattr(commands, "candidate_problems", while_the_stage_fails)

    def stick() -> bytes:
        return bytes([preflight(machine.options._replace(late=True), print, SECONDS_AFTER_POWER_ON)])

    assert within(60.0, stick) == b"\0"
    assert machine.dances == "Summer"
    assert bad not in {pair.id for pair in machine.choice.pairs}
    assert "did not dance" in only_aside(machine)
