"""`bunraku doctor`: each check against a machine made of files, and the command on this machine."""

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
from tests.system.box import playing
from tests.system.processes import run_bunraku

Check = Callable[[HostView], Iterable[Finding]]
STAGE_PID = 4711


def lay(root: Path, path: str, content: str = "") -> None:
    file = root / path.lstrip("/")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)


def lay_choice(root: Path, choice: Choice) -> None:
    lay(root, "run/bunraku/chosen.json")
    choice.write(root / "run/bunraku/chosen.json")


def verdicts(found: Iterable[Finding]) -> list[tuple[str, str]]:
    return [(finding.what, finding.verdict) for finding in found]


def only(found: Iterable[Finding]) -> Finding:
    (finding,) = found
    return finding


def quiet(late_ms: tuple[float, ...] = (0.1,) * 200, **changes: object) -> Sample:
    usual = {"late_ms": late_ms, "shares": (), "interrupts": 0.0, "stolen": 0.0, "cores": 4}
    return Sample(**{**usual, **changes})  # type: ignore[arg-type]


def test_every_finding_but_ok_has_a_cure(tmp_path: Path) -> None:
    """Also on a machine that reveals nothing; no check raises."""
    for finding in findings(HostView(tmp_path)):
        assert finding.words.endswith("."), finding
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
    assert all(finding.words for finding in check(HostView(tmp_path, stage=stage)))


@pytest.mark.parametrize(("policy", "verdict"), [("1", "ok"), ("0", "wrong")], ids=["fifo", "ordinary"])
def test_the_priority_of_the_running_stage_is_read(tmp_path: Path, policy: str, verdict: str) -> None:
    fields = " ".join(["S", *["0"] * 36, "70", policy, "0"])
    lay(tmp_path, f"/proc/{STAGE_PID}/stat", f"{STAGE_PID} (bunraku (play)) {fields}")
    found = only(processor.realtime_rights(HostView(tmp_path, stage=RunningStage(STAGE_PID, {}))))
    assert found.verdict == verdict
    if verdict == "ok":
        assert "70" in found.words


def test_the_kernel_s_figures_are_found_for_this_process() -> None:
    patient = HostView(stage=RunningStage(os.getpid(), {}))
    assert only(processor.realtime_rights(patient)).verdict == "wrong"  # tests are ordinary
    assert only(processor.locked_memory(patient)).verdict == "better"


@pytest.mark.parametrize(
    ("late_ms", "verdict"),
    [((0.1,) * 200, "ok"), ((0.1,) * 199 + (9.0,), "better"), ((0.1,) * 190 + (16.0,) * 10, "wrong")],
)
def test_late_wake_ups(late_ms: tuple[float, ...], verdict: str) -> None:
    assert only(processor.wake_ups(quiet(late_ms))).verdict == verdict


def test_other_users_of_the_cores_are_named() -> None:
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


def test_a_sample_of_a_second_sees_a_busy_process_and_wakes_each_time() -> None:
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            seen = sample(70, frozenset())
            unseen = sample(70, frozenset({busy.pid}))
        finally:
            busy.kill()
    assert len(seen.late_ms) == 200
    assert busy.pid in [pid for _, pid, share in seen.shares if share > 0.0]
    assert busy.pid not in [pid for _, pid, _ in unseen.shares]


GOVERNOR = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"
THERMAL = "/sys/class/thermal"
THROTTLED = "/sys/devices/platform/soc/soc:firmware/get_throttled"
WATCHDOG = "/sys/class/watchdog/watchdog0"


@pytest.mark.parametrize(
    ("check", "files", "verdict", "words"),
    [
        (processor.governor, {GOVERNOR: "performance"}, "ok", ""),
        (processor.governor, {GOVERNOR: "ondemand"}, "better", "ondemand"),
        *(
            (
                processor.warmth,
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
    check: Check, files: dict[str, str], verdict: str, words: str, tmp_path: Path
) -> None:
    for path, content in files.items():
        lay(tmp_path, path, f"{content}\n")
    found = only(check(HostView(tmp_path)))
    assert found.verdict == verdict
    assert words in found.words


def test_a_machine_that_reports_no_throttling_has_no_finding_about_power(tmp_path: Path) -> None:
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
    assert "/var/swap" in swap.words
    assert "zram" not in swap.words


def test_a_refused_show_is_reported(tmp_path: Path) -> None:
    lay_choice(tmp_path, Choice(refused=("show.yaml:3: no such key.", "It is not danced.")))
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert "show.yaml:3: no such key.\nIt is not danced." in found[1].words


def test_a_show_put_aside_is_reported(tmp_path: Path) -> None:
    lay_choice(tmp_path, Choice(aside=(Aside("new+", "The show did not dance."),)))
    found = list(storage.choice(HostView(tmp_path)))
    assert [one.verdict for one in found] == ["ok", "better"]
    assert found[1].words == "The show did not dance."


def test_a_box_that_is_on_and_does_not_dance_is_wrong(tmp_path: Path) -> None:
    assert only(box_state.stage(HostView(tmp_path))).verdict == "ok"
    lay_choice(tmp_path, Choice())
    assert only(box_state.stage(HostView(tmp_path))).verdict == "wrong"


def test_a_release_put_aside_is_reported(tmp_path: Path) -> None:
    lay(tmp_path, "/data/bunraku-releases/0.2.0.aside", "its stage did not dance\n")
    found = only(storage.releases(HostView(tmp_path)))
    assert found.verdict == "better"
    assert "0.2.0 is put aside: its stage did not dance. The release" in found.words
    assert "bunraku-install --use 0.2.0" in found.cure


def test_the_health_of_the_dance() -> None:
    health = {"rate_hz": 50.0, "ticks": 5000, "late": 3, "skipped": 0, "complaints": []}
    assert only(box_state.stage(HostView(stage=RunningStage(1, health)))).verdict == "ok"
    found = list(
        box_state.stage(HostView(stage=RunningStage(1, {**health, "late": 300, "complaints": ["No key."]})))
    )
    assert [one.verdict for one in found] == ["better", "better"]
    assert only(box_state.stage(HostView())).verdict == "ok"


def test_fallbacks_in_force_are_reported_with_their_words() -> None:
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
        first = box.frames(70)[-1]  # after a second the stage has published its health
        done = run_bunraku("doctor", "--box", box.box_file, "--json")
        found = {one["what"]: one for one in json.loads(done.stdout)}
        rate = re.match(r"(\d+\.\d) Hz; \d+ of \d+ ticks", found["stage"]["words"])
        assert rate and float(rate[1]) > 25.0, found["stage"]  # this machine may have been busy
        assert found["port for sensors"]["words"].endswith("the box listens.")
        assert found["port for commands"]["verdict"] == "ok"
        assert "appliance" not in found["other programs"]["words"]
        assert box.frames(1)[0][0] > first[0]
        assert box.process.poll() is None
    assert done.returncode == any(one["verdict"] == "wrong" for one in found.values())


def test_a_broken_box_file_is_one_more_finding(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("sensors: {udp: {prot: 9750}}\n")
    done = run_bunraku("doctor", "--box", tmp_path / "box.yaml")
    assert done.returncode == 1
    assert "wrong" in done.stdout.splitlines()[0]
    assert "Did you mean 'port'?" in " ".join(done.stdout.split())
