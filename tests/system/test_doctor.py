"""`bunraku doctor`: what holds for every check, the verdicts on files of the kernel, and the command."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from appliance.box.fallback import Fallen
from appliance.box.process_health import Member
from appliance.box.roster import RosterLine
from appliance.cli.doctor import box_state, processor, show_parts, storage, venue
from appliance.cli.doctor.doctor_command import CHECKS, findings
from appliance.cli.doctor.finding import for_phone
from appliance.cli.doctor.host_view import HostView, RunningStage
from appliance.cli.doctor.sample import Sample, sample
from appliance.release.choice import Aside, Choice
from appliance.show.box import BoxConfig
from appliance.stage.sensor_lines import roster_lines
from hw_sim.peers import free_ports
from tests.bundles import write_show
from tests.cli.running_box import LEFT, LOST, SPARE
from tests.system.box import playing
from tests.system.machine_of_files import STAGE_PID, Check, lay, only, verdicts
from tests.system.processes import BUNRAKU, run, run_bunraku


def test_every_finding_but_ok_has_a_cure(tmp_path: Path) -> None:
    """Also on a machine that reveals nothing; no check raises."""
    for finding in findings(HostView(tmp_path)):
        assert finding.message.endswith("."), finding
        assert bool(finding.cure) == (finding.verdict != "ok"), finding


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_no_check_stumbles_over_nonsense(check: Check, tmp_path: Path) -> None:
    for path in (
        *("proc/meminfo", "proc/mounts", "proc/swaps", "proc/net/udp", f"proc/{STAGE_PID}/stat"),
        *("sys/class/thermal/thermal_zone0/temp", "sys/class/watchdog/watchdog0/state"),
        *("sys/block/mmcblk0/device/type", "sys/class/rfkill/rfkill0/type", "run/bunraku/chosen.json"),
        *("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", f"proc/{STAGE_PID}/status"),
    ):
        lay(tmp_path, path, "\0 nonsense : 7\nmore: of it\n")
    stage = RunningStage(STAGE_PID, {})
    assert all(finding.message for finding in check(HostView(tmp_path, stage=stage)))


GOVERNOR = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"
THERMAL = "/sys/class/thermal"
THROTTLED = "/sys/devices/platform/soc/soc:firmware/get_throttled"
WATCHDOG = "/sys/class/watchdog/watchdog0"


@pytest.mark.parametrize(
    ("check", "files", "verdict", "message"),
    [
        (processor.governor, {GOVERNOR: "performance"}, "ok", ""),
        (processor.governor, {GOVERNOR: "ondemand"}, "better", "ondemand"),
        *(
            (
                processor.temperature,
                {f"{THERMAL}/thermal_zone0/temp": "31000", f"{THERMAL}/thermal_zone1/temp": millidegrees},
                verdict,
                f"{int(millidegrees) / 1000:.0f} degrees",
            )
            for millidegrees, verdict in (("48000", "ok"), ("74500", "better"), ("85000", "wrong"))
        ),
        (processor.power, {THROTTLED: "0"}, "ok", ""),
        (processor.power, {THROTTLED: "50005"}, "wrong", "voltage"),
        (processor.power, {THROTTLED: "4"}, "wrong", "slowed down"),
        (processor.power, {THROTTLED: "50000"}, "better", "voltage"),
        (processor.power, {THROTTLED: "80000"}, "better", "slowed down"),
        *(
            (storage.system_partition, {"/proc/mounts": f"proc /proc proc rw 0 0\n{line}"}, verdict, "")
            for line, verdict in (
                ("overlay / overlay rw,lowerdir=/ro 0 0", "ok"),
                ("/dev/sda2 / ext4 ro,noatime 0 0", "ok"),
                ("/dev/sda2 / ext4 rw,relatime 0 0", "better"),
            )
        ),
        (box_state.watchdog, {f"{WATCHDOG}/state": "active", f"{WATCHDOG}/timeout": "10"}, "ok", "10 s"),
        (box_state.watchdog, {f"{WATCHDOG}/state": "inactive", f"{WATCHDOG}/timeout": "10"}, "better", ""),
        (box_state.watchdog, {}, "better", ""),
    ],
)
def test_the_verdict_on_files_of_the_kernel(
    check: Check, files: dict[str, str], verdict: str, message: str, tmp_path: Path
) -> None:
    for path, content in files.items():
        lay(tmp_path, path, f"{content}\n")
    found = only(check(HostView(tmp_path)))
    assert found.verdict == verdict
    assert message in found.message


@pytest.mark.realtime
def test_beside_a_dancing_box_it_finds_the_box_and_costs_it_no_frame(tmp_path: Path) -> None:
    with playing(write_show(tmp_path / "show"), tmp_path) as box:
        first = box.frames(70)[-1]  # after a second the stage has published its health
        done = run([*BUNRAKU, "doctor", "--box", box.box_file, "--json"])
        found = {one["what"]: one for one in json.loads(done.stdout)}
        rate = re.match(r"(\d+\.\d) Hz; \d+ of \d+ ticks", found["stage"]["message"])
        assert rate and float(rate[1]) > 25.0, found["stage"]  # this machine may have been busy
        assert found["port for sensors"]["message"].endswith("the box listens.")
        assert found["port for commands"]["verdict"] == "ok"
        assert "appliance" not in found["other programs"]["message"]
        assert box.frames(1)[0][0] > first[0]
        assert box.process.poll() is None
    assert done.returncode == any(one["verdict"] == "wrong" for one in found.values())


@pytest.mark.realtime
def test_a_show_without_its_sensor_and_its_receiver_is_wrong(tmp_path: Path) -> None:
    (nobody,) = free_ports(1)
    settings = {"outputs": {"osc": [{"port": nobody}], "dmx": [{"universe": 1, "wire": "udmx"}]}}
    with playing(write_show(tmp_path / "show"), tmp_path, settings=settings) as box:
        box.await_output(f"Receiver 127.0.0.1:{nobody}")
        done = run([*BUNRAKU, "doctor", "--box", box.box_file, "--json"])
        found = {one["what"]: one for one in json.loads(done.stdout)}
    assert done.returncode == 1
    assert found["sensor left-wrist"]["verdict"] == "wrong"
    (receiver,) = [one for what, one in found.items() if what.startswith(f"receiver 127.0.0.1:{nobody}")]
    assert receiver["verdict"] == "wrong" and "no program listens on that port" in receiver["message"]
    assert found["lights"]["verdict"] == "ok", "this show has no lamps"


def test_a_broken_box_file_is_one_more_finding(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("sensors: {udp: {prot: 9750}}\n")
    done = run_bunraku("doctor", "--box", tmp_path / "box.yaml")
    assert done.returncode == 1
    assert "wrong" in done.stdout.splitlines()[0]
    assert "Did you mean 'port'?" in " ".join(done.stdout.split())


def lay_choice(root: Path, choice: Choice) -> None:
    lay(root, "run/bunraku/chosen.json")
    choice.write(root / "run/bunraku/chosen.json")


def test_a_refused_show_is_reported(tmp_path: Path) -> None:
    lay_choice(tmp_path, Choice(refused=("show.yaml:3: no such key.", "It is not danced.")))
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert "show.yaml:3: no such key.\nIt is not danced." in found[1].message


def test_a_show_put_aside_is_reported(tmp_path: Path) -> None:
    lay_choice(tmp_path, Choice(aside=(Aside("new+", "The show did not dance."),)))
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert found[1].message == "The show did not dance."


def test_a_box_that_is_on_and_does_not_dance_is_wrong(tmp_path: Path) -> None:
    assert only(box_state.stage(HostView(tmp_path))).verdict == "ok"
    lay_choice(tmp_path, Choice())
    assert only(box_state.stage(HostView(tmp_path))).verdict == "wrong"


def test_a_release_put_aside_is_reported(tmp_path: Path) -> None:
    lay(tmp_path, "/data/bunraku-releases/0.2.0.aside", "its stage did not dance\n")
    found = only(storage.releases(HostView(tmp_path)))
    assert found.verdict == "better"
    assert "0.2.0 is put aside: its stage did not dance. The release" in found.message
    assert "bunraku release use 0.2.0" in found.cure


def test_the_health_of_the_dance() -> None:
    health = {"rate_hz": 50.0, "ticks": 5000, "late": 3, "skipped": 0, "complaints": []}
    assert only(box_state.stage(HostView(stage=RunningStage(1, health)))).verdict == "ok"
    found = list(
        box_state.stage(HostView(stage=RunningStage(1, {**health, "late": 300, "complaints": ["No key."]})))
    )
    assert [one.verdict for one in found] == ["better", "better"]
    assert only(box_state.stage(HostView())).verdict == "ok"


def test_fallbacks_in_force_are_reported_with_their_words() -> None:
    reported = (
        ("stage", Fallen("sensor-silent", 3, True, "Sensor left-wrist is silent. Charge it.")),
        ("lights", Fallen("wire-gone", 1, False, "It is back.")),
    )
    found = list(box_state.stage(HostView(stage=RunningStage(1, {}, reported))))
    assert [(one.what, one.verdict, one.message, one.cure) for one in found[1:]] == [
        ("stage: sensor-silent", "wrong", "Sensor left-wrist is silent.", "Charge it.")
    ]


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


def dancing(**health: Any) -> HostView:
    return HostView(stage=RunningStage(1, health))


def roster(**neutral: str) -> list[RosterLine]:
    return roster_lines([LEFT, LOST, SPARE], lambda name: neutral.get(name.replace("-", "_"), ""))


def test_each_sensor_of_the_show_has_a_line_and_a_spare_none() -> None:
    found = list(show_parts.sensors(dancing(sensors=roster(left_wrist="taken", head="kept"))))
    assert verdicts(found) == [("sensor left-wrist", "better"), ("sensor head", "wrong")]
    assert "50 readings a second; 1.2 % are lost; its battery is at 12 %" in found[0].message
    assert "lost, last heard 3 min ago: its joint moves freely" in found[1].message
    assert "bunraku sensors replace head SPARE" in found[1].cure


@pytest.mark.parametrize("state", ["absent", "greeted", "lost"])
def test_a_sensor_that_does_not_send_is_wrong(state: str) -> None:
    lines = roster_lines([LEFT._replace(state=state)], lambda _: "taken")
    assert only(show_parts.sensors(dancing(sensors=lines))).verdict == "wrong"


def test_a_sensor_without_a_key_is_wrong() -> None:
    found = only(show_parts.sensors(dancing(sensors=[], not_let_in=["right-ankle"])))
    assert (found.what, found.verdict) == ("sensor right-ankle", "wrong")
    assert "bunraku provision --name right-ankle" in found.cure


def test_each_receiver_has_a_line_and_a_dead_one_is_wrong() -> None:
    gone = {"name": "10.0.0.9:9000 (joint)", "gone": True, "error": "that machine does not answer"}
    here = {"name": "10.0.0.8:9000 (joint)", "gone": False, "error": "", "asked_for": True}
    usual = {"name": "127.0.0.1:9000 (joint)", "gone": False, "error": "refused", "asked_for": False}
    found = list(show_parts.receivers(dancing(receivers=[gone, here, usual])))
    assert [one.verdict for one in found] == ["wrong", "ok", "ok"]
    assert found[0].what == "receiver 10.0.0.9:9000 (joint)"
    assert "that machine does not answer" in found[0].message


def test_each_wire_has_a_line_and_no_light_at_all_is_wrong() -> None:
    wired = BoxConfig.model_validate(
        {"outputs": {"dmx": [{"universe": 1, "wire": "artnet", "host": "10.0.0.7"}]}}, context={}
    )
    away, here = "Art-Net 10.0.0.7, universe 1", "sACN, universe 2"
    parts = {away: f"{away}: no network leads there. Its lights do not follow.", here: ""}
    lights = Member("lights", 1, False, (), parts)
    found = list(show_parts.wires(HostView(box=wired, stage=RunningStage(1, {}, (), (lights,)))))
    assert verdicts(found) == [(away, "wrong"), (here, "ok")]
    assert found[0].message == "no network leads there. Its lights do not follow."
    for members in ((), (lights._replace(late=True),)):
        found = list(show_parts.wires(HostView(box=wired, stage=RunningStage(1, {}, (), members))))
        assert verdicts(found) == [("lights", "wrong")]


def test_nothing_is_said_of_a_show_that_does_not_dance() -> None:
    for check in (show_parts.sensors, show_parts.receivers, show_parts.wires):
        assert list(check(HostView())) == []


def test_someone_with_a_phone_gets_no_path_of_a_file() -> None:
    said = "There is no key file /data/bunraku/keys/sensors.keys. `sudo ls /etc/fstab`, or 10.0.0.1:9000/udp."
    kept = "There is no key file sensors.keys. `sudo ls /etc/fstab`, or 10.0.0.1:9000/udp."
    assert for_phone(said) == kept
    assert for_phone("sensor on /dev/ttyACM0") == "sensor on ttyACM0"
    assert for_phone("Give /data a partition.") == "Give /data a partition."


def test_folders_that_cannot_be_written_or_are_not_named(tmp_path: Path) -> None:
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "better"
    state = BoxConfig.model_validate({"state": tmp_path / "state"}, context={"directory": tmp_path})
    assert only(storage.data_folders(HostView(box=state))).verdict == "ok"
    nowhere = state.model_copy(update={"state": Path("/proc/sys/state")})  # a box file could not name it
    assert only(storage.data_folders(HostView(box=nowhere))).verdict in ("wrong", "better")  # no room in it


PI = "overlayroot / overlay rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay,workdir=/w 0 0"
PI_MEMORY = "tmpfs-root /media/root-rw tmpfs rw,relatime 0 0"
IMAGE = "overlay / overlay rw,lowerdir=/l,upperdir=/run/bunraku-root/written,workdir=/w 0 0"
RUN = "tmpfs /run tmpfs rw,nosuid 0 0"
CARD = "/dev/mmcblk0p3 /data ext4 rw,noatime 0 0"
OVER_CARD = "/dev/mmcblk0p3 /data overlay rw,lowerdir=/m,upperdir=/media/root-rw/overlay/data,workdir=/w 0 0"


@pytest.mark.parametrize(
    ("mounted", "is_kept"),
    [
        (["/dev/mmcblk0p2 / ext4 rw,noatime 0 0"], True),
        ([PI_MEMORY, PI], False),
        ([PI], False),  # what lies under the root's overlay is not seen any more
        ([PI_MEMORY, PI, CARD], True),
        ([PI_MEMORY, PI, CARD, OVER_CARD], False),  # overlayroot takes other partitions too
        ([RUN, IMAGE], False),
        ([RUN, IMAGE, CARD], True),
        (["/dev/sda2 / ext4 rw 0 0", "tmpfs /data tmpfs rw 0 0"], False),
        (["/dev/sda2 / ext4 rw 0 0", "/dev/zram1 /data ext4 rw 0 0"], False),
        (["/dev/sda2 / ext4 rw 0 0", "o /data overlay rw,lowerdir=/a,upperdir=/var/b,workdir=/c 0 0"], True),
    ],
)
def test_data_that_lies_in_memory_is_wrong_whatever_holds_it(
    tmp_path: Path, mounted: list[str], is_kept: bool
) -> None:
    (tmp_path / "data/bunraku/keys").mkdir(parents=True)
    lay(tmp_path, "/proc/mounts", "\n".join(mounted) + "\n")
    keys = {"sensors": {"keys": "/data/bunraku/keys/sensors.keys"}, "state": "/data/bunraku/state"}
    box = BoxConfig.model_validate(keys, context={"directory": tmp_path})
    found = list(storage.data_folders(HostView(tmp_path, box)))
    assert {one.verdict for one in found} == {"ok" if is_kept else "wrong"}
    assert len(found) == 3, "the keys' folder, the state and what the box keeps besides"
    assert is_kept or all("in memory" in one.message and "keys" in one.message for one in found)
    assert not list((tmp_path / "data").rglob(".doctor-*"))


def test_mountinfo_says_the_same(tmp_path: Path) -> None:
    (tmp_path / "data/bunraku").mkdir(parents=True)
    lay(
        tmp_path,
        "/proc/self/mountinfo",
        "22 1 0:25 / /media/root-rw rw,relatime - tmpfs tmpfs-root rw\n"
        "23 1 0:24 / / rw,relatime shared:1 - overlay overlayroot "
        "rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay,workdir=/media/root-rw/overlay-workdir\n",
    )
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "wrong"


def test_a_disk_that_forgets_what_is_written_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = BoxConfig.model_validate({"state": tmp_path}, context={"directory": tmp_path})
    drop = os.posix_fadvise

    def forget(descriptor: int, start: int, length: int, advice: int) -> None:
        os.pwrite(descriptor, b"\0" * 4096, 0)
        drop(descriptor, start, length, advice)

    monkeypatch.setattr(os, "posix_fadvise", forget)
    found = only(storage.data_folders(HostView(box=state)))
    assert found.verdict == "wrong" and "came back changed" in found.message


def test_a_data_folder_without_a_journal_of_its_own_can_be_damaged_by_a_power_cut(tmp_path: Path) -> None:
    (tmp_path / "data/bunraku").mkdir(parents=True)
    lay(tmp_path, "/proc/mounts", "/dev/sda1 / ext4 rw 0 0\n/dev/sdb1 /data vfat rw 0 0\n")
    found = only(storage.data_folders(HostView(tmp_path)))
    assert found.verdict == "better" and "It is on vfat" in found.message
    lay(tmp_path, "/proc/mounts", "/dev/sda1 / ext4 rw 0 0\n/dev/sdb1 /data ext4 rw 0 0\n")
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "ok"


def test_a_missing_data_partition(tmp_path: Path) -> None:
    lay(tmp_path, "/etc/fstab", "# a comment\nLABEL=data /data ext4 nofail 0 2\n")
    lay(tmp_path, "/proc/mounts", "overlay / overlay rw 0 0\n/dev/sdb1 /media/bunraku vfat ro 0 0\n")
    assert verdicts(storage.media(HostView(tmp_path))) == [("data partition", "wrong"), ("stick", "ok")]
    lay(tmp_path, "/proc/mounts", "overlay / overlay rw 0 0\n/dev/sda4 /data ext4 rw 0 0\n")
    assert verdicts(storage.media(HostView(tmp_path))) == [("data partition", "ok")]


def test_wear(tmp_path: Path) -> None:
    lay(tmp_path, "/sys/block/mmcblk0/device/life_time", "0x02 0x09\n")
    lay(tmp_path, "/sys/block/mmcblk0/device/type", "MMC\n")
    lay(tmp_path, "/sys/block/mmcblk1/device/type", "SD\n")
    assert verdicts(storage.wear(HostView(tmp_path))) == [
        ("wear of mmcblk0", "wrong"),
        ("wear of mmcblk1", "ok"),
    ]


def test_memory_and_swap(tmp_path: Path) -> None:
    lay(tmp_path, "/proc/meminfo", "MemTotal: 4000000 kB\nMemAvailable:  90000 kB\n")
    lay(tmp_path, "/proc/swaps", "Filename Type\n/dev/zram0 partition 1\n/var/swap file 1\n")
    memory, swap = storage.memory(HostView(tmp_path))
    assert (memory.verdict, swap.verdict) == ("wrong", "better")
    assert "/var/swap" in swap.message
    assert "zram" not in swap.message


def test_radios(tmp_path: Path) -> None:
    lay(tmp_path, "/sys/class/rfkill/rfkill0/type", "bluetooth\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/name", "hci0\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/soft", "0\n")
    lay(tmp_path, "/sys/class/net/wlan0/phy80211/name", "phy0\n")
    lay(tmp_path, "/sys/drivers/brcmfmac/name")
    (tmp_path / "sys/class/net/wlan0/device").mkdir()
    (tmp_path / "sys/class/net/wlan0/device/driver").symlink_to(tmp_path / "sys/drivers/brcmfmac")
    lay(tmp_path, "/data/network/sensors.nmconnection")
    assert verdicts(venue.radios(HostView(tmp_path))) == [("bluetooth", "better"), ("wi-fi", "better")]


def test_an_access_point_that_is_not_on_the_air_is_wrong(tmp_path: Path) -> None:
    lay(tmp_path, "/data/network/sensors.nmconnection", "[connection]\ninterface-name=wlan7\n")
    found = only(venue.radios(HostView(tmp_path)))
    assert found.verdict == "wrong" and "wlan7 is not plugged in" in found.message
    lay(tmp_path, "/sys/class/net/wlan7/phy80211/name", "phy7\n")
    assert list(venue.radios(HostView(tmp_path))) == []
    lay(tmp_path, "/sys/class/rfkill/rfkill0/type", "wlan\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/name", "phy7\n")
    lay(tmp_path, "/sys/class/rfkill/rfkill0/soft", "1\n")
    assert only(venue.radios(HostView(tmp_path))).verdict == "wrong"
    (tmp_path / "data/network/sensors.nmconnection").unlink()
    assert only(venue.radios(HostView(tmp_path))).verdict == "ok", "sensors by a router"


def test_a_network_without_a_cable(tmp_path: Path) -> None:
    lay(tmp_path, "/sys/class/net/eth0/carrier", "0\n")
    (tmp_path / "sys/class/net/eth0/device").mkdir()
    assert only(venue.network(HostView(tmp_path))).verdict == "better"
    lay(tmp_path, "/sys/class/net/eth0/carrier", "1\n")
    assert only(venue.network(HostView(tmp_path))).verdict == "ok"


def test_cables_and_adapters(tmp_path: Path) -> None:
    wires = [
        {"universe": 1, "wire": "udmx"},
        {"universe": 2, "wire": "usb-pro", "device": str(tmp_path / "tty")},
    ]
    box = BoxConfig.model_validate(
        {"sensors": {"serial": [{"device": "/dev/ttyACM0"}]}, "outputs": {"dmx": wires}},
        context={"directory": tmp_path},
    )
    assert only(venue.cables(HostView(tmp_path, box))).verdict == "wrong"
    lay(tmp_path, "/dev/ttyACM0")
    assert only(venue.cables(HostView(tmp_path, box))).verdict == "ok"
    lay(tmp_path, "/sys/bus/usb/devices/1-1/idVendor", "16c0\n")
    lay(tmp_path, "/sys/bus/usb/devices/1-1/idProduct", "05dc\n")
    assert [one.verdict for one in venue.adapters(HostView(tmp_path, box))] == ["ok", "ok"]
    lay(tmp_path, "/sys/bus/usb/devices/1-1/idProduct", "0001\n")
    assert next(iter(venue.adapters(HostView(tmp_path, box)))).verdict == "wrong"
    here = [one.verdict for one in venue.adapters(HostView(Path("/"), box))]
    assert here[1] == "wrong"  # the path that the box file names is not there
    (tmp_path / "tty").touch()
    assert [one.verdict for one in venue.adapters(HostView(Path("/"), box))][1] == "ok"


def test_adapters_that_are_left_out_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    cables = []
    for number in range(2):
        cable = ListPortInfo(f"/dev/ttyUSB{number}", skip_link_detection=True)
        cable.vid, cable.pid, cable.serial_number = 0x0403, 0x6015, f"D{number}"
        cables.append(cable)
    monkeypatch.setattr(list_ports, "comports", lambda: cables)
    wires = [{"universe": 1, "wire": "open-dmx"}]
    box = BoxConfig.model_validate({"outputs": {"dmx": wires}}, context={})
    found = only(venue.adapters(HostView(box=box)))
    assert found.verdict == "better"
    assert "It takes /dev/ttyUSB0" in found.message and "/dev/ttyUSB1 (serial: D1)" in found.message


def test_displays(tmp_path: Path) -> None:
    assert verdicts(venue.display(HostView(tmp_path))) == [("display", "better"), ("graphics", "better")]
    lay(tmp_path, "/sys/class/drm/card1-HDMI-A-1/status", "connected\n")
    lay(tmp_path, "/sys/class/drm/card1-HDMI-A-2/status", "disconnected\n")
    lay(tmp_path, "/dev/dri/renderD128")
    found = only(venue.display(HostView(tmp_path)))
    assert found.verdict == "ok"
    assert "HDMI-A-1" in found.message
    assert "HDMI-A-2" not in found.message


def test_a_port_that_another_process_holds_is_wrong_and_it_is_named(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        box = BoxConfig.model_validate({"sensors": {"udp": {"port": port}}, "control": None})
        found = next(iter(venue.ports(HostView(box=box))))
        name = Path(f"/proc/{os.getpid()}/comm").read_text().strip()
        assert (found.verdict, f"{name} (process {os.getpid()})" in found.message) == ("wrong", True)
    assert next(iter(venue.ports(HostView(box=box)))).verdict == "ok"


@pytest.fixture
def radio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> HostView:
    """This machine, whose loopback plays the access point's card; stand-ins say what `tmp_path` has."""
    for name in ("iw", "ip"):
        (tmp_path / name).write_text(f'#!/bin/sh\ncat "{tmp_path}/{name} $*"\n')
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(venue, "_access_point_card", lambda _: "lo")
    (tmp_path / "iw reg get").write_text("global\ncountry DE: DFS-ETSI\n")
    (tmp_path / "iw dev lo station dump").write_text("Station 1 (on lo)\n\tx: 2\nStation 2 (on lo)\n")
    (tmp_path / "ip -brief address show dev lo").write_text("lo UP 10.77.0.1/24\n")
    return HostView()


def test_what_the_access_point_really_does_is_said(radio: HostView, tmp_path: Path) -> None:
    reported = tmp_path / "iw dev lo info"
    reported.write_text("Interface lo\n\tssid stage net\n\ttype AP\n\tchannel 6 (2437 MHz), width: 20 MHz\n")
    found = only(venue.access_point(radio))
    assert found.verdict == "ok"
    assert "lo is on the air as 'stage net', channel 6 (2437 MHz), country DE; 2 joined." in found.message
    (tmp_path / "ip -brief address show dev lo").write_text("lo DOWN\n")
    assert "no address" in only(venue.access_point(radio)).message
    reported.write_text("Interface lo\n\ttype managed\n")
    found = only(venue.access_point(radio))
    assert found.verdict == "wrong" and "not on the air (it is 'managed')" in found.message
