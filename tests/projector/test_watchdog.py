"""A display that hangs: noticed in time, never by another's fault, and the process ends with a message."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from appliance.box import watchdog
from appliance.box.watchdog import Patience, guarded
from appliance.projector.projector_error import GPU_LOST
from appliance.projector.run import PATIENCE_S

HANGS = """
import ctypes, sys, time
from pathlib import Path
from appliance.box import watchdog
from appliance.projector.run import Options, Run
from appliance.projector.window import Window
from appliance.show.box import BoxConfig

watchdog.LOOK_S = 0.1
shown, show = [], Window.show

def hang(window):
    shown.append(show(window))
    if len(shown) > 3:
        print("hangs", flush=True)
        run._patience.patience_s = 0.6
        while True:
            ctypes.CDLL(None).pause()

Window.show = hang
place = Path(sys.argv[1])
run = Run(BoxConfig(runtime=place / "run", state=place / "state"), Options("offscreen", (64, 36)))
run.project(lambda: False)
"""


def over_at(patience: Patience, begin: float, end: float, is_preparing: bool = False) -> float | None:
    """Look each half second; when patience is over."""
    for now in np.arange(begin, end, 0.5):
        if patience.is_over(float(now), is_preparing):
            return float(now)
    return None


def test_patience_is_over_after_five_seconds_without_a_picture() -> None:
    patience = Patience(PATIENCE_S)
    assert over_at(patience, 100.0, 160.0) is None  # before the first picture nothing is expected
    patience.note_sign(160.0)
    assert over_at(patience, 160.0, 164.6) is None
    patience.note_sign(164.0)
    assert over_at(patience, 165.0, 190.0) == 164.0 + PATIENCE_S


def test_preparing_a_show_may_take_long() -> None:
    patience = Patience(PATIENCE_S)
    patience.is_over(99.5, False)
    patience.note_sign(100.0)
    assert over_at(patience, 100.0, 130.0, is_preparing=True) is None
    assert over_at(patience, 130.0, 150.0) == 129.5 + PATIENCE_S


def test_a_process_that_was_stopped_blames_no_display() -> None:
    patience = Patience(PATIENCE_S)
    patience.is_over(99.5, False)
    patience.note_sign(100.0)
    assert over_at(patience, 100.0, 102.0) is None
    assert over_at(patience, 160.0, 180.0) == 160.0 + PATIENCE_S


def test_the_guard_gives_up_once_and_ends_with_what_it_guards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watchdog, "LOOK_S", 0.01)
    seen, gave_up = [0.0], threading.Event()
    now, is_well = 100.0, []

    def clock() -> float:
        seen.append(now)
        return now

    def await_looks() -> None:
        """Until the guard has looked twice at this time: it takes a clock that leaps for a standstill."""
        until = time.monotonic() + 60.0
        while seen.count(now) < 2:
            assert time.monotonic() < until
            time.sleep(0.002)

    patience = Patience(PATIENCE_S)
    patience.note_sign(100.0)
    with guarded(patience, lambda: False, gave_up.set, clock, is_well.append):
        await_looks()
        for now in (101.5, 103.0, 104.5):  # noqa: B007
            await_looks()
        assert not gave_up.is_set()
        now = 106.0
        assert gave_up.wait(60.0)
    assert is_well[-1] == 104.5
    assert "watchdog" not in [thread.name for thread in threading.enumerate()]


def test_a_display_that_hangs_ends_the_projector_with_words_and_75(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", HANGS, str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None and "hangs" in process.stdout.readline()
        _, output = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert process.returncode == GPU_LOST
    assert "The display has taken no picture" in output and "The audience sees" in output
