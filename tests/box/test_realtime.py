"""Real-time settings are asked for in one place; what is refused is said, and the box runs on."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SETTINGS = """
import gc, os, sys, threading
from appliance.box.realtime import enter_realtime
{before}
missing = enter_realtime(10)
child = []
thread = threading.Thread(target=lambda: child.append(os.sched_getscheduler(0)))
thread.start(); thread.join()
print(len(missing), gc.isenabled(), gc.get_freeze_count() > 0, child[0] & 0xff)
print(" ".join(missing))
"""

WITHOUT_RIGHTS = """
import ctypes, resource
libc = ctypes.CDLL(None)
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (4096, 4096))
os.setgroups([]) if os.getuid() == 0 else None
if os.getuid() == 0:
    os.setuid(65534)
"""


def run(before: str) -> list[str]:
    code = SETTINGS.format(before=before)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def test_the_collector_rests_and_other_threads_stay_ordinary() -> None:
    facts = run("")[0].split()
    assert facts[1:] == ["False", "True", "0"]


def test_without_rights_it_runs_and_says_what_that_costs() -> None:
    facts, output = run(WITHOUT_RIGHTS)
    assert facts.split()[0] == "2"
    assert "No real-time priority" in output
    assert "25 to 340 ms late" in output
    assert "Memory is not locked" in output
    assert "ulimit -r 70" in output


def test_what_a_unit_has_given_is_used_where_nothing_more_may_be_asked_for() -> None:
    given = "os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(10))\n"
    if subprocess.run(
        [sys.executable, "-c", "import os\n" + given], capture_output=True, check=False
    ).returncode:
        pytest.skip(f"user {os.getuid()} may not have real-time priority here")
    measured = """
from appliance.box.realtime import borrowed_priority
with borrowed_priority(10):
    pass
"""
    facts, output = run(given + WITHOUT_RIGHTS + measured)
    assert facts.split()[-1] == "0", "another thread is ordinary"
    assert "No real-time priority" not in output
