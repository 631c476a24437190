"""Show control and the real box: real OSC tools, a stage that hangs, spins, is killed or ends as usual."""

from __future__ import annotations

import contextlib
import os
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from appliance.levers.show_state import ShowState
from appliance.levers.table import MASTER
from appliance.outputs.frame_reader import FrameReader
from appliance.recorder.journal_reader import read_journal
from hw_sim.peers import HOST, free_ports
from tests.bundles import write_show
from tests.show_control.doubles import Asker
from tests.system.box import JOURNAL, PLAY, Box, is_free, playing
from tests.system.desk import CONTROL, answers, asking, await_status, control_of, show_state, status
from tests.system.processes import PATIENCE_S, Process, run, wait_until

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


def test_a_flood_does_not_touch_the_dance(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, settings=JOURNAL) as box, asking(box):
        flood = Asker(box.control)
        before = box.frames(1)[0][0]
        for number in range(20_000):
            flood.tell(*(("/player/jump", 0.5), ("/iterations", 3, 2), ("/nonsense",))[number % 3])
        frames = box.frames(50)
        wait_until(lambda: answers(box.control))
        assert box.end() == 0
        flood.close()
    numbers = [frame[0] for frame in frames]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > before
    ticks = read_journal(tmp_path / "run.journal").ticks
    assert float(np.median(ticks["sections_ms"].sum(axis=1))) < 20.0
    assert "refused, the last one" in box.output
    assert "Traceback" not in box.output


def test_a_full_pipe_at_the_output_blocks_no_panic(show: Path, tmp_path: Path) -> None:
    """The reader of the box's output may stop reading."""
    reading, writing = os.pipe()
    sensors, port = free_ports(2)
    box = {"runtime": "runtime", "control": {"port": port}, "console": None}
    box["sensors"] = {"udp": {"port": sensors}}  # another box may have the usual port
    (tmp_path / "box.yaml").write_text(yaml.safe_dump(box))
    command = [*PLAY, "--show", str(show), "--box", str(tmp_path / "box.yaml")]
    unread = b"x" * 4096
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, unread)
    os.set_blocking(writing, True)
    running = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=writing, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: answers(port))
        asker = Asker(port)
        assert asker.ask("/panic")[2] == 1
        asker.close()
        running.terminate()
        assert running.wait(PATIENCE_S) == 0
    finally:
        running.kill()
        running.wait()
        os.close(reading)
        os.close(writing)


def test_show_control_that_is_killed_comes_back_and_misses_nothing(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box, asking(box) as asker:
        asker.ask("/panic")
        control = control_of(box.process.pid)
        os.kill(control, signal.SIGKILL)
        asker.tell("/master", 0.5)  # the port stays open
        assert asker.hear()[:3] == ["/reply", "/master", 1]  # type: ignore[index]
        assert show_state(box).panic
        assert show_state(box)[MASTER].value == 0.5
        assert control_of(box.process.pid) != control
        assert box.end() == 0
    assert "Show control was killed (signal 9)." in box.output
    assert "Still from before: Panic is in force" in box.output


def test_as_a_process_of_its_own_it_outlives_the_stage_and_its_panic_outlives_both(
    show: Path, tmp_path: Path
) -> None:
    """As separate units: `bunraku play --alone` and `bunraku control`."""
    with playing(show, tmp_path, "--alone") as box:
        control = [*CONTROL, box.box_file]
        box.await_output("commands by another process")
        with Process(tmp_path / "control.txt", control) as first:
            with asking(box) as asker:
                await_status(asker, state="dancing")
                box.end(signal.SIGKILL)
                await_status(asker, state="absent")
                assert asker.ask("/panic")[2] == 1
                box.kill_and_restart()
                await_status(asker, state="panic")
            first.kill()
        assert show_state(box).panic
        with Process(tmp_path / "control.txt", control) as second, asking(box) as asker:
            await_status(asker, state="panic")
            third = run(control)
            assert third.returncode == 2 and "cannot be opened for commands" in third.stderr
            assert second.end() == 0
        assert is_free(box.control)
        assert box.end() == 0
        assert show_state(box).panic  # the units were stopped, which ends no show
    assert "Traceback" not in (tmp_path / "control.txt").read_text()


def test_a_socket_that_systemd_has_opened_is_taken(tmp_path: Path) -> None:
    """The protocol of sd_listen_fds: the socket is descriptor 3, the variables name this process."""
    (tmp_path / "box.yaml").write_text("runtime: runtime\ncontrol: {port: 1}\n")
    starter = (
        "import os, socket, sys\n"
        "one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\n"
        "one.bind(('127.0.0.1', 0))\n"
        "print(one.getsockname()[1], flush=True)\n"
        "os.dup2(one.fileno(), 3)\n"
        "os.set_inheritable(3, True)\n"
        "os.environ.update(LISTEN_PID=str(os.getpid()), LISTEN_FDS='1')\n"
        "os.execv(sys.executable, [sys.executable, '-m', 'appliance.cli', 'control', '--box', sys.argv[1]])\n"
    )
    command = [sys.executable, "-c", starter, str(tmp_path / "box.yaml")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as started:
        try:
            assert started.stdout is not None
            assert select.select([started.stdout], [], [], PATIENCE_S)[0], "show control does not start"
            with contextlib.closing(Asker(int(started.stdout.readline()))) as asker:
                assert asker.ask("/ping") == ["/pong"]
            started.terminate()
            assert started.wait(PATIENCE_S) == 0
        finally:
            started.kill()


def test_a_descriptor_that_is_no_port_is_refused(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("runtime: runtime\n")
    command = [*CONTROL, tmp_path / "box.yaml", "--socket-fd"]
    done = run([*command, "77"])
    assert done.returncode == 2
    assert "is no open socket" in done.stderr
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as stream:
        done = run([*command, str(stream.fileno())], pass_fds=[stream.fileno()])
    assert "is not UDP over IPv4" in done.stderr


@pytest.mark.parametrize(
    ("box", "complaint", "status"),
    [
        ("control: null\n", "this box takes no commands", os.EX_CONFIG),
        ("control: {host: 0.0.0.0}\n", "box.yaml:1: Commands are heard on 0.0.0.0, but no sender", 2),
        ("control:\n  senders: [192.168.4.300]\n", "box.yaml:2: '192.168.4.300' is neither", 2),
        ("control: {heartbeat: [{port: 0}]}\n", "box.yaml:1: 'control.heartbeat[0].port' is 0", 2),
        ("control: {sender: []}\n", "Did you mean 'senders'?", 2),
    ],
)
def test_wrong_settings_are_reported_in_one_clear_line(
    tmp_path: Path, box: str, complaint: str, status: int
) -> None:
    (tmp_path / "box.yaml").write_text(box)
    done = run([*CONTROL, tmp_path / "box.yaml"])
    assert done.returncode == status
    assert complaint in done.stderr
    assert len(done.stderr.splitlines()) == 1
