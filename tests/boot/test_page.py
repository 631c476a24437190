"""The page on an installed box: what it starts has the rights that it needs under systemd, and no more."""

from __future__ import annotations

import pytest

from tests.boot.box import STAGE, Box
from tests.boot.device import PROVE, Device

pytestmark = pytest.mark.boot


def test_it_reads_logs_journal_and_box_in_its_own_sandbox(dancing: Box, device: Device) -> None:
    status, lines = device.ask("/api/logs")
    assert status == 200, lines
    assert {"bunraku-stage", "bunraku-console"} <= {line["unit"] for line in lines}
    status, box = device.ask("/api/box")
    assert status == 200 and box["release"] and box["shows"], box
    status, runs = device.ask("/api/happened")
    assert status == 200, runs


def test_latency_is_measured_with_the_rights_of_a_stage(dancing: Box, device: Device) -> None:
    machine = dancing.machine
    wanted = {"kind": "latency", "seconds": 6}
    assert device.ask("/api/prove", wanted)[0] == 409, "beside a dance that people see"
    assert device.ask("/api/command", {"address": "/stop"})[1]["done"]
    device.await_that(lambda: not device.ask("/api/prove")[1]["show_goes"], "the show does not stop")
    try:
        status, said = device.ask("/api/prove", wanted)
        assert status == 200, said
        rights = [machine.show(PROVE, key) for key in ("RestrictRealtime", "LimitRTPRIO", "LimitMEMLOCK")]
        assert rights == ["no", "70", "infinity"]
        granted, measured = machine.await_that(lambda: _play(dancing), "no box is measured")
        if granted:  # a machine may refuse the limit to all containers; the unit's own rights are seen above
            assert measured == _policy(dancing, machine.show(STAGE, "MainPID"))
        document = device.proven("latency")
    finally:
        device.ask("/api/command", {"address": "/go"})
    assert document["figures"]["ticks"] > 100 and document["software"]["bunraku"]
    assert {limit["label"] for limit in document["limits"]} >= {"transport, median", "late ticks"}
    machine.await_that(lambda: machine.show(PROVE, "ActiveState") == "inactive", "it does not end")
    assert not machine.run("find", "/run/bunraku/prove", "-name", "wanted").strip()


def test_the_doctor_sees_the_box_from_its_unit(dancing: Box, device: Device) -> None:
    assert device.ask("/api/prove", {"kind": "doctor"})[0] == 200
    found = {one["what"]: one for one in device.proven("doctor")["findings"]}
    assert "Hz" in found["stage"]["message"]
    assert found[f"{STAGE}.service"]["verdict"] != "wrong"


def _play(box: Box) -> tuple[bool, str] | None:
    """Whether the box that is measured may ask for real time, and its scheduling; None before it dances."""
    procs = f"/sys/fs/cgroup/system.slice/{PROVE}.service/cgroup.procs"
    for pid in box.machine.run("cat", procs, check=False).split():
        arguments = box.machine.run("cat", f"/proc/{pid}/cmdline", check=False).split("\0")
        if "play" in arguments and "at_s" in box.machine.run("cat", "/run/bunraku/prove/progress"):
            limits = box.machine.run("cat", f"/proc/{pid}/limits", check=False).splitlines()
            granted = any(line.split()[:4] == ["Max", "realtime", "priority", "70"] for line in limits)
            return granted, _policy(box, pid)
    return None


def _policy(box: Box, pid: str) -> str:
    """proc(5): the policy and the priority of a process's main thread."""
    fields = box.machine.run("cat", f"/proc/{pid}/stat", check=False).rpartition(")")[2].split()
    return " ".join((fields[38], fields[37])) if fields else ""
