"""Show control's process in a real box and by itself: its socket, its settings, killed, started again."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.levers.table import MASTER
from tests.show_control.doubles import Asker
from tests.system.box import is_free, playing
from tests.system.desk import CONTROL, asking, await_status, control_of, show_state
from tests.system.processes import PATIENCE_S, Process, run

pytestmark = pytest.mark.realtime


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
