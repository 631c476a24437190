"""The real image in a whole machine: it starts, and starts again after whatever stops a machine.

All tests use one machine, in the order of this file: a start takes minutes. Times are those of its own clock.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.vm.audience import HOST_SEEN_FROM_INSIDE, Audience
from tests.vm.machine import Machine, disk_of

DISK_MIB = 2048
START_S, ANSWER_S = 1500.0, 300.0  # patience with a machine in software; nothing is measured by it
YEAR_S = 365 * 86400


@dataclass
class Box:
    """The machine, its audience, and what was measured."""

    machine: Machine
    audience: Audience
    measured: list[str] = field(default_factory=list)

    def run(self, command: str) -> str:
        return self.machine.console.run(command, ANSWER_S)

    def number(self, command: str) -> float:
        return float(self.run(command))

    def awaits_dance(self) -> None:
        """Somebody logs in and waits until frames come out of the machine."""
        self.machine.console.log_in(START_S)
        self.audience.forget()
        self.audience.await_frames(5, START_S)

    def stage(self, what: str) -> str:
        return self.run(f"systemctl show bunraku-stage --property={what} --value")

    def first_frame_s(self) -> float:
        """From the kernel's first moment to the stage's first frame; its unit is ready when that has left."""
        return int(self.stage("ActiveEnterTimestampMonotonic")) / 1e6

    def note(self, output: str) -> None:
        self.measured.append(output)
        print(output, flush=True)


@pytest.fixture(scope="module")
def box(image: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Box]:
    folder = tmp_path_factory.mktemp("machine")
    with contextlib.closing(Audience()) as audience:
        receiver = f"{{host: {HOST_SEEN_FROM_INSIDE}, port: {audience.port}, frame_message: true}}"
        disk = disk_of(image, folder, DISK_MIB, {"box.yaml": f"outputs: {{osc: [{receiver}]}}\n".encode()})
        with Machine(disk, folder) as machine:
            made = Box(machine, audience)
            machine.power_on()
            yield made
            print("\n".join(["", "In the machine in software:", *made.measured]))


def test_it_dances_after_power_on(box: Box) -> None:
    box.awaits_dance()
    box.note(
        f"power on -> first frame: {box.first_frame_s():.1f} s of its own time "
        f"({box.machine.seconds_on():.0f} s here); the stage says: {box.stage('StatusText')}"
    )
    box.run("until systemctl is-active --quiet bunraku-control bunraku-keeper; do sleep 1; done")
    assert box.run("systemctl --failed --no-legend --plain") == ""


def test_the_root_is_never_written_and_the_data_partition_has_grown(box: Box) -> None:
    assert box.run("findmnt -n -o FSTYPE /") == "overlay"
    assert box.run("findmnt -n -o FSTYPE,OPTIONS /run/bunraku-root/read-only").startswith("squashfs ro")
    assert box.number("findmnt -n -b -o SIZE /data") > (DISK_MIB - 900) * 1024 * 1024
    machine_id = box.run("cat /etc/machine-id")
    assert machine_id == "6c1f3c8e6a554a0e9a630b5a6c0b8d11" or (box.machine.is_pi and len(machine_id) == 32)


def test_a_killed_stage_dances_again(box: Box) -> None:
    before = box.stage("MainPID")
    tick = box.audience.await_frames(1, ANSWER_S)[-1]
    took_s = box.number(
        f"kill -9 {before}; from=$(cut -d' ' -f1 /proc/uptime); "
        "until systemctl is-active --quiet bunraku-stage; do :; done; "
        "echo $from $(cut -d' ' -f1 /proc/uptime) | awk '{print $2 - $1}'"
    )
    assert box.stage("MainPID") != before
    box.audience.forget()
    assert box.audience.await_frames(5, ANSWER_S)[0] > tick, "it goes on where it was"
    box.note(f"stage killed -> it dances again after {took_s:.1f} s of its own time")


def test_a_full_disk_stops_nothing(box: Box) -> None:
    before = box.stage("MainPID"), box.stage("NRestarts")
    # No room is left without a gigabyte being written, which takes this machine longer than anybody waits.
    box.run("fallocate --length $(df --output=avail --block-size=1 /data | tail -n 1) /data/full; sync")
    assert box.number("df --output=avail /data | tail -n 1") < 1024  # in KiB
    box.audience.forget()
    box.audience.await_frames(100, ANSWER_S)
    box.run("rm /data/full")
    assert (box.stage("MainPID"), box.stage("NRestarts")) == before


@pytest.mark.parametrize("jump_s", [-1, YEAR_S, -YEAR_S])
def test_the_clock_of_the_day_may_jump(box: Box, jump_s: int) -> None:
    """-1 stands for 1970, as after an empty battery."""
    before = box.stage("MainPID"), box.stage("NRestarts")
    box.run(
        "systemctl stop chrony; "
        + ("date -s @0" if jump_s == -1 else f"date -s @$(($(date +%s) + {jump_s}))")
    )
    box.audience.forget()
    ticks = box.audience.await_frames(50, ANSWER_S)
    assert ticks == sorted(ticks)
    assert (box.stage("MainPID"), box.stage("NRestarts")) == before


def test_it_dances_on_when_memory_runs_out(box: Box) -> None:
    before = box.stage("MainPID")
    hog = r"taken = []\nwhile True: taken.append(bytes([1]) * 10000000)"
    box.run(f"printf '{hog}' > /run/hog.py; systemd-run --quiet --wait python3 /run/hog.py")
    assert "Out of memory" in box.run("dmesg")
    box.audience.forget()
    box.audience.await_frames(5, ANSWER_S)
    assert box.stage("MainPID") == before


def test_a_usb_adapter_may_come_and_go(box: Box) -> None:
    before = box.stage("MainPID")
    for _ in range(2):
        box.machine.ask_qemu("device_add usb-serial,chardev=adapter,id=dmx,always-plugged=on")
        box.run("until [ -e /dev/ttyUSB0 ]; do sleep 0.2; done")
        box.machine.ask_qemu("device_del dmx")
        box.run("while [ -e /dev/ttyUSB0 ]; do sleep 0.2; done")
    box.audience.forget()
    box.audience.await_frames(5, ANSWER_S)
    assert box.stage("MainPID") == before


@pytest.mark.parametrize("number", [1, 2, 3])
def test_it_dances_again_after_a_power_cut(box: Box, number: int) -> None:
    box.run("echo torn > /data/not-yet-written")
    box.machine.cut_power()
    box.machine.power_on()
    box.awaits_dance()
    repaired = box.run("journalctl -b -o cat -u 'systemd-fsck@*' | grep -i -E 'recover|error' | head -n 1")
    box.note(
        f"power cut {number} -> first frame: {box.first_frame_s():.1f} s of its own time after power is back "
        f"({box.machine.seconds_on():.0f} s here); data partition: {repaired or 'clean'}"
    )
    assert box.run("find /data -name '*.part' -o -name '*.tmp'") == ""
    assert "power-cut" in box.run("journalctl -b -o cat -u bunraku-stage")


def test_the_watchdog_resets_a_machine_whose_pid_1_hangs(box: Box) -> None:
    hung_at = box.number("date +%s.%N; sync; echo 1 > /sys/fs/cgroup/init.scope/cgroup.freeze")
    here = time.monotonic()
    box.awaits_dance()
    up_since = box.number(
        "echo $(date +%s.%N) $(cut -d' ' -f1 /proc/uptime) | awk '{printf \"%.3f\", $1 - $2}'"
    )
    reset_after_s = up_since - hung_at
    assert 0 < reset_after_s < 60
    box.note(
        f"PID 1 hangs -> the watchdog resets after {reset_after_s:.1f} s, first frame "
        f"{box.first_frame_s():.1f} s after that ({time.monotonic() - here:.0f} s here)"
    )
