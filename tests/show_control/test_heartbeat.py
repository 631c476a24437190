"""The heartbeat: once a second, whatever the stage does, and it says what the stage does."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from pythonosc.osc_message import OscMessage

from appliance.levers.show_state import ShowState
from appliance.levers.status import STATUS, Status
from appliance.levers.table import GOING
from appliance.show_control.listeners import Heartbeat
from appliance.show_control.packet import datagram
from appliance.show_control.stage_observer import StageObserver
from appliance.show_control.status_messages import status
from hw_sim.osc_receiver import decode
from tests.show_control.doubles import HOST, Asker, ControlInThread, StageDouble, until

NOW = 1000.0


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind((HOST, 0))
        listener.settimeout(60.0)
        yield listener


def heard(listener: socket.socket) -> Status:
    fields = {address.removeprefix(f"{STATUS}/"): value for address, [value] in decode(listener.recv(4096))}
    assert [*fields] == [*Status._fields]
    return Status(**fields)  # type: ignore[arg-type]


def some_status(folder: Path) -> Status:
    return status(ShowState(), StageObserver(folder), 0, 0, NOW)


def test_it_beats_on_a_grid_and_after_a_stall_once(folder: Path, listener: socket.socket) -> None:
    heartbeat = Heartbeat([listener.getsockname()], NOW)
    assert heartbeat.due == NOW
    heartbeat.beat(some_status(folder), NOW + 0.3)
    assert heartbeat.due == NOW + 1.0
    heartbeat.beat(some_status(folder), NOW + 7.5)
    assert heartbeat.due == NOW + 8.5
    heartbeat.close()


def test_without_listeners_it_is_never_due() -> None:
    assert Heartbeat([], NOW).due == float("inf")


def test_who_is_not_there_costs_the_others_nothing(folder: Path, listener: socket.socket) -> None:
    heartbeat = Heartbeat([("240.0.0.1", 9), (HOST, 1), listener.getsockname()], NOW)
    for beat in range(3):
        heartbeat.beat(some_status(folder), NOW + beat)
        assert heard(listener).state == "absent"
    heartbeat.close()


def test_every_state_of_the_stage_and_the_house(folder: Path) -> None:
    sight = StageObserver(folder)

    def state(show_state: ShowState, later_s: float = 0.0) -> str:
        now = time.monotonic() + later_s
        return status(show_state, sight, 0, 0, now).state

    assert state(ShowState()) == state(ShowState(panic=True)) == "absent"
    with StageDouble(folder) as stage:
        until(lambda: state(ShowState()) == "dancing")
        until(lambda: state(ShowState(panic=True, blackout=True).to(GOING, 0.0)) == "panic")
        until(lambda: state(ShowState(blackout=True).to(GOING, 0.0)) == "blackout")
        until(lambda: state(ShowState().to(GOING, 0.0)) == "stopped")
        stage.tell(state="stopped")
        until(lambda: state(ShowState()) == "stopped")
        stage.dances = False
        until(lambda: state(ShowState(), later_s=0.6) == "hung")
        assert state(ShowState(panic=True), later_s=0.6) == "hung"
    assert state(ShowState(), later_s=1.0) == "absent"


def test_it_goes_on_while_the_stage_hangs_and_when_it_is_gone(
    folder: Path, listener: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("appliance.show_control.listeners.EVERY_S", 0.1)
    control = ControlInThread(folder, heartbeat=[listener.getsockname()])
    with StageDouble(folder) as stage:
        stage.tell(late=3, temperature_c=61.5, sensor_age_s=None)
        until(lambda: heard(listener).state == "dancing")
        asker = Asker(control.port)
        asker.ask("/nonsense")
        asker.ask("/panic")
        first = next(one for one in iter(lambda: heard(listener), None) if one.state == "panic")
        assert (first.show, first.rate_hz, first.late, first.temperature_c) == ("A test", 50.0, 3, 61.5)
        assert (first.sensor_age_s, first.panic, first.level, first.look) == (-1.0, 1, 0.0, "plaster")
        assert (first.refused, first.strangers) == (1, 0)
        stage.dances = False
        hung = next(one for one in iter(lambda: heard(listener), None) if one.state == "hung")
        assert (hung.rate_hz, hung.panic) == (0.0, 1)
    gone = next(one for one in iter(lambda: heard(listener), None) if one.state == "absent")
    assert gone.late == 0
    asker.close()
    control.close()


def test_replies_reach_a_desk_that_listens_elsewhere_once(folder: Path, listener: socket.socket) -> None:
    with StageDouble(folder):
        gone = ("240.0.0.1", 9)
        control = ControlInThread(folder, replies=[gone, listener.getsockname()])
        asker = Asker(control.port)
        until(lambda: asker.ask("/look", "ink")[2] == 1)
        assert asker.ask("/ping") == ["/pong"]
        asker.tell("/blackout", 7)
        heard: list[OscMessage] = []
        while not heard or heard[-1].params[:1] != ["/blackout"]:
            heard.append(OscMessage(listener.recv(4096)))
        assert ["/look", 1] in [one.params[:2] for one in heard]
        assert [one.address for one in heard].count("/pong") == 1

        listener.connect((HOST, control.port))  # what the listener asks for itself comes once
        listener.send(datagram(("/ping",)))
        listener.send(datagram(("/status",)))
        addresses = [OscMessage(listener.recv(4096)).address for _ in range(2)]
        assert addresses == ["/pong", "/bunraku/status/state"]
        asker.close()
        control.close()
