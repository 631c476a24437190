"""Show control and the real box: real OSC tools, a stage that hangs, spins, is killed or ends as usual."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.levers.show_state import ShowState
from appliance.outputs.frame_reader import FrameReader
from appliance.recorder.reading import read_journal
from hw_sim.peers import HOST, free_ports
from tests.bundles import write_show
from tests.show_control.doubles import Asker
from tests.system.box import JOURNAL, PLAY, Box, is_free, playing
from tests.system.desk import CONTROL, asking, await_status, control_of, show_state, status
from tests.system.processes import Process, wait_until

pytestmark = pytest.mark.realtime

CUES: list[dict[str, Any]] = [
    {"name": "calm", "iterations": [2, 1], "look": "lines", "fade_s": 0.1},
    {"name": "storm", "iterations": [4, 3], "hands": [], "look": "ink", "master": 0.5, "fade_s": 0.1},
]
# Becomes a box whose 100th tick never ends.
SPINNING = (
    sys.executable,
    "-c",
    "import sys\n"
    "from appliance.cli.app import main\n"
    "from appliance.stage.tick import Tick\n"
    "run = Tick.run\n"
    "def spin(self, slot):\n"
    "    run(self, slot)\n"
    "    while slot.tick >= 100: pass\n"
    "Tick.run = spin\n"
    "main(['play', *sys.argv[1:]])",
)

# Becomes a box that stops itself once, within its 100th tick or the next one that is not skipped: the tick
# goes on later with its old time.
STOPPING = (
    sys.executable,
    "-c",
    "import os, signal, sys\n"
    "from appliance.cli.app import main\n"
    "from appliance.stage.tick import Tick\n"
    "run, stopped = Tick.run, []\n"
    "def stop(self, slot):\n"
    "    run(self, slot)\n"
    "    if slot.tick >= 100 and not stopped:\n"
    "        stopped.append(slot.tick)\n"
    "        os.kill(os.getpid(), signal.SIGSTOP)\n"
    "Tick.run = stop\n"
    "main(['play', *sys.argv[1:]])",
)


@pytest.fixture(scope="module")
def show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_show(tmp_path_factory.mktemp("bundle") / "show", cues=CUES)


def await_stage(box: Box, state: str) -> None:
    """Wait until the stage itself reports this state: show control stops before the phrase does."""
    with contextlib.closing(FrameReader(box.runtime)) as reader:
        wait_until(lambda: (reader.health() or {}).get("state") == state)


@pytest.mark.skipif(not shutil.which("oscsend"), reason="liblo-tools is not installed")
def test_real_osc_tools_command_the_box_and_hear_its_heartbeat(show: Path, tmp_path: Path) -> None:
    [heart] = free_ports(1)
    heard = tmp_path / "heard.txt"
    with heard.open("wb") as out:
        listener = subprocess.Popen(["stdbuf", "-oL", "oscdump", str(heart)], stdout=out)
    try:
        [port] = free_ports(1)
        control = {"host": HOST, "port": port, "heartbeat": [{"host": HOST, "port": heart}]}
        with playing(show, tmp_path, settings={"control": control, **JOURNAL}) as box:
            box.control = port
            box.frames(1)

            def send(*arguments: str) -> None:
                subprocess.run(["oscsend", HOST, str(port), *arguments], check=True)

            def says(**wanted: str) -> bool:
                line = re.compile(r"/bunraku/status/(\w+) \w \"?([^\"\n]*)\"?$", re.M)
                return wanted.items() <= dict(line.findall(heard.read_text())).items()

            def confirms(*command: str, **wanted: str) -> bool:
                """Send a command; the caller repeats it, because a delayed stage refuses orders."""
                send(*command)
                soon = time.monotonic() + 2.0
                while not says(**wanted) and time.monotonic() < soon:
                    time.sleep(0.05)
                return says(**wanted)

            wait_until(lambda: says(state="dancing", show="A test"))
            wait_until(
                lambda: confirms("/iterations", "ii", "5", "4", coding="5", interaction="4", phrase="main")
            )
            wait_until(lambda: confirms("/cue", "s", "storm", cue="storm", look="ink"))
            send("/master", "f", "0.25")
            wait_until(lambda: says(state="dancing", cue="storm", level="0.250000", panic="0"))
            send("/blackout", "T")
            wait_until(lambda: says(state="blackout"))
            send("/panic")
            wait_until(lambda: says(state="panic"))
            send("/blackout", "F")
            send("/go")
            send("/stop", "f", "0.1")
            wait_until(lambda: says(state="stopped"))
            await_stage(box, "stopped")
            box.receiver.poll()
            box.frames(20)
            assert box.end() == 0
        beats = [
            float.fromhex(f"0x{seconds}.{fraction}")
            for seconds, fraction in re.findall(
                r"^(\w{8})\.(\w{8}) /bunraku/status/state", heard.read_text(), re.M
            )
        ]
        assert np.median(np.diff(beats)) == pytest.approx(1.0, abs=0.2)
    finally:
        listener.kill()
        listener.wait()
    ticks = read_journal(tmp_path / "run.journal").ticks
    assert [4, 3] in ticks["iterations"][:, 0].tolist()
    np.testing.assert_array_equal(ticks["pose"][-1], ticks["pose"][-2])  # the phrase stands still


def test_cues_stop_and_go_reach_the_dance_and_are_answered(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, settings=JOURNAL) as box, asking(box) as asker:
        assert asker.order("/cue", "calm")[2:] == [1, "Cue calm."]
        with contextlib.closing(Asker(box.control)) as other:
            other.tell("/cue")
        await_status(asker, state="dancing", coding=4, interaction=3, cue="storm", look="ink", level=0.5)
        assert asker.ask_all("/hands")[0] == ["/hands/hand", "lShldr", "left-wrist", 0, "orientation"]
        assert "Did you mean 'storm'?" in asker.ask("/cue", "strom")[3]
        assert "Did you mean 'lShldr'?" in asker.ask("/hold", "lSholder", 1)[3]
        assert asker.order("/hold", "lShldr", 1)[2] == 1
        asker.ask("/stop", 0)
        await_status(asker, state="stopped")
        await_stage(box, "stopped")
        box.receiver.poll()
        box.frames(30)
        assert asker.ask("/go")[2] == 1
        await_stage(box, "dancing")
        box.receiver.poll()
        box.frames(60)
        assert box.end() == 0
    poses = read_journal(tmp_path / "run.journal").ticks["pose"][:, 0]
    moves = np.abs(np.diff(poses, axis=0)).max(axis=(1, 2)) > 0
    runs = np.split(np.arange(len(moves)), np.flatnonzero(np.diff(moves)) + 1)
    stood = max((run for run in runs if not moves[run[0]]), key=len)  # a late tick is one that stands, too
    assert len(stood) >= 5
    assert moves[stood[-1] + 1 :].sum() > 20  # and it went on
    assert "Traceback" not in box.output


@pytest.mark.parametrize("command", [PLAY, STOPPING], ids=["anywhere", "within a tick"])
def test_panic_works_while_the_stage_hangs_and_it_goes_on_afterwards(
    show: Path, tmp_path: Path, command: Sequence[str]
) -> None:
    with playing(show, tmp_path, command=command) as box, asking(box) as asker:
        box.frames(20)
        if command is PLAY:
            box.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: "State:\tT" in Path(f"/proc/{box.process.pid}/status").read_text())
        assert asker.ask("/panic")[2] == 1
        assert show_state(box).panic
        await_status(asker, state="hung")
        assert status(asker)["panic"] == 1
        assert "The stage does not answer" in asker.ask("/cue", "storm")[3]
        assert "The stage does not answer" in asker.ask("/iterations", 5, 4)[3]
        assert "The stage does not answer" in asker.ask("/sensors/heading")[3]
        box.receiver.poll()
        box.process.send_signal(signal.SIGCONT)
        box.frames(20)
        await_status(asker, state="panic", cue="storm", coding=5, interaction=4)  # declared while it hung
        assert show_state(box).panic
        assert asker.ask("/go")[2] == 1
        await_status(asker, state="dancing")
        assert box.end() == 0


def test_panic_works_while_the_stage_spins(show: Path, tmp_path: Path) -> None:
    settings = {"realtime": {"enabled": False}}  # with real-time priority it would take a whole core
    with playing(show, tmp_path, command=SPINNING, settings=settings) as box, asking(box) as asker:
        box.frame_that(lambda frame: frame[0] >= 100)
        await_status(asker, state="hung")
        assert asker.ask("/panic")[2] == 1
        assert show_state(box).panic
        box.process.kill()


def test_a_cue_called_while_the_dance_is_away_is_in_force_when_it_comes_back(
    show: Path, tmp_path: Path
) -> None:
    """Show control is a separate unit and outlives the stage."""
    with (
        playing(show, tmp_path, "--alone") as box,
        Process(tmp_path / "control.txt", [*CONTROL, box.box_file]),
        asking(box) as asker,
    ):
        await_status(asker, state="dancing")
        assert asker.order("/cue", "calm")[2] == 1
        box.end(signal.SIGKILL)
        await_status(asker, state="absent")
        assert "The dance begins with this" in asker.ask("/cue", "storm")[3]
        assert status(asker)["look"] == "ink"
        box.kill_and_restart()
        await_status(asker, state="dancing", cue="storm", coding=4, interaction=3)
        assert asker.ask_all("/hands")[0] == ["/hands/hand", "lShldr", "left-wrist", 0, "orientation"]
        box.await_output("the show goes on in the cue 'calm'")
        assert box.end() == 0


def test_a_killed_box_leaves_no_process_behind_and_panic_is_in_force_when_it_comes_back(
    show: Path, tmp_path: Path
) -> None:
    with playing(show, tmp_path) as box:
        with asking(box) as asker:
            control = control_of(box.process.pid)
            assert asker.order("/cue", "storm")[2] == 1
            asker.ask("/panic")
        box.end(signal.SIGKILL)
        wait_until(lambda: is_free(box.control))
        wait_until(lambda: not Path(f"/proc/{control}").exists())
        box.kill_and_restart()
        with asking(box) as asker:
            box.await_output("Still from before: Panic is in force")
            box.await_output("the show goes on in the cue 'storm'")
            assert status(asker)["panic"] == 1
            assert asker.ask("/go")[2] == 1
            await_status(asker, state="dancing", cue="storm")
            assert box.end() == 0
    assert "Traceback" not in box.output


def test_a_show_that_ends_as_usual_leaves_nothing_in_force(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box:
        with asking(box) as asker:
            asker.ask("/panic")
        assert box.end() == 0
        assert show_state(box) == ShowState()
        assert is_free(box.control)
        left = {"stage.lock", "place", "journal", "prepared", "admission"}  # for the next start
        left |= {
            "keeper.lock",
            "keeper.health",
            "control.health",
            "sensors.memory",
            "gestures.memory",
            "said",
        }
        assert set(os.listdir(tmp_path / "runtime")) <= left  # noqa: PTH208
