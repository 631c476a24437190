"""The control port of a box that starts while another one still holds it."""

from __future__ import annotations

import errno
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from appliance.cli import control
from appliance.cli.control import begin_in, open_control_port
from appliance.cli.doctor.host_view import HostView
from appliance.cli.doctor.venue import ports
from appliance.cli.page_address import open_console_port
from appliance.show.box import BoxConfig
from appliance.show.console import ConsoleConfig
from appliance.show.control import ControlConfig
from appliance.show.show import load_show
from appliance.show_control.packet import messages_in
from appliance.show_control.port import open_port
from appliance.stage.stage_error import StageError
from hw_sim.peers import HOST
from tests.bundles import write_show


@pytest.fixture
def taken() -> socket.socket:
    """A socket that has the port."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind((HOST, 0))
    return one


def test_a_port_that_a_killed_box_lets_go_of_is_waited_for(
    taken: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[float] = []

    def sleep(seconds: float) -> None:
        looks.append(seconds)
        if len(looks) == 3:
            taken.close()

    wanted = ControlConfig(host=HOST, port=taken.getsockname()[1])
    monkeypatch.setattr(control.time, "sleep", sleep)
    with open_control_port(wanted) as port:
        assert port.getsockname()[1] == wanted.port
    assert len(looks) == 3


def test_a_port_that_stays_taken_is_reported(taken: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[float] = []
    began = time.monotonic()
    monkeypatch.setattr(control.time, "sleep", looks.append)
    monkeypatch.setattr(control.time, "monotonic", lambda: began + sum(looks))
    with taken, pytest.raises(StageError, match=r"Address already in use.*second bunraku"):
        open_control_port(ControlConfig(host=HOST, port=taken.getsockname()[1]))
    assert sum(looks) == pytest.approx(2.0, abs=0.1)


def test_a_show_begins_in_a_cue_that_waits_in_the_control_port(tmp_path: Path) -> None:
    show = load_show(write_show(tmp_path / "show", cues=[{"name": "storm"}]))
    with open_port("127.0.0.1", 0) as port:
        begin_in("storm", show, port)
        port.settimeout(20.0)
        assert messages_in(port.recv(100)) == [("/cue", ["storm"])]
        with pytest.raises(StageError, match=r"no cue 'strom'.*Did you mean 'storm'"):
            begin_in("strom", show, port)
    with pytest.raises(StageError, match="needs show control"):
        begin_in("storm", show, None)


ROW = "0: 0100007F:{port:04X} 00000000:0000 07 00000000:00000000 00:00000000 00000000 0 0 77 2"


def test_a_file_closed_during_the_search_hides_no_process(tmp_path: Path) -> None:
    box = BoxConfig.model_validate({"sensors": {"udp": None}, "control": {"port": 9002}})
    process = tmp_path / "proc/4711"
    for folder in (tmp_path / "proc/net", process / "fd"):
        folder.mkdir(parents=True)
    (tmp_path / "proc/net/udp").write_text(ROW.format(port=9002))
    (process / "cmdline").write_text("python\0-m\0appliance.cli\0play\0")
    (process / "comm").write_text("bunraku")
    (process / "fd/3").symlink_to("socket:[77]")
    for number in (2, 4):
        (process / f"fd/{number}").touch()  # no link, so that it cannot be read as one
    (finding, *_) = ports(HostView(tmp_path, box))
    assert finding.message.endswith("the box listens."), finding


# Binds a port, says which, and waits until its standard input is closed.
LISTENS = """import socket, sys
port = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
port.bind(("127.0.0.1", 0))
print(port.getsockname()[1], flush=True)
sys.stdin.read()
"""


@pytest.mark.parametrize(
    ("program", "command", "is_ours"),
    [
        ("my box/bin/bunraku", ("my box/bin/bunraku", "play"), True),
        ("my box/bin/bunraku", ("-I", "-X", "utf8", "my box/bin/bunraku", "play"), True),
        ("appliance/stage.py", ("-m", "appliance.stage"), True),
        ("bunraku/listen.py", ("bunraku/listen.py", "--beside", "bunraku"), False),
        ("my bunraku/appliance.py", ("my bunraku/appliance.py", "-m", "appliance.stage"), False),
        ("appliances/listen.py", ("-m", "appliances.listen"), False),
    ],
)
def test_the_box_is_known_by_what_runs_and_not_by_where_it_lies(
    tmp_path: Path, program: str, command: tuple[str, ...], is_ours: bool
) -> None:
    file = tmp_path / program
    file.parent.mkdir(parents=True)
    (file.parent / "__init__.py").touch()  # a package of this name, before any that is installed
    file.write_text(LISTENS)
    here = [word if word != program else str(file) for word in command]
    with subprocess.Popen(
        [sys.executable, *here],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": ""},
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        port = int(process.stdout.readline())
        box = BoxConfig.model_validate({"sensors": {"udp": {"port": port}}, "control": None})
        found = next(iter(ports(HostView(box=box))))
        process.stdin.close()
    assert found.verdict == ("ok" if is_ours else "wrong"), found


def test_what_to_do_about_a_port_fits_why_it_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    """A box file with the address that the router gave last year, or with a port of the system's."""

    def refused(*_: object) -> socket.socket:
        raise PermissionError(errno.EACCES, "Permission denied")

    with pytest.raises(StageError, match=r"does not have this address now.* under console:") as told:
        open_console_port(ConsoleConfig(host="192.0.2.7", viewers=["10.0.0.0/8"]))
    assert "second bunraku" not in str(told.value)
    monkeypatch.setattr(control, "open_port", refused)
    with pytest.raises(StageError, match=r"below 1024.* under control:") as told:
        open_control_port(ControlConfig(host=HOST, port=514))
    assert "second bunraku" not in str(told.value)
