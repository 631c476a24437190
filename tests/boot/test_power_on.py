"""Power on, and it dances: no login, no key press."""

from __future__ import annotations

import re

import pytest

from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures

POWER_ON_LIMIT_S = 3.0
EVENINGS, MOST_EVENINGS = 2, 3  # MOST_EVENINGS with --long
UNITS = ("stage", "keeper", "control", "lights", "projector", "console")

pytestmark = pytest.mark.boot


def test_after_an_evening_that_ended_it_begins_at_the_beginning(
    box: Box, figures: Figures, long_run: bool
) -> None:
    for _ in range(MOST_EVENINGS if long_run else EVENINGS):
        box.power_on()
        first = box.await_frames()[0]
        figures.note("power-on to first frame", first.at - box.machine.powered_at, limit=POWER_ON_LIMIT_S)
        assert first.tick < 50, "the first frames were lost"
        now = box.place()
        danced_s = now.puppets[0].position_s - 0.02 * first.tick
        assert danced_s == pytest.approx(box.danced_s(first.at, now.tick), abs=0.001), (
            "it did not begin at the beginning"
        )
        for unit in UNITS:  # an evening that runs: all of them have to end
            box.await_unit(f"bunraku-{unit}")
        box.machine.power_off()


def test_all_that_belongs_to_the_box_runs_and_nothing_has_failed(dancing: Box) -> None:
    machine = dancing.machine
    for unit in UNITS:
        dancing.await_unit(f"bunraku-{unit}")
    machine.await_that(lambda: _settled(dancing), "the box is still starting")
    failed = machine.run("systemctl", "--failed", "--plain", "--no-legend")
    assert not failed, f"{failed}\n{machine.log()}"
    # Five processes start at once: on a busy machine one may be late for its watchdog, and is restarted.
    fell = re.findall(r"bunraku-\w+\.service: Failed with result '(?!watchdog)\w.*'", machine.log())
    assert not fell and machine.show(STAGE, "NRestarts") == "0", machine.log()


def test_only_the_stages_main_thread_has_real_time_priority(dancing: Box) -> None:
    dancing.await_frames(20)
    stage = dancing.machine.show(STAGE, "MainPID")
    assert stage != "0"
    policies = dancing.machine.run("ps", "-L", "-o", "lwp=,cls=,rtprio=", "-p", stage).splitlines()
    realtime = [line.split() for line in policies if "FF" in line.split()]
    assert [(lwp, priority) for lwp, _, priority in realtime] == [(stage, "70")], policies


def _settled(box: Box) -> bool:
    return box.machine.run("systemctl", "is-system-running", check=False).strip() in ("running", "degraded")
