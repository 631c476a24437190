"""Hours of dance on a clock that does not wait: here their first seconds."""

from __future__ import annotations

import subprocess
import sys


def test_a_third_of_a_minute_is_danced_without_waiting_for_it() -> None:
    command = (sys.executable, "-m", "tests.stage.long_evening", "--hours", "0.006", "--seed", "2")
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 1080 <= int(done.stdout.partition(" ticks. ")[0]) <= 1083
