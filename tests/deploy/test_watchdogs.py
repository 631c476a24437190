"""Each process of the box tells systemd when it works, that it still does, and that it has nothing to do."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.box.supervisor import Supervisor

PATIENCE_S = 60.0  # a machine that does ten other things starts a process slowly
NO_DISPLAY = {"SDL_VIDEODRIVER": "none-such"}
LATE_DISPLAY = """
import sys
from pathlib import Path
from appliance.cli import project as project_command
project_command._RETRY_S = 0.2
window = project_command.parse_options(True, False, None, None, None, False)
sys.exit(project_command.project_show(Path(sys.argv[1]), window, waits=True))
"""


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[Supervisor]:
    made = Supervisor(str(tmp_path / "notify"))
    yield made
    made.close()


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.yaml"
    path.write_text(
        "sensors: {udp: null}\ncontrol: {port: 0}\nconsole: {port: 0}\nstate: state\n"
        "outputs: {osc: [], dmx: [{universe: 1, wire: artnet, host: 127.0.0.1}]}\n"
    )
    return path


@contextlib.contextmanager
def running(supervisor: Supervisor, *command: str, **environ: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, *command],
        env={**os.environ, **supervisor.environ, **environ},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("command", "environ"),
    [
        (("-m", "appliance.cli", "control"), {}),
        (("-m", "appliance.cli", "lights"), {}),
        (("-m", "appliance.cli", "project", "--wait"), NO_DISPLAY),
        (("-m", "appliance.cli", "project", "--offscreen", "64x36"), {}),
        (("-m", "appliance.cli", "console"), {}),
        (("-m", "appliance.cli", "generate"), {}),
    ],
    ids=["control", "lights", "projector without a display", "projector", "console", "generator"],
)
def test_it_is_ready_pings_and_ends_when_asked(
    supervisor: Supervisor, box: Path, command: tuple[str, ...], environ: dict[str, str]
) -> None:
    named = ("--box", str(box))
    with running(supervisor, *command, *named, **environ) as process:
        assert "STATUS=" in supervisor.waits_for("READY=1", PATIENCE_S)
        for _ in range(3):
            supervisor.waits_for("WATCHDOG=1", PATIENCE_S)
        process.send_signal(signal.SIGSTOP)
        os.waitpid(process.pid, os.WUNTRACED)
        supervisor.heard()
        with pytest.raises(TimeoutError):
            supervisor.waits_for("WATCHDOG=1", 0.7)
        process.send_signal(signal.SIGCONT)
        process.terminate()
        assert process.wait(PATIENCE_S) == 0


def test_a_projector_that_waits_takes_the_display_that_comes(
    supervisor: Supervisor, box: Path, tmp_path: Path
) -> None:
    display = free_display()
    environ = {"SDL_VIDEODRIVER": "x11", "DISPLAY": f":{display}"}
    with running(supervisor, "-c", LATE_DISPLAY, str(box), **environ):
        assert "No display" in supervisor.waits_for("READY=1", PATIENCE_S)
        with subprocess.Popen(
            ["Xvfb", f":{display}", "-screen", "0", "320x200x24", "-nolisten", "tcp"],
            stderr=subprocess.DEVNULL,
        ) as late:
            try:
                while "No display" in (message := supervisor.waits_for("READY=1", PATIENCE_S)):
                    pass
                assert "shows pictures" in message
            finally:
                late.terminate()


@pytest.mark.parametrize(
    ("command", "box_file"),
    [
        ("control", "control: null\n"),
        ("console", "console: null\n"),
        ("lights", "outputs: {dmx: []}\n"),
        ("sound", "sound: null\n"),
    ],
)
def test_what_a_box_file_has_no_use_for_ends_well_and_is_not_tried_again(
    supervisor: Supervisor, tmp_path: Path, command: str, box_file: str
) -> None:
    (tmp_path / "box.yaml").write_text(box_file)
    with running(supervisor, "-m", "appliance.cli", command, "--box", str(tmp_path / "box.yaml")) as process:
        assert process.wait(PATIENCE_S) == os.EX_CONFIG, "the unit's RestartPreventExitStatus"
        assert supervisor.heard()[0].startswith("READY=1"), "else systemd would call it a failed start"


def free_display() -> int:
    """Of an X server: no other one has it."""
    for number in range(90, 200):
        with socket.socket(socket.AF_UNIX) as other:
            if (
                other.connect_ex(f"/tmp/.X11-unix/X{number}") != 0
                and not Path(f"/tmp/.X{number}-lock").exists()
            ):
                return number
    raise AssertionError("no display number is free")
