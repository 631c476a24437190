"""`bunraku doctor`: what holds for every check, the verdicts on files of the kernel, and the command."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from appliance.cli.doctor import box_state, processor, storage
from appliance.cli.doctor.doctor_command import CHECKS, findings
from appliance.cli.doctor.host_view import HostView, RunningStage
from hw_sim.peers import free_ports
from tests.bundles import write_show
from tests.system.box import playing
from tests.system.machine_of_files import STAGE_PID, Check, lay, only
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
