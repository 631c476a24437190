"""`bunraku doctor`: each check against a machine that is laid out as files, and the command on this one."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from appliance.box.fallback import Fallen
from appliance.cli.doctor import box_state, processor, storage, venue
from appliance.cli.doctor.doctor_command import CHECKS, findings
from appliance.cli.doctor.finding import Finding
from appliance.cli.doctor.host_view import HostView, RunningStage
from appliance.cli.doctor.sample import Sample, sample
from appliance.release.choice import Aside, Choice
from appliance.show.box import BoxConfig
from tests.bundles import write_show
from tests.system.box import PATIENCE_S, playing

DOCTOR = (sys.executable, "-m", "appliance.cli", "doctor")
STAGE_PID = 4711


def lay(root: Path, path: str, content: str = "") -> None:
    file = root / path.lstrip("/")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)


def verdicts(found: Iterable[Finding]) -> list[tuple[str, str]]:
    return [(finding.what, finding.verdict) for finding in found]


def only(found: Iterable[Finding]) -> Finding:
    (finding,) = found
    return finding


def quiet(late_ms: tuple[float, ...] = (0.1,) * 200, **changes: object) -> Sample:
    usual = {"late_ms": late_ms, "shares": (), "interrupts": 0.0, "stolen": 0.0, "cores": 4}
    return Sample(**{**usual, **changes})  # type: ignore[arg-type]


def test_every_finding_that_is_not_well_says_what_to_do(tmp_path: Path) -> None:
    """On a machine of which nothing is known, too, no check raises."""
    for finding in findings(HostView(tmp_path)):
        assert finding.words.endswith("."), finding
        assert bool(finding.cure) == (finding.verdict != "ok"), finding


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_no_check_stumbles_over_nonsense(
    check: Callable[[HostView], Iterable[Finding]], tmp_path: Path
) -> None:
    for path in (
        *("proc/meminfo", "proc/mounts", "proc/swaps", "proc/net/udp", f"proc/{STAGE_PID}/stat"),
        *("sys/class/thermal/thermal_zone0/temp", "sys/class/watchdog/watchdog0/state"),
        *("sys/block/mmcblk0/device/type", "sys/class/rfkill/rfkill0/type", "run/bunraku/chosen.json"),
        *("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", f"proc/{STAGE_PID}/status"),
    ):
        lay(tmp_path, path, "\0 nonsense : 7\nmore: of it\n")
    stage = RunningStage(STAGE_PID, {})
    assert all(finding.words for finding in check(HostView(tmp_path, stage=stage)))


@pytest.mark.parametrize(("policy", "verdict"), [("1", "ok"), ("0", "wrong")], ids=["fifo", "ordinary"])
def test_the_stage_that_dances_is_asked_for_its_priority(tmp_path: Path, policy: str, verdict: str) -> None:
    fields = " ".join(["S", *["0"] * 36, "70", policy, "0"])
    lay(tmp_path, f"/proc/{STAGE_PID}/stat", f"{STAGE_PID} (bunraku (play)) {fields}")
    found = only(processor.realtime_rights(HostView(tmp_path, stage=RunningStage(STAGE_PID, {}))))
    assert found.verdict == verdict
    if verdict == "ok":
        assert "70" in found.words


def test_this_process_s_own_numbers_are_where_they_are_looked_for() -> None:
    patient = HostView(stage=RunningStage(os.getpid(), {}))
    assert only(processor.realtime_rights(patient)).verdict == "wrong"  # tests are ordinary
    assert only(processor.locked_memory(patient)).verdict == "better"


@pytest.mark.parametrize(
    ("late_ms", "verdict"),
    [((0.1,) * 200, "ok"), ((0.1,) * 199 + (9.0,), "better"), ((0.1,) * 190 + (16.0,) * 10, "wrong")],
)
def test_late_wake_ups(late_ms: tuple[float, ...], verdict: str) -> None:
    assert only(processor.wake_ups(quiet(late_ms))).verdict == verdict


def test_who_else_uses_the_cores_is_named() -> None:
    assert only(processor.others(quiet(shares=(("cron", 12, 0.01),)))).verdict == "ok"
    found = only(processor.others(quiet(shares=(("updatedb", 77, 0.9), ("cron", 12, 0.01)))))
    assert found.verdict == "better"
    assert "updatedb (process 77, 90 % of a core)" in found.words
    assert "cron" not in found.words
    crowd = tuple(("stress", pid, 0.9) for pid in range(4))
    assert only(processor.others(quiet(shares=crowd))).verdict == "wrong"


def test_interrupts_and_a_host_that_takes_time_away() -> None:
    assert verdicts(processor.interrupts(quiet())) == [("interrupts", "ok")]
    found = verdicts(processor.interrupts(quiet(interrupts=0.5, stolen=0.1)))
    assert found == [("interrupts", "better"), ("virtual machine", "better")]


def test_a_second_of_looking_sees_a_busy_process_and_wakes_each_time() -> None:
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            seen = sample(70, frozenset())
            unseen = sample(70, frozenset({busy.pid}))
        finally:
            busy.kill()
    assert len(seen.late_ms) == 200
    assert busy.pid in [pid for _, pid, share in seen.shares if share > 0.0]
    assert busy.pid not in [pid for _, pid, _ in unseen.shares]


@pytest.mark.parametrize(("governor", "verdict"), [("performance", "ok"), ("ondemand", "better")])
def test_the_processor_s_pace(tmp_path: Path, governor: str, verdict: str) -> None:
    lay(tmp_path, "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", f"{governor}\n")
    assert only(processor.governor(HostView(tmp_path))).verdict == verdict


@pytest.mark.parametrize(("millidegrees", "verdict"), [(48000, "ok"), (74500, "better"), (85000, "wrong")])
def test_warmth(tmp_path: Path, millidegrees: int, verdict: str) -> None:
    lay(tmp_path, "/sys/class/thermal/thermal_zone0/temp", "31000\n")
    lay(tmp_path, "/sys/class/thermal/thermal_zone1/temp", f"{millidegrees}\n")
    found = only(processor.warmth(HostView(tmp_path)))
    assert found.verdict == verdict
    assert f"{millidegrees / 1000:.0f} degrees" in found.words


@pytest.mark.parametrize(
    ("bits", "verdict"),
    [("0", "ok"), ("50005", "wrong"), ("4", "wrong"), ("50000", "better"), ("80000", "better")],
)
def test_a_pi_that_starves_or_is_slowed_down(tmp_path: Path, bits: str, verdict: str) -> None:
    lay(tmp_path, "/sys/devices/platform/soc/soc:firmware/get_throttled", f"{bits}\n")
    assert only(processor.power(HostView(tmp_path))).verdict == verdict


def test_a_machine_without_such_a_sign_says_nothing_about_its_power(tmp_path: Path) -> None:
    assert list(processor.power(HostView(tmp_path))) == []
    lay(tmp_path, "/sys/class/hwmon/hwmon2/name", "rpi_volt\n")
    lay(tmp_path, "/sys/class/hwmon/hwmon2/in0_lcrit_alarm", "1\n")
    assert only(processor.power(HostView(tmp_path))).verdict == "wrong"


def test_folders_that_cannot_be_written_or_are_not_named(tmp_path: Path) -> None:
    assert only(storage.data_folders(HostView(tmp_path))).verdict == "better"
    state = BoxConfig.model_validate({"state": tmp_path / "state"}, context={"directory": tmp_path})
    assert only(storage.data_folders(HostView(box=state))).verdict == "ok"
    nowhere = BoxConfig.model_validate({"state": "/proc/sys/state"}, context={"directory": tmp_path})
    assert only(storage.data_folders(HostView(box=nowhere))).verdict in ("wrong", "better")  # no room in it


@pytest.mark.parametrize(
    ("line", "verdict"),
    [
        ("overlay / overlay rw,lowerdir=/ro 0 0", "ok"),
        ("/dev/sda2 / ext4 ro,noatime 0 0", "ok"),
        ("/dev/sda2 / ext4 rw,relatime 0 0", "better"),
    ],
)
def test_a_system_that_can_be_written_can_be_damaged(tmp_path: Path, line: str, verdict: str) -> None:
    lay(tmp_path, "/proc/mounts", f"proc /proc proc rw 0 0\n{line}\n")
    assert only(storage.system_partition(HostView(tmp_path))).verdict == verdict


def test_a_data_partition_that_did_not_come(tmp_path: Path) -> None:
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
    assert "/var/swap" in swap.words
    assert "zram" not in swap.words


def test_a_show_that_was_refused_is_told(tmp_path: Path) -> None:
    (tmp_path / "run/bunraku").mkdir(parents=True)
    Choice(refused=("show.yaml:3: no such key.", "It is not danced.")).write(
        tmp_path / "run/bunraku/chosen.json"
    )
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert "show.yaml:3: no such key.\nIt is not danced." in found[1].words


def test_a_show_that_was_put_aside_is_told_as_such(tmp_path: Path) -> None:
    (tmp_path / "run/bunraku").mkdir(parents=True)
    Choice(aside=(Aside("new+", "The show did not dance."),)).write(tmp_path / "run/bunraku/chosen.json")
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert found[1].words == "The show did not dance."


def test_a_box_that_is_on_and_does_not_dance_is_wrong(tmp_path: Path) -> None:
    assert only(box_state.stage(HostView(tmp_path))).verdict == "ok"
    (tmp_path / "run/bunraku").mkdir(parents=True)
    Choice().write(tmp_path / "run/bunraku/chosen.json")
    assert only(box_state.stage(HostView(tmp_path))).verdict == "wrong"


def test_a_release_that_was_put_aside_is_told(tmp_path: Path) -> None:
    lay(tmp_path, "/data/bunraku-releases/0.2.0.aside", "its stage did not dance\n")
    found = only(storage.releases(HostView(tmp_path)))
    assert found.verdict == "better"
    assert "0.2.0 is put aside: its stage did not dance. The release" in found.words
    assert "bunraku-install --use 0.2.0" in found.cure


@pytest.mark.parametrize(("state", "verdict"), [("active", "ok"), ("inactive", "better"), (None, "better")])
def test_the_watchdog(tmp_path: Path, state: str | None, verdict: str) -> None:
    if state is not None:
        lay(tmp_path, "/sys/class/watchdog/watchdog0/state", f"{state}\n")
        lay(tmp_path, "/sys/class/watchdog/watchdog0/timeout", "10\n")
    assert only(box_state.watchdog(HostView(tmp_path))).verdict == verdict


def test_how_the_dance_fares() -> None:
    health = {"rate_hz": 50.0, "ticks": 5000, "late": 3, "skipped": 0, "complaints": []}
    assert only(box_state.stage(HostView(stage=RunningStage(1, health)))).verdict == "ok"
    found = list(
        box_state.stage(HostView(stage=RunningStage(1, {**health, "late": 300, "complaints": ["No key."]})))
    )
    assert [one.verdict for one in found] == ["better", "better"]
    assert only(box_state.stage(HostView())).verdict == "ok"


def test_fallbacks_that_are_in_force_are_told_with_their_words() -> None:
    told = (
        ("stage", Fallen("sensor-silent", 3, True, "Sensor left-wrist is silent.")),
        ("lights", Fallen("wire-gone", 1, False, "It is back.")),
    )
    found = list(box_state.stage(HostView(stage=RunningStage(1, {}, told))))
    assert [(one.what, one.words) for one in found[1:]] == [
        ("stage: sensor-silent", "Sensor left-wrist is silent.")
    ]


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


def test_a_network_that_nothing_is_plugged_into(tmp_path: Path) -> None:
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


def test_displays(tmp_path: Path) -> None:
    assert verdicts(venue.display(HostView(tmp_path))) == [("display", "better"), ("graphics", "better")]
    lay(tmp_path, "/sys/class/drm/card1-HDMI-A-1/status", "connected\n")
    lay(tmp_path, "/sys/class/drm/card1-HDMI-A-2/status", "disconnected\n")
    lay(tmp_path, "/dev/dri/renderD128")
    found = only(venue.display(HostView(tmp_path)))
    assert found.verdict == "ok"
    assert "HDMI-A-1" in found.words
    assert "HDMI-A-2" not in found.words


def test_a_port_that_another_process_holds_is_wrong_and_it_is_named(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        box = BoxConfig.model_validate({"sensors": {"udp": {"port": port}}, "control": None})
        found = next(iter(venue.ports(HostView(box=box))))
        name = Path(f"/proc/{os.getpid()}/comm").read_text().strip()
        assert (found.verdict, f"{name} (process {os.getpid()})" in found.words) == ("wrong", True)
    assert next(iter(venue.ports(HostView(box=box)))).verdict == "ok"


@pytest.mark.realtime
def test_beside_a_dancing_box_it_finds_the_box_and_costs_it_no_frame(tmp_path: Path) -> None:
    with playing(write_show(tmp_path / "show"), tmp_path) as box:
        first = box.frames(70)[-1]  # after a second the stage has told its figures
        done = subprocess.run(
            [*DOCTOR, "--box", str(tmp_path / "box.yaml"), "--json"],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
        found = {one["what"]: one for one in json.loads(done.stdout)}
        rate = re.match(r"(\d+\.\d) Hz; \d+ of \d+ ticks", found["stage"]["words"])
        assert rate and float(rate[1]) > 25.0, found["stage"]  # this machine may have been held up
        assert found["port for sensors"]["words"].endswith("the box listens.")
        assert found["port for commands"]["verdict"] == "ok"
        assert "appliance" not in found["other programs"]["words"]
        assert box.frames(1)[0][0] > first[0]
        assert box.process.poll() is None
    assert done.returncode == any(one["verdict"] == "wrong" for one in found.values())


def test_a_broken_box_file_is_one_more_thing_that_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("sensors: {udp: {prot: 9750}}\n")
    command = [*DOCTOR, "--box", str(tmp_path / "box.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 1
    assert "wrong" in done.stdout.splitlines()[0]
    assert "Did you mean 'port'?" in " ".join(done.stdout.split())
