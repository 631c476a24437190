"""The real box and its lights: they move with the dance, obey show control, and are safe whatever dies."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pythonosc.udp_client import SimpleUDPClient

from hw_sim.dmx.usb_pro import UsbProWidget
from hw_sim.peers import HOST
from tests.bundles import write_show
from tests.system.box import PLAY, playing
from tests.system.lit import DIMMER, PAN, PAR, RIG, SAFE, LightsProcess, artnet, lit_box, node
from tests.system.processes import children_running, wait_until

pytestmark = pytest.mark.realtime

ALONE = (*PLAY, "--alone")
DARK = {**RIG, "safe": {}}


def is_dark(levels: bytes) -> bool:
    """Zeros everywhere, except for pan and tilt: the head stays where it points."""
    return not any(levels[:PAN]) and not any(levels[DIMMER:])


def test_lights_move_with_the_dance_obey_show_control_and_end_dark(tmp_path: Path) -> None:
    with lit_box(tmp_path, DARK) as (lamp, box):
        lamp.await_dance()
        lamp.await_levels(lambda levels: levels[0] == 255, universe=2)
        pans: set[bytes] = set()

        def moves() -> bool:
            lamp.receive()
            pans.add(lamp.levels[1][PAN : PAN + 2])
            return len(pans) >= 8

        wait_until(moves, "the head does not follow the joint, which sways once a second", lambda: None)
        client = SimpleUDPClient(HOST, box.control)
        client.send_message("/panic", [])
        lamp.await_levels(lambda levels: levels[DIMMER] == 0 and levels[PAR] == 0)
        lamp.await_levels(lambda levels: levels[0] == 0, universe=2)
        client.send_message("/go", [])
        lamp.await_dance()
        client.send_message("/master", [0.5])
        lamp.await_levels(lambda levels: levels[PAR] == 128)
        client.send_message("/blackout", [1])
        lamp.await_levels(lambda levels: levels[PAR] == 0)
        client.send_message("/blackout", [0])
        client.send_message("/master", [1.0])
        client.send_message("/lights", ["dim", 0.2])
        lamp.await_levels(lambda levels: levels[PAR] == 64)

        assert box.end() == 0
        lamp.receive()
        assert is_dark(lamp.levels[1])
        assert any(lamp.levels[1][PAN:DIMMER])
        assert lamp.levels[2] == bytes(512)
        assert "Lights: 3 fixtures by Art-Net" in box.output
        assert "Traceback" not in box.output


def test_a_killed_stage_leaves_the_safe_look_and_the_dance_returns_with_the_next(tmp_path: Path) -> None:
    with lit_box(tmp_path, RIG, command=ALONE) as (lamp, box), LightsProcess(tmp_path) as lights:
        lamp.await_dance()
        killed = time.monotonic()
        box.end(signal.SIGKILL)
        lamp.await_safe()
        assert time.monotonic() - killed > 1.0  # it waits for a second and fades for another
        lights.await_output("No frame from the stage")
        box.kill_and_restart()
        lamp.await_dance()
        lights.await_output("The stage dances, and the lights with it.")
        assert lights.end() == 0
        lamp.receive()
        assert lamp.levels[1][PAR] == round(255 * SAFE)  # the safe look leaves this one on
        assert lamp.levels[2][0] == 0


def test_a_stage_that_hangs_brings_the_safe_look_too(tmp_path: Path) -> None:
    with lit_box(tmp_path, RIG, command=ALONE) as (lamp, box), LightsProcess(tmp_path):
        lamp.await_dance()
        box.process.send_signal(signal.SIGSTOP)
        lamp.await_safe()
        box.process.send_signal(signal.SIGCONT)
        lamp.await_dance()


@contextlib.contextmanager
def stopped_terminal() -> Iterator[int]:
    """A terminal that takes no byte, as after Ctrl-S or on a lost connection: the writer blocks."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, bytes(1 << 16))
    os.set_blocking(writing, True)
    try:
        yield writing
    finally:
        os.close(reading)
        os.close(writing)


def test_a_stopped_terminal_blocks_neither_dance_nor_safe_look(tmp_path: Path) -> None:
    with (
        lit_box(tmp_path, RIG, command=ALONE) as (lamp, box),
        stopped_terminal() as terminal,
        LightsProcess(tmp_path, terminal) as lights,
    ):
        lamp.await_dance()
        box.end(signal.SIGKILL)
        lamp.await_safe()
        assert lights.end() == 0


def test_lights_that_start_first_wait_for_the_stage(tmp_path: Path) -> None:
    with lit_box(tmp_path, RIG, command=ALONE) as (lamp, box):
        box.frames(1)
        box.end()
        with LightsProcess(tmp_path) as lights:
            box.kill_and_restart()
            lamp.await_dance()
            assert lights.end(signal.SIGINT) == 0


def test_killed_lights_are_started_again_by_the_box(tmp_path: Path) -> None:
    with lit_box(tmp_path, DARK) as (lamp, box):
        lamp.await_dance()
        running = children_running(box.process.pid, "lights")
        assert len(running) == 1
        os.kill(running[0], signal.SIGKILL)
        box.await_output("Lights: 3 fixtures", count=2)
        lamp.receive()
        lamp.levels.clear()
        lamp.await_dance()


def test_a_killed_box_takes_its_lights_with_it_and_they_end_dark(tmp_path: Path) -> None:
    with lit_box(tmp_path, DARK) as (lamp, box):
        lamp.await_dance()
        box.end(signal.SIGKILL)
        lamp.await_levels(is_dark)
        lamp.await_levels(is_dark, universe=2)


def test_a_missing_widget_does_not_affect_other_wires(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show", lights=DARK)
    with node() as (lamp, port):
        settings = artnet(port, 1)
        missing = {"universe": 2, "wire": "usb-pro", "device": str(tmp_path / "ttyUSB9")}
        settings["outputs"]["dmx"].append(missing)
        with playing(show, tmp_path, settings=settings) as box:
            lamp.await_dance()
            box.await_output("ttyUSB9")
            assert box.end() == 0
            assert "Traceback" not in box.output


def await_widget(widget: UsbProWidget, is_wanted: Callable[[bytes], bool]) -> None:
    wait_until(lambda: widget.levels is not None and is_wanted(widget.levels), lambda: f"{widget.levels}")


def test_by_usb_the_same_levels_arrive(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show", lights=DARK)
    with UsbProWidget(tmp_path / "ttyUSB0") as widget:
        wires = [{"universe": 1, "wire": "usb-pro", "device": str(widget.path)}]
        with playing(show, tmp_path, settings={"outputs": {"dmx": wires}}) as box:
            await_widget(widget, lambda levels: levels[DIMMER] == 255 and levels[PAR] == 255)
            box.await_output("Universe 2 has no wire, so these stay dark: second.")
            assert box.end() == 0
            await_widget(widget, is_dark)


def test_another_show_in_the_same_box_lights_its_own_rig(tmp_path: Path) -> None:
    other = {
        "fixtures": [{"name": "lamp", "profile": "dimmer", "address": 512}],
        "mappings": [{"name": "on", "rules": [{"reads": "steady", "drives": "dimmer"}]}],
    }
    second = write_show(tmp_path / "second", lights=other)
    with lit_box(tmp_path, DARK, 1, command=ALONE) as (lamp, box), LightsProcess(tmp_path) as lights:
        lamp.await_dance()
        box.command[box.command.index(str(tmp_path / "show"))] = str(second)
        box.kill_and_restart()
        lamp.await_levels(lambda levels: levels[511] == 255 and not any(levels[:511]))
        assert lights.end() == 0


def test_blackout_outlasts_the_lights_and_the_box(tmp_path: Path) -> None:
    with lit_box(tmp_path, RIG) as (lamp, box):
        lamp.await_dance()
        SimpleUDPClient(HOST, box.control).send_message("/blackout", [1])
        lamp.await_levels(lambda levels: levels[PAR] == 0)
        lamp.arrivals.clear()
        [lights] = children_running(box.process.pid, "lights")
        os.kill(lights, signal.SIGTERM)
        box.await_output("Lights: 3 fixtures", count=2)
        box.frames(50)
        assert box.end() == 0
        lamp.receive()
        assert all(levels[DIMMER] == levels[PAR] == 0 for _, one, levels in lamp.arrivals if one == 1)
        assert is_dark(lamp.levels[1])
        assert lamp.levels[2] == bytes(512)
