"""Lights and projector report their fallbacks to the box when a wire or the stage is away."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from appliance.box.fallback import Fallen
from appliance.box.process_health import ProcessHealth
from appliance.lights.fallback import DMX_AWAY
from appliance.lights.fallback import STAGE_UNSEEN as LIGHTS_SAFE
from appliance.projector.fallback import STAGE_UNSEEN as PICTURE_BLACK
from hw_sim.dmx.usb_pro import UsbProWidget
from tests.bundles import with_surface, write_show
from tests.system.box import Box, playing
from tests.system.lit import RIG, LightsProcess
from tests.system.processes import wait_until
from tests.system.test_projector import Projection


@pytest.fixture
def show(tmp_path: Path) -> Path:
    return write_show(tmp_path / "show", hands=[], lights=RIG)


@contextmanager
def lit(show: Path, folder: Path, device: Path) -> Iterator[Box]:
    """A stage alone, whose box file has one wire: a USB adapter."""
    wire = {"universe": 1, "wire": "usb-pro", "device": str(device)}
    with playing(show, folder, "--alone", settings={"outputs": {"dmx": [wire]}}) as box:
        yield box


def await_fallback(runtime: Path, name: str, is_wanted: Callable[[Fallen], bool]) -> Fallen:
    with closing(ProcessHealth(runtime)) as processes:

        def find() -> Fallen | None:
            reported = (one for _, one in processes.fallbacks(time.monotonic()))
            return next((one for one in reported if one.name == name and is_wanted(one)), None)

        fallen = wait_until(find, f"{name} was not reported")
        assert fallen is not None
        return fallen


def test_a_wire_that_is_away_and_back(show: Path, tmp_path: Path) -> None:
    widget = UsbProWidget(tmp_path / "ttyUSB7")
    with lit(show, tmp_path, widget.path) as box, LightsProcess(tmp_path) as lights:
        away = await_fallback(box.runtime, DMX_AWAY.name, lambda one: one.active)
        assert away.times == 1
        assert "it is not plugged in" in away.message
        with widget:
            await_fallback(box.runtime, DMX_AWAY.name, lambda one: not one.active)
            assert lights.end() == 0
        box.frames(5)


def test_a_stage_that_is_lost_and_back(show: Path, tmp_path: Path) -> None:
    with lit(show, tmp_path, tmp_path / "none") as box, LightsProcess(tmp_path) as lights:
        lights.await_output("The stage dances, and the lights with it.")
        box.kill_and_restart()
        box.end(signal.SIGKILL)
        lost = await_fallback(box.runtime, LIGHTS_SAFE.name, lambda one: one.active)
        assert "fade to their safe look" in lost.message
        box.kill_and_restart()
        await_fallback(box.runtime, LIGHTS_SAFE.name, lambda one: not one.active)


def test_a_picture_without_a_stage_and_with_one(tmp_path: Path) -> None:
    show = with_surface(write_show(tmp_path / "show", hands=[]))
    with playing(show, tmp_path, "--alone") as box, Projection(box.box_file, tmp_path) as projection:
        projection.await_dance()
        box.end(signal.SIGKILL)
        await_fallback(box.runtime, PICTURE_BLACK.name, lambda one: one.active)
        box.kill_and_restart()
        await_fallback(box.runtime, PICTURE_BLACK.name, lambda one: not one.active)
        assert projection.end(signal.SIGKILL) == -signal.SIGKILL
        await_fallback(box.runtime, "projector-died", lambda one: one.active)
