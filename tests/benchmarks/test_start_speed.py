"""From the start of `bunraku play` to its first frame, and what it costs at each tick to make that quick."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import yaml

from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.bundle import default_show_path
from appliance.show.show import load_show
from appliance.stage.reconcile import Reconciler
from appliance.stage.resume import Resumption
from appliance.stage.stage_parts import assemble
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import HOST

GROUP = "bunraku play, the default show: start of the process -> first frame"
NOTE_GROUP = "the place of the dance, noted after each frame"
READ_GROUP = "the show state, read at each tick"
ROUNDS = 7
_PATIENCE_S = 60.0


class Starts:
    """Starts a box again and again; `kill`: as a crash ends it, so that the next start is a return."""

    def __init__(self, folder: Path, module: str, kill: bool) -> None:
        self._receiver = OscReceiver(HOST)
        settings = {
            "sensors": {"udp": None},
            "control": None,
            "runtime": "runtime",
            "outputs": {"osc": [{"host": HOST, "port": self._receiver.port}]},
        }
        (folder / "box.yaml").write_text(yaml.safe_dump(settings))
        self._command = [sys.executable, "-m", module, "play", "--alone", "--box", str(folder / "box.yaml")]
        # As on the box, where everything is compiled when it is installed.
        self._environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(folder / "compiled")}
        self._environment.pop("PYTHONDONTWRITEBYTECODE", None)
        self._kill = kill
        self._process: subprocess.Popen[bytes] | None = None
        self.first_frame()  # compiles, and prepares what a return finds

    def end(self) -> None:
        """The box before this one, and its last frames."""
        if self._process is not None:
            (self._process.kill if self._kill else self._process.terminate)()
            self._process.wait()
        self._receiver.poll(0.01)

    def first_frame(self) -> None:
        """Start it, and wait for the first thing that it sends."""
        self._process = subprocess.Popen(
            self._command, env=self._environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        assert self._receiver.poll(_PATIENCE_S)

    def close(self) -> None:
        self.end()
        self._receiver.close()


@pytest.fixture
def starts(tmp_path: Path) -> Iterator[Callable[..., Starts]]:
    made: list[Starts] = []

    def one(module: str = "appliance.start", kill: bool = True) -> Starts:
        made.append(Starts(tmp_path, module, kill))
        return made[-1]

    yield one
    for each in made:
        each.close()


def test_the_first_start(starts: Callable[..., Starts], measured: Callable[..., Any]) -> None:
    """The phrase is prepared already; the budget is measured."""
    one = starts(kill=False)
    timed = measured("after a show that was ended", GROUP, reference=True)
    timed.pedantic(one.first_frame, setup=one.end, rounds=ROUNDS)


def test_the_return_after_a_crash(starts: Callable[..., Starts], measured: Callable[..., Any]) -> None:
    one = starts()
    measured("after a crash", GROUP).pedantic(one.first_frame, setup=one.end, rounds=ROUNDS)


def test_the_return_by_the_whole_parser(starts: Callable[..., Starts], measured: Callable[..., Any]) -> None:
    """What a start costs that goes by the parser of all commands."""
    one = starts("appliance.cli")
    timed = measured("after a crash, by the parser of all commands", GROUP)
    timed.pedantic(one.first_frame, setup=one.end, rounds=ROUNDS)


def test_noting_the_place(tmp_path: Path, measured: Callable[..., Any]) -> None:
    box = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
    parts = assemble(load_show(default_show_path()), box)
    resuming = Resumption("A show", tmp_path, None, "always")
    reconciler = Reconciler("A show", parts, ShowStateReader(tmp_path))
    measured("noting it", NOTE_GROUP, reference=True)(lambda: resuming.write_checkpoint(reconciler, 1))
    resuming.close()
    parts.close()


def test_reading_the_show_state(tmp_path: Path, measured: Callable[..., Any]) -> None:
    """Once a tick: nothing new is declared in nearly all of them."""
    box = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
    parts = assemble(load_show(default_show_path()), box)
    with closing(ShowStateWriter(tmp_path)) as writer, closing(ShowStateReader(tmp_path)) as reader:
        reconciler = Reconciler("A show", parts, reader)
        writer.write(ShowState(show="A show", generation=int(1e9)))
        assert not reconciler.pending(1.0) and reconciler.generation
        measured("reading it", READ_GROUP, reference=True)(lambda: reconciler.pending(1.0))
    parts.close()
