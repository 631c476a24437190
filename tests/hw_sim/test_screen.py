"""From the hand to the light: the stamp in a picture, read back from a real screen."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing

import numpy as np
import pytest

from hw_sim.latency import Response, light_ms
from hw_sim.peers import ProbeError
from hw_sim.screen import Picture, Screen, Watcher, left_stage
from tests.virtual_display import virtual_display

PROJECTOR = """
import sys, time
from appliance.projector.context import GlContext
from appliance.projector.stamp import stamp
from appliance.projector.window import Window
from appliance.show.projector import ProjectorConfig

window = Window(ProjectorConfig(size=(640, 480)), "window")
context = GlContext(window)
for line in sys.stdin:
    context.gl.screen.clear(0.3, 0.3, 0.3)
    stamp(context.gl.screen, float(line) if line.strip() else None)
    context.finish()
    window.show()
    print(flush=True)
"""


def wait_for(holds: Callable[[], bool]) -> None:
    until = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.005)


def test_what_the_projector_stamps_is_read_from_the_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    with virtual_display() as display:
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)
        command = [sys.executable, "-c", PROJECTOR]
        drawer = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert drawer.stdin is not None and drawer.stdout is not None
        with drawer, closing(Screen()) as screen:
            watcher = Watcher(screen)
            watcher.start()
            now = time.monotonic()
            for count, stamped in enumerate((now - 2.0, now - 1.0, now - 0.5), 1):
                for drawn in (stamped, ""):  # then a picture that shows no dance
                    drawer.stdin.write(f"{drawn}\n")
                    drawer.stdin.flush()
                    drawer.stdout.readline()
                    wait_for(lambda wanted=count: len(watcher.pictures) == wanted)
            drawer.stdin.close()
            pictures = watcher.stop()
    np.testing.assert_allclose(
        [one.left_stage for one in pictures], [now - 2.0, now - 1.0, now - 0.5], atol=2e-4
    )
    assert all(one.seen_at > now for one in pictures)


@pytest.mark.parametrize("damage", [1 << 35, 1 << 34, 1 << 20, 1 << 2])
def test_a_stamp_that_is_half_drawn_is_no_stamp(damage: int) -> None:
    whole = 0b1010 << 32 | 0x1234567 << 4 | sum(range(1, 8)) % 16
    assert left_stage(whole, 3000.0) == pytest.approx(0x1234567 * 1e-4, abs=2e-4)
    assert left_stage(whole ^ damage, 3000.0) is None


def test_a_stamp_is_the_newest_time_before_now_with_these_digits() -> None:
    whole = 0b1010 << 32 | 7 << 4 | 7
    assert left_stage(whole, 3 * (1 << 28) * 1e-4 + 1.0) == pytest.approx(
        3 * (1 << 28) * 1e-4 + 7e-4, abs=2e-4
    )


def test_without_a_screen_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ProbeError, match=r"No X11 screen .* xvfb-run"):
        Screen()


def test_the_light_of_a_step_is_the_first_picture_that_shows_half_of_it() -> None:
    pictures = [Picture(10.0 + 0.02 * n + 0.03, 10.0 + 0.02 * n) for n in range(50)]
    found = light_ms([Response(10.1, 10.13), Response(10.5, 10.53), Response(12.0, 12.03)], pictures)
    np.testing.assert_allclose(found, [1000 * (10.17 - 10.1), 1000 * (10.57 - 10.5)])
