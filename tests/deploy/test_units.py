"""The units of the box: systemd understands them, they are closed, and they never give up."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from appliance.box.notify import WATCHDOG_S
from appliance.cli.app import parser
from appliance.cli.preflight import parsed
from appliance.keeper.keeper import END_S
from appliance.show.box import RealtimeConfig

SYSTEM = Path(__file__).resolve().parents[2] / "deploy" / "system"
UNITS = SYSTEM / "usr/lib/systemd/system"
SHARED = UNITS / "bunraku-.service.d/10-shared.conf"
SERVICES = sorted(path.name for path in UNITS.glob("bunraku-*.service"))
LASTING = [name for name in SERVICES if "Type=notify" in (UNITS / name).read_text()]
EXPOSURE = 15  # tenths, as systemd-analyze counts: 1.5
STAGE_STARTS_WITHIN_S = 1.5  # on a small machine; hang to next frame is to take 3.0 s
BIN = "/opt/bunraku/current/bin"
# What an older systemd does not know yet, and leaves out: before 256, before 257.
NEWER = ("Unknown key 'WantsMountsFor'", "Failed to parse boolean value, ignoring: disconnected")


def systemd_version() -> int:
    if shutil.which("systemd-analyze") is None:
        return 0
    done = subprocess.run(["systemd-analyze", "--version"], capture_output=True, text=True, check=True)
    return int(done.stdout.split()[1])


needs_systemd = pytest.mark.skipif(
    systemd_version() < 250, reason="systemd-analyze 250 or newer is missing: apt-get install systemd"
)


def settings(name: str) -> dict[str, list[str]]:
    """What a service's file says and what all share, in systemd's order; each key with all of its values."""
    found: dict[str, list[str]] = {}
    own = sorted((UNITS / f"{name}.d").glob("*.conf"))
    for line in "".join(path.read_text() for path in (UNITS / name, SHARED, *own)).splitlines():
        if (match := re.match(r"(\w+)=(.*)", line)) is not None:
            found.setdefault(match[1], []).append(match[2])
    return found


def seconds(span: str) -> float:
    """Of a time span as these units write them: 300ms, or plain seconds."""
    return float(span.removesuffix("ms")) / 1000.0 if span.endswith("ms") else float(span)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root with our files, this machine's systemd units, and something at the place of each program."""
    root = tmp_path_factory.mktemp("root")
    shutil.copytree(SYSTEM, root, dirs_exist_ok=True)
    for path in Path("/usr/lib/systemd/system").iterdir():
        if path.is_file() and not (root / "usr/lib/systemd/system" / path.name).exists():
            shutil.copy(path, root / "usr/lib/systemd/system")
    programs = (
        "/usr/sbin/nft",
        "/usr/bin/systemctl",
        "/usr/bin/mv",
        "/usr/bin/rm",
        "/usr/bin/systemd-run",
        "/usr/bin/systemd-tmpfiles",
        "/bin/bash",
        "/usr/sbin/bunraku-release",
    )
    for program in (f"{BIN}/bunraku", f"{BIN}/python", *programs):
        path = root / program.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("#!/bin/sh\n")
        path.chmod(0o755)
    return root


@needs_systemd
def test_systemd_understands_all_units(root: Path) -> None:
    names = [
        *SERVICES,
        *(path.name for path in UNITS.iterdir() if path.suffix in (".target", ".path", ".mount")),
    ]
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", "--recursive-errors=no", f"--root={root}", *names],
        capture_output=True,
        text=True,
        check=False,
    )
    complaints = [line for line in done.stderr.splitlines() if not any(word in line for word in NEWER)]
    assert complaints == []
    assert done.returncode == 0 or complaints == []


@needs_systemd
@pytest.mark.parametrize("name", SERVICES)
def test_a_service_may_do_little_beyond_its_work(root: Path, name: str) -> None:
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", f"--threshold={EXPOSURE}", f"--root={root}", name],
        capture_output=True,
        text=True,
        check=False,
    )
    verdict = [line for line in done.stdout.splitlines() if "Overall exposure" in line]
    assert verdict, done.stderr
    assert done.returncode == 0, verdict[0]


@pytest.mark.parametrize("name", LASTING)
def test_what_lasts_is_watched_and_started_again_for_ever(name: str) -> None:
    said = settings(name)
    assert said["Restart"] == ["always"]
    assert said["StartLimitIntervalSec"] == ["0"]
    assert seconds(said["RestartSec"][0]) <= 1.0
    assert "RestartSteps" not in said, "its pause never becomes short again"
    assert seconds(said["WatchdogSec"][0]) > 0.0
    assert said["WatchdogSignal"] == ["SIGABRT"]
    assert said["NotifyAccess"] == ["main"]
    assert "PYTHONFAULTHANDLER=1" in said["Environment"]


@pytest.mark.parametrize("process", WATCHDOG_S)
def test_a_unit_is_watched_as_bunraku_play_watches_its_companion(process: str) -> None:
    assert seconds(settings(f"bunraku-{process}.service")["WatchdogSec"][0]) == WATCHDOG_S[process]


def test_a_service_may_open_more_files_than_one_laptop_opens_connections() -> None:
    assert int(settings("bunraku-console.service")["LimitNOFILE"][-1]) >= 4096


def test_a_stage_that_hangs_dances_again_within_three_seconds() -> None:
    said = settings("bunraku-stage.service")
    pause_s = sum(seconds(said[key][0]) for key in ("WatchdogSec", "TimeoutAbortSec", "RestartSec"))
    assert pause_s + STAGE_STARTS_WITHIN_S <= 3.0


def test_the_sound_cards_thread_may_take_the_priority_that_it_asks_for() -> None:
    """Half of the stage's (appliance/sound/run.py); what all services share would refuse it any."""
    said = settings("bunraku-sound.service")
    asked = RealtimeConfig().priority // 2
    assert int(said["LimitRTPRIO"][-1]) >= asked
    assert said["RestrictRealtime"][-1] == "no"
    assert "sched_setscheduler" in said["SystemCallFilter"][-1].split()


def test_nobody_keeps_the_stage_from_dancing() -> None:
    said = settings("bunraku-stage.service")
    assert not {"Requires", "Requisite", "BindsTo", "Wants", "StateDirectory"} & said.keys()
    assert said["After"] == ["bunraku-preflight.service"]
    for name in SERVICES:
        assert "bunraku-stage.service" not in settings(name).get("Before", [])
        assert "network-online.target" not in " ".join(settings(name).get("After", []))


def test_the_keeper_outlasts_an_orderly_end_of_all_others() -> None:
    """Whoever starts after the stage ends before it. An end that is not kept is taken for a power cut."""
    stops_s = {name: seconds(settings(name)["TimeoutStopSec"][0]) for name in LASTING}
    after_stage = [name for name in LASTING if "bunraku-stage.service" in settings(name).get("After", [])]
    assert len(after_stage) == 7
    longest_s = max(stops_s[name] for name in after_stage) + stops_s["bunraku-stage.service"]
    assert longest_s < END_S < stops_s["bunraku-keeper.service"]


def test_the_page_on_units_has_each_of_them_with_its_times() -> None:
    page = (SYSTEM.parents[1] / "docs" / "units.md").read_text("utf-8")
    rows = re.findall(r"(?m)^\| `(bunraku-\w+)` \| .+? \| (\S+).*? \| (\S+).*? \|", page)
    assert sorted(f"{name}.service" for name, *_ in rows) == SERVICES
    for name, watchdog, pause in rows:
        said = settings(f"{name}.service")
        times = said.get("WatchdogSec") or said.get("TimeoutStartSec") or ["-"]
        pauses = said["RestartSec"] if "Restart" in said else ["-"]
        for shown, meant in ((watchdog, times[0]), (pause, pauses[0])):
            assert shown == meant == "-" or float(shown) == seconds(meant), name


def test_the_target_starts_everything_that_is_there_at_power_on() -> None:
    wanted = re.findall(r"^Wants=(.*)$", (UNITS / "bunraku.target").read_text(), re.MULTILINE)
    by_paths = {f"bunraku-{name}" for name in ("anew", "learn", "prove", "update")}
    started_by_others = {f"{name}.service" for name in by_paths} | {"bunraku-stick.service"}
    assert set(wanted) == set(SERVICES) - started_by_others | {f"{name}.path" for name in by_paths}


@pytest.mark.parametrize("name", SERVICES)
def test_what_a_service_starts_is_a_command_with_these_options(name: str) -> None:
    """Of this release: a unit that names an option of another one would never start."""
    for command in settings(name)["ExecStart"]:
        words = shlex.split(command.split("| ")[0].replace("/bin/bash -o pipefail -c '", ""), posix=False)
        if words[0] == f"{BIN}/python":
            assert importlib.util.find_spec(words[2]) is not None
        if words[0] != f"{BIN}/bunraku":
            continue
        if words[1] == "preflight":
            assert parsed(words[2:])
            continue
        command = parser(words[1]).commands[words[1]]
        known = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= known


@pytest.mark.skipif(shutil.which("systemd-sysusers") is None, reason="systemd-sysusers is missing")
@pytest.mark.skipif(os.geteuid() != 0, reason="needs root: files of another user are made")
def test_the_user_and_its_folders(root: Path) -> None:
    (root / "etc").mkdir(exist_ok=True)
    subprocess.run(["systemd-sysusers", f"--root={root}", "bunraku.conf"], check=True)
    user = next(line for line in (root / "etc/passwd").read_text().splitlines() if line.startswith("bunraku"))
    assert user.split(":")[2:4] == ["990", "990"]
    groups = (root / "etc/group").read_text()
    for group in ("dialout", "plugdev", "video", "render", "input"):
        assert re.search(rf"^{group}:.*\bbunraku\b", groups, re.MULTILINE), group
    with (root / "etc/passwd").open("a") as passwd:
        passwd.write("root:x:0:0:root:/root:/bin/sh\n_chrony:x:991:991::/:/bin/false\n")
    with (root / "etc/group").open("a") as group_file:
        group_file.write("root:x:0:\n_chrony:x:991:\n")
    folders = str(SYSTEM / "usr/lib/bunraku/data-folders.conf")
    for file in ("bunraku.conf", folders):
        subprocess.run(["systemd-tmpfiles", "--create", f"--root={root}", file], check=True)
    for folder in ("run/bunraku", "data/bunraku", "data/bunraku/shows", "data/bunraku/keys"):
        found = (root / folder).stat()
        assert (found.st_mode & 0o777, found.st_uid) == (0o700, 990), folder
    assert ((root / "data/network").stat().st_mode & 0o777) == 0o700


def test_rules_for_devices_are_sound() -> None:
    udevadm = shutil.which("udevadm")
    if udevadm is None or subprocess.run([udevadm, "verify", "--help"], capture_output=True).returncode:
        pytest.skip("no udevadm here that can verify rules (systemd 254 or newer)")
    done = subprocess.run(
        [udevadm, "verify", "--no-style", str(SYSTEM / "usr/lib/udev/rules.d/60-bunraku.rules")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_file_says_what_it_is_for() -> None:
    for path in SYSTEM.rglob("*"):
        if path.is_file() and path.suffix != ".env":
            lines = path.read_text().splitlines()
            assert lines[0].startswith("#"), path
