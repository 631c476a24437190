"""Companions of the stage: started after its first tick, started again when they die, ended with it."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from appliance.box.notify import WATCHDOG_S
from appliance.box.process_health import DIED, ProcessHealth
from appliance.cli import companions
from appliance.cli.companions import UNAVAILABLE, Companion, Companions
from tests.box import disks
from tests.bundles import write_show
from tests.console.page import box_with_page
from tests.logged import said
from tests.show_control.doubles import until
from tests.system.processes import children_running, wait_until

NOTE = "import os, sys, time; open(sys.argv[1], 'a').write(f'{os.getpid()}\\n'); "


class Diary:
    """A file in which each start of a child leaves its process id."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "diary.txt"
        self.path.touch()

    @property
    def pids(self) -> list[int]:
        return [int(line) for line in self.path.read_text().splitlines()]

    def child(self, script: str, may_close: bool = False) -> Companion:
        command = (sys.executable, "-c", NOTE + script, str(self.path))
        return Companion("The child", command, "Something is missing for a moment.", may_close)


@pytest.fixture
def diary(tmp_path: Path) -> Diary:
    return Diary(tmp_path)


def is_gone(pid: int) -> bool:
    """Whether a process has ended; one that is waited for no longer has ended, too."""
    try:
        return "State:\tZ" in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return True


def test_a_companion_starts_when_it_may_and_ends_with_the_context(diary: Diary) -> None:
    dances: list[bool] = []
    with Companions([diary.child("time.sleep(60)")], lambda: bool(dances)):
        time.sleep(0.2)
        assert diary.pids == []
        dances.append(True)
        until(lambda: len(diary.pids) == 1)
    assert is_gone(diary.pids[0])
    assert said == []


def test_without_a_first_tick_nothing_is_started(diary: Diary) -> None:
    with Companions([diary.child("time.sleep(60)")], lambda: False):
        pass
    assert diary.pids == []


def test_a_killed_companion_is_restarted_and_reported(diary: Diary) -> None:
    with Companions([diary.child("time.sleep(60)")], lambda: True):
        until(lambda: len(diary.pids) == 1)
        os.kill(diary.pids[0], signal.SIGKILL)
        until(lambda: len(diary.pids) == 2)
    assert said == ["The child was killed (signal 9). Something is missing for a moment. It is restarted."]


def test_a_companion_that_dies_at_once_is_retried_ever_more_slowly_and_reported_four_times(
    diary: Diary, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(companions, "SHORTEST_PAUSE_S", 0.01)
    monkeypatch.setattr(companions, "LONGEST_PAUSE_S", 0.02)
    with Companions([diary.child("sys.exit(3)")], lambda: True):
        until(lambda: len(diary.pids) >= 6)
    assert len(said) == 4
    assert said[0].startswith("The child ended by itself (status 3).")
    assert "4 times in a row" in said[3]


def test_pauses_grow_and_start_over_after_a_long_life() -> None:
    backoff = companions.Backoff()
    lives_s = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 11.0, 0.1)
    assert [backoff.pause_s(lived_s) for lived_s in lives_s] == [0.2, 0.4, 0.8, 1.6, 2.0, 2.0, 0.2, 0.4]


def test_a_companion_that_dies_all_evening_overflows_nothing() -> None:
    backoff = companions.Backoff()
    assert [backoff.pause_s(0.0) for _ in range(1100)][-1] == companions.LONGEST_PAUSE_S


def test_a_companion_that_the_user_closed_stays_closed(diary: Diary) -> None:
    with Companions([diary.child("sys.exit(0)", may_close=True)], lambda: True):
        until(lambda: bool(said))
        time.sleep(0.5)
    assert len(diary.pids) == 1
    assert said == ["The child was closed. The dance goes on."]


def test_a_companion_waits_for_its_needs(
    diary: Diary, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(companions, "RETRY_S", 0.1)
    display, reported, shows = tmp_path / "display", tmp_path / "told", tmp_path / "shows"
    waits = "from appliance.box.parent_death import was_reported; "
    waits += f"open({str(reported)!r}, 'a').write(f'{{was_reported({UNAVAILABLE}):d}}'); "
    waits += f"os.path.exists({str(display)!r}) or sys.exit({UNAVAILABLE}); "
    waits += f"open({str(shows)!r}, 'w').close(); time.sleep(60)"
    with Companions([diary.child(waits)], lambda: True):
        until(lambda: len(diary.pids) >= 3)
        display.touch()
        until(lambda: shows.exists())
    assert said == ["The child cannot run now. The dance goes on without it; it is retried every 0.1 s."]
    assert reported.read_text() == "0" + "1" * (len(diary.pids) - 1)  # it gives its reasons once
    assert is_gone(diary.pids[-1])


def test_a_companion_that_cannot_start_is_reported_and_retried() -> None:
    missing = Companion("The child", ("/nowhere/at/all",), "Something is missing.")
    with Companions([missing], lambda: True):
        until(lambda: len(said) >= 2)
    assert said[0].startswith("The child cannot be started (No such file or directory).")


def test_a_companion_that_does_not_end_is_killed(diary: Diary, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(companions, "LAST_OUTPUT_S", 0.2)
    stubborn = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); "
    stubborn += "open(sys.argv[1], 'a').write('0\\n'); time.sleep(60)"
    with Companions([diary.child(stubborn)], lambda: True):
        until(lambda: len(diary.pids) == 2)
    assert is_gone(diary.pids[0])


PLAYER = """
import sys, time
from appliance.cli.companions import Companion, Companions
child = "from appliance.box.parent_death import end_with_parent; end_with_parent(); "
child += "import os, sys, time; open(sys.argv[1], 'a').write(f'{os.getpid()}\\\\n'); time.sleep(60)"
command = (sys.executable, "-c", child, sys.argv[1])
with Companions([Companion("The child", command, "")], lambda: True):
    time.sleep(60)
"""


def test_a_killed_player_leaves_no_orphan(diary: Diary) -> None:
    player = subprocess.Popen([sys.executable, "-c", PLAYER, str(diary.path)])
    until(lambda: len(diary.pids) == 1)
    player.send_signal(signal.SIGKILL)
    player.wait()
    until(lambda: is_gone(diary.pids[0]))


def test_a_companion_does_not_start_without_its_parent(diary: Diary) -> None:
    script = "from appliance.box.parent_death import end_with_parent; end_with_parent(); " + NOTE
    done = subprocess.run(
        [sys.executable, "-c", script, str(diary.path)],
        env={**os.environ, "BUNRAKU_PARENT": "0"},
        check=False,
    )
    assert done.returncode == 0
    assert diary.pids == []


def test_one_that_hangs_on_a_dead_disk_is_left_behind(diary: Diary, tmp_path: Path) -> None:
    """No signal ends what waits in the kernel: the box ends without it."""
    if reason := disks.why_not():
        pytest.skip(reason)
    (tmp_path / "disk").mkdir()
    with disks.disk(disks.made_image(tmp_path / "image"), tmp_path / "disk") as disk, disks.frozen(disk):
        with Companions([diary.child(f"open({str(disk / 'file')!r}, 'w')")], lambda: True):
            until(lambda: len(diary.pids) == 1)
            until(lambda: "State:\tD" in Path(f"/proc/{diary.pids[0]}/status").read_text())
        assert not is_gone(diary.pids[0])
    until(lambda: is_gone(diary.pids[0]))


PERIOD_S = 3.0  # longer than a busy machine holds a process up
PINGS = "from appliance.box.notify import Notifier; notifier = Notifier(); "
LOOP = "[(notifier.ping(time.monotonic()), time.sleep(0.05)) for _ in range(2000)]"


def pinging(diary: Diary, script: str, watchdog_s: float = PERIOD_S) -> Companion:
    return replace(diary.child(PINGS + script), watchdog_s=watchdog_s)


def test_one_that_stands_still_is_killed_said_and_started_again(diary: Diary) -> None:
    with Companions([pinging(diary, f"notifier.ready(); {LOOP}")], lambda: True):
        until(lambda: len(diary.pids) == 1)
        time.sleep(2 * PERIOD_S)
        assert len(diary.pids) == 1 and said == [], "one that pings is left in peace"
        os.kill(diary.pids[0], signal.SIGSTOP)
        until(lambda: len(diary.pids) == 2)
    assert said == [
        f"The child hung: it gave no sign for {PERIOD_S:g} s. Something is missing for a moment. "
        "It is restarted."
    ]


@pytest.mark.parametrize(
    "script",
    ["time.sleep(60)", f"notifier.ready(); os.fork() and time.sleep(60); {LOOP}"],
    ids=["never ready", "only its child gives signs"],
)
def test_signs_count_from_the_process_itself_alone(
    diary: Diary, monkeypatch: pytest.MonkeyPatch, script: str
) -> None:
    monkeypatch.setattr(companions, "READY_S", PERIOD_S)
    with Companions([pinging(diary, script)], lambda: True):
        until(lambda: len(diary.pids) >= 2)
    assert said[0].startswith("The child hung")


def test_one_without_a_watchdog_is_told_nothing_of_one(diary: Diary, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor of the watchdog of the process that starts it."""
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/systemd/notify")
    monkeypatch.setenv("WATCHDOG_USEC", "1000000")
    noted = diary.path.with_name("environ.txt")
    script = f"open({str(noted)!r}, 'w').write(repr(os.environ.get('NOTIFY_SOCKET'))); time.sleep(60)"
    with Companions([pinging(diary, script, math.inf)], lambda: True):
        until(lambda: noted.exists() and noted.read_text() != "")
    assert noted.read_text() == "None"


def test_a_show_control_that_hangs_is_started_again_and_told(tmp_path: Path) -> None:
    """So are the page and the keeper; commands come through again."""
    show = write_show(tmp_path / "show", hands=[])
    with box_with_page(show, tmp_path, "--journal", str(tmp_path / "night"), has_sensors=False) as (
        box,
        page,
    ):
        page.unlock()
        wait_until(lambda: page.does("/panic"))
        kinds = {
            "control": "appliance.show_control",
            "console": "appliance.console",
            "keeper": "keep",
        }
        health = ProcessHealth(box.runtime)  # one that has not reported yet is not known to have been there
        wait_until(lambda: kinds.keys() <= {one.process for one in health.members(time.monotonic())})
        stopped = {name: children_running(box.process.pid, kind)[0] for name, kind in kinds.items()}
        for process in stopped.values():
            os.kill(process, signal.SIGSTOP)
        began = time.monotonic()
        for name, kind in kinds.items():
            wait_until(lambda: set(children_running(box.process.pid, kind)) - set(stopped.values()))  # noqa: B023
            assert f"hung: it gave no sign for {WATCHDOG_S[name]:g} s" in box.output
        print(f"All started again {time.monotonic() - began:.1f} s after they stood still.")
        wait_until(page.is_open)
        wait_until(
            lambda: (
                {DIED[name].name for name in kinds}
                <= {one.name for _, one in health.fallbacks(time.monotonic())}
            )
        )
        health.close()
        wait_until(lambda: page.status().get("status"))
        assert page.status()["status"]["panic"] == 1, "what was in force stays in force"
        wait_until(lambda: page.does("/go"))
