"""From the hand to the light: the stamp in a picture, read back from a real screen."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing

import numpy as np
import pytest

from hw_sim.latency import response_ms
from hw_sim.peers import ProbeError
from hw_sim.screen import Picture, Screen, Watcher, held_joint
from tests.virtual_display import virtual_display

PROJECTOR = """
import sys, time
from appliance.projector.context import GlContext
from appliance.projector.stamp import stamp
from appliance.projector.window import Window
from appliance.show.projector import ProjectorConfig

window = Window(ProjectorConfig(size=(640, 480)), "window")
context = GlContext(window)
for number, line in enumerate(sys.stdin):
    context.gl.screen.clear(0.3, 0.3, 0.3)
    stamp(context.gl.screen, number, [float(part) for part in line.split()] or None)
    context.finish()
    window.show()
    print(flush=True)
"""


ORIENTATIONS = [(1.0, 0.0, 0.0, 0.0), (0.5, -0.5, 0.5, -0.5), (0.6, 0.0, -0.8, 0.0)]


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
            began = time.monotonic()
            for count, stamped in enumerate(ORIENTATIONS, 1):
                for drawn in (stamped, ()):  # then a picture that shows no dance
                    drawer.stdin.write(" ".join(map(str, drawn)) + "\n")
                    drawer.stdin.flush()
                    drawer.stdout.readline()
                    wait_for(lambda wanted=count: len(watcher.pictures) == wanted)
            drawer.stdin.close()
            pictures = watcher.stop()
    np.testing.assert_allclose([one.joint for one in pictures], ORIENTATIONS, atol=1.1e-3)
    assert all(one.arrived_at > began for one in pictures)


@pytest.mark.parametrize("damage", [1 << 51, 1 << 50, 1 << 45, 1 << 20, 1 << 2])
def test_a_stamp_that_is_half_drawn_is_no_stamp(damage: int) -> None:
    whole = 0b1010 << 48 | 0x12345678901 << 4 | sum(range(10)) + 1 & 15
    found = held_joint(whole)
    assert found is not None
    assert found[3] == pytest.approx(2 * (0x101) / 1023 - 1)
    assert held_joint(whole ^ damage) is None


def test_without_a_screen_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ProbeError, match=r"No X11 screen .* xvfb-run"):
        Screen()


def test_the_light_of_a_step_is_the_first_picture_that_shows_half_of_it() -> None:
    """Pictures at 50 Hz; a joint that turns by 0.4 radians within four of them, 50 ms after the step."""
    at_s = 10.0 + 0.02 * np.arange(100)
    half = 0.2 * np.clip((at_s - 10.55) / 0.08, 0.0, 1.0)
    pictures = [
        Picture(float(now), np.array([np.cos(turn), 0.0, np.sin(turn), 0.0]))
        for now, turn in zip(at_s, half, strict=True)
    ]
    assert response_ms([10.5], pictures) == pytest.approx([100.0])
    assert len(response_ms([11.4], pictures)) == 0  # nothing moves any more
