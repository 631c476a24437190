"""Real-time settings are asked for in one place; what is refused is said, and the box runs on."""

from __future__ import annotations

import subprocess
import sys

SETTINGS = """
import gc, os, sys, threading
from appliance.stage.realtime import enter_realtime
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
    facts, words = run(WITHOUT_RIGHTS)
    assert facts.split()[0] == "2"
    assert "No real-time priority" in words
    assert "25 to 340 ms late" in words
    assert "Memory is not locked" in words
    assert "ulimit -r 70" in words
