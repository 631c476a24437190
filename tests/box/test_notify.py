"""What the box tells systemd: a real socket hears it; without one, or with a deaf one, nothing happens."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from appliance.box.notify import ALIVE, ENDING, READY, Notifier, NotifyListener
from tests.box.supervisor import Supervisor


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.fixture(params=["path", "abstract"])
def supervisor(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Supervisor]:
    address = str(tmp_path / "notify") if request.param == "path" else f"@bunraku-test-{os.getpid()}"
    made = Supervisor(address)
    made.environ["WATCHDOG_PID"] = str(os.getpid())
    yield made
    made.close()


def test_it_says_that_it_works_how_it_is_and_that_it_ends(supervisor: Supervisor) -> None:
    notifier = Notifier(supervisor.environ)
    notifier.ready("50.0 Hz\nlate 0")
    notifier.status("49.9 Hz")
    notifier.stopping()
    notifier.close()
    assert supervisor.heard() == ["READY=1\nSTATUS=50.0 Hz late 0", "STATUS=49.9 Hz", "STOPPING=1"]


def test_four_pings_a_period_however_often_it_is_called(supervisor: Supervisor) -> None:
    notifier = Notifier(supervisor.environ)
    for tick in range(100):
        notifier.ping(1000.0 + 0.02 * tick)
    notifier.close()
    assert supervisor.heard() == ["WATCHDOG=1"] * 8


@pytest.mark.parametrize(
    "changed",
    [
        {"WATCHDOG_USEC": ""},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_PID": "1"},
    ],
)
def test_without_a_watchdog_of_its_own_it_does_not_ping(
    supervisor: Supervisor, changed: dict[str, str]
) -> None:
    notifier = Notifier({**supervisor.environ, **changed})
    notifier.ping(1000.0)
    notifier.close()
    assert supervisor.heard() == []


def test_a_supervisor_that_takes_nothing_holds_up_nobody(supervisor: Supervisor) -> None:
    notifier = Notifier(supervisor.environ)
    for tick in range(5000):  # far more than its socket holds; nobody reads
        notifier.ping(1000.0 + tick)
    assert 0 < len(supervisor.heard()) < 5000
    notifier.ping(9000.0)
    notifier.close()
    assert supervisor.heard() == ["WATCHDOG=1"], "and it is heard again when there is room"


@pytest.mark.parametrize("place", ["", "notify", "no/such/folder/notify", "x" * 200])
def test_where_nobody_listens_it_is_silent_and_goes_on_trying(
    place: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = open_files()
    notifier = Notifier({"NOTIFY_SOCKET": str(tmp_path / place) if place else "", "WATCHDOG_USEC": "1000000"})
    assert open_files() - before == bool(place), "without an address no socket is made"
    notifier.ready()
    notifier.ping(1.0)
    if place == "notify":
        supervisor = Supervisor(str(tmp_path / place))
        notifier.ping(1.3)
        assert supervisor.heard() == ["READY=1\nWATCHDOG=1"], "one that comes late hears all that counts"
        supervisor.close()
    notifier.stopping()
    notifier.close()
    notifier.ping(100.0)
    assert open_files() == before
    assert capfd.readouterr() == ("", "")


def test_a_ready_for_which_there_was_no_room_is_said_again(tmp_path: Path) -> None:
    """Else it would be ended for never having been ready: PID 1 was busy for a moment."""
    environ = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"}
    notifier = Notifier(environ)
    notifier.ready("50.0 Hz")
    supervisor = Supervisor(environ["NOTIFY_SOCKET"])
    for now in (1000.0, 1000.3):
        notifier.ping(now)
    assert supervisor.heard() == ["READY=1\nWATCHDOG=1", "WATCHDOG=1"]
    notifier.close()
    supervisor.close()


def test_a_parent_hears_its_children_by_the_same_words_and_the_kernel_says_which_one() -> None:
    listener = NotifyListener()
    environ = listener.environ(0.8)
    notifier = Notifier(environ)
    assert notifier.every_s == pytest.approx(0.2)
    notifier.ready("50.0 Hz")
    notifier.ping(1000.0)
    notifier.ping(1000.1)
    child = (
        "import os, sys; from appliance.box.notify import Notifier; Notifier().stopping(); print(os.getpid())"
    )
    ran = subprocess.run(
        [sys.executable, "-c", child],
        env={**os.environ, **environ},
        capture_output=True,
        text=True,
        check=True,
    )
    assert list(listener.heard()) == [
        (os.getpid(), f"{READY}\nSTATUS=50.0 Hz"),
        (os.getpid(), ALIVE),
        (int(ran.stdout), ENDING),
    ]
    assert list(listener.heard()) == []
    notifier.close()
    listener.close()
