"""Companions of `bunraku play` that hang: killed and started again, as systemd does it, and told."""

from __future__ import annotations

import math
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import pytest

from appliance.box.notify import WATCHDOG_S
from appliance.box.process_health import DIED, ProcessHealth
from appliance.cli import companions
from appliance.cli.companions import Companion, Companions
from tests.bundles import write_show
from tests.cli.test_companions import Diary
from tests.console.page import box_with_page
from tests.show_control.doubles import until
from tests.system.processes import children_running, wait_until

PERIOD_S = 0.8
PINGS = "from appliance.box.notify import Notifier; notifier = Notifier(); "
LOOP = "[(notifier.ping(time.monotonic()), time.sleep(0.05)) for _ in range(2000)]"


def pinging(diary: Diary, script: str, watchdog_s: float = PERIOD_S) -> Companion:
    return replace(diary.child(PINGS + script), watchdog_s=watchdog_s)


@pytest.fixture
def diary(tmp_path: Path) -> Diary:
    return Diary(tmp_path)


def test_one_that_stands_still_is_killed_said_and_started_again(diary: Diary) -> None:
    said: list[str] = []
    with Companions([pinging(diary, f"notifier.ready(); {LOOP}")], said.append, lambda: True):
        until(lambda: len(diary.pids) == 1)
        time.sleep(3 * PERIOD_S)
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
    monkeypatch.setattr(companions, "READY_S", 1.0)
    said: list[str] = []
    with Companions([pinging(diary, script)], said.append, lambda: True):
        until(lambda: len(diary.pids) >= 2)
    assert said[0].startswith("The child hung")


def test_one_without_a_watchdog_is_told_nothing_of_one(diary: Diary, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor of the watchdog of the process that starts it."""
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/systemd/notify")
    monkeypatch.setenv("WATCHDOG_USEC", "1000000")
    noted = diary.path.with_name("environ.txt")
    script = f"open({str(noted)!r}, 'w').write(repr(os.environ.get('NOTIFY_SOCKET'))); time.sleep(60)"
    with Companions([pinging(diary, script, math.inf)], print, lambda: True):
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
        stopped = {name: children_running(box.process.pid, kind)[0] for name, kind in kinds.items()}
        for process in stopped.values():
            os.kill(process, signal.SIGSTOP)
        began = time.monotonic()
        for name, kind in kinds.items():
            wait_until(lambda: set(children_running(box.process.pid, kind)) - set(stopped.values()))  # noqa: B023
            assert f"hung: it gave no sign for {WATCHDOG_S[name]:g} s" in box.output
        print(f"All started again {time.monotonic() - began:.1f} s after they stood still.")
        wait_until(page.is_open)
        health = ProcessHealth(box.runtime)
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
