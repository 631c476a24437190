"""The control port of a box that starts while another one still holds it."""

from __future__ import annotations

import socket
import time
from pathlib import Path

import pytest

from appliance.cli import control
from appliance.cli.control import begin_in, open_control_port
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
