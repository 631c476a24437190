"""The doctor's checks of the processor: the stage's priority, late wake-ups, other programs, power."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.cli.doctor import processor
from appliance.cli.doctor.host_view import HostView, RunningStage
from appliance.cli.doctor.sample import Sample, sample
from tests.system.machine_of_files import STAGE_PID, lay, only, verdicts


def quiet(late_ms: tuple[float, ...] = (0.1,) * 200, **changes: object) -> Sample:
    usual = {"late_ms": late_ms, "shares": (), "interrupts": 0.0, "stolen": 0.0, "cores": 4}
    return Sample(**{**usual, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(("policy", "verdict"), [("1", "ok"), ("0", "wrong")], ids=["fifo", "ordinary"])
def test_the_priority_of_the_running_stage_is_read(tmp_path: Path, policy: str, verdict: str) -> None:
    fields = " ".join(["S", *["0"] * 36, "70", policy, "0"])
    lay(tmp_path, f"/proc/{STAGE_PID}/stat", f"{STAGE_PID} (bunraku (play)) {fields}")
    found = only(processor.realtime_rights(HostView(tmp_path, stage=RunningStage(STAGE_PID, {}))))
    assert found.verdict == verdict
    if verdict == "ok":
        assert "70" in found.message


def test_the_kernel_s_figures_are_found_for_this_process() -> None:
    patient = HostView(stage=RunningStage(os.getpid(), {}))
    assert only(processor.realtime_rights(patient)).verdict == "wrong"  # tests are ordinary
    assert only(processor.locked_memory(patient)).verdict == "better"


@pytest.mark.parametrize(
    ("late_ms", "verdict"),
    [((0.1,) * 200, "ok"), ((0.1,) * 199 + (9.0,), "better"), ((0.1,) * 190 + (16.0,) * 10, "wrong")],
)
def test_late_wake_ups(late_ms: tuple[float, ...], verdict: str) -> None:
    assert only(processor.wakeup_latency(quiet(late_ms))).verdict == verdict


def test_other_users_of_the_cores_are_named() -> None:
    assert only(processor.others(quiet(shares=(("cron", 12, 0.01),)))).verdict == "ok"
    found = only(processor.others(quiet(shares=(("updatedb", 77, 0.9), ("cron", 12, 0.01)))))
    assert found.verdict == "better"
    assert "updatedb (process 77, 90 % of a core)" in found.message
    assert "cron" not in found.message
    crowd = tuple(("stress", pid, 0.9) for pid in range(4))
    assert only(processor.others(quiet(shares=crowd))).verdict == "wrong"


def test_interrupts_and_a_host_that_takes_time_away() -> None:
    assert verdicts(processor.interrupts(quiet())) == [("interrupts", "ok")]
    found = verdicts(processor.interrupts(quiet(interrupts=0.5, stolen=0.1)))
    assert found == [("interrupts", "better"), ("virtual machine", "better")]


def test_the_wake_ups_are_told_as_figures_and_with_the_class_in_which_they_ran() -> None:
    late_ms = tuple(0.1 + 0.01 * number for number in range(100))
    message = only(processor.wakeup_latency(quiet(late_ms))).message
    assert "half came within 0.60 ms, 99 % within 1.09 ms, the latest 1.1 ms" in message
    assert "with real-time priority" in message
    assert "without the real-time" in only(processor.wakeup_latency(quiet(late_ms, real_time=False))).message


def test_a_sample_sees_a_busy_process_and_wakes_each_time() -> None:
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            seen = sample(70, frozenset())
            unseen = sample(70, frozenset({busy.pid}))
        finally:
            busy.kill()
    assert len(seen.late_ms) == 1000
    assert busy.pid in [pid for _, pid, share in seen.shares if share > 0.0]
    assert busy.pid not in [pid for _, pid, _ in unseen.shares]


def test_a_machine_that_reports_no_throttling_has_no_finding_about_power(tmp_path: Path) -> None:
    assert list(processor.power(HostView(tmp_path))) == []
    lay(tmp_path, "/sys/class/hwmon/hwmon2/name", "rpi_volt\n")
    lay(tmp_path, "/sys/class/hwmon/hwmon2/in0_lcrit_alarm", "1\n")
    assert only(processor.power(HostView(tmp_path))).verdict == "wrong"


def test_raspberry_pi_os_is_asked_by_its_own_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "vcgencmd"
    program.write_text('#!/bin/sh\n[ "$1" = get_throttled ] && echo throttled=0x50005\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    found = only(processor.power(HostView()))
    assert found.verdict == "wrong" and "voltage is too low now" in found.message
    program.write_text("#!/bin/sh\necho throttled=0x50000\n")
    found = only(processor.power(HostView()))
    assert found.verdict == "better" and "since the box was switched on" in found.message
