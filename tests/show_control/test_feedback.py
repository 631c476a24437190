"""Feedback: a fader follows others, is left alone under a finger, and catches up when it comes late."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.levers.show_state import Change, ShowState
from appliance.levers.table import CAMERA, LEVERS, LOOK, MASTER, hand
from appliance.show_control.command import command
from appliance.show_control.feedback import AGAIN_S, Feedback, messages_of
from hw_sim.osc_receiver import decode
from tests.show_control.doubles import Asker, ControlInThread, StageDouble

NOW = 1000.0
MOTOR = "127.0.0.2"


class Controller:
    """Motor faders: what comes to them by address, the newest value."""

    def __init__(self, host: str) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((host, 0))
        self.at: tuple[str, int] = self.socket.getsockname()

    def hear(self, within_s: float = 0.0) -> list[tuple[str, list[Any]]]:
        heard = []
        while select.select([self.socket], [], [], within_s)[0]:
            (message,) = decode(self.socket.recv(4096))  # one a datagram
            heard.append(message)
            within_s = 0.0
        return heard

    def await_values(self, **wanted: list[Any]) -> list[str]:
        """Addresses of all that came until these had their values."""
        begun, heard = time.monotonic(), []
        while wanted:
            for address, value in self.hear(0.5):
                heard.append(address)
                if wanted.get(name := address.removeprefix("/")) == value:
                    del wanted[name]
            assert time.monotonic() < begun + 20.0, f"{wanted} never came, but {heard}"
        return heard


@pytest.fixture
def faders() -> Iterator[Controller]:
    controller = Controller(MOTOR)
    with contextlib.closing(controller.socket):
        yield controller


def test_a_lever_that_the_page_moves_is_told_at_its_own_address(
    folder: Path, key_file: Path, stage: StageDouble, faders: Controller
) -> None:
    """Over real sockets; the null is a lever that nobody moves: nothing comes of it."""
    control = ControlInThread(folder, key_file, feedback=[faders.at])
    asker = Asker(control.port)
    try:
        faders.await_values(master=[1.0], strings=[1.0], panic=[0], go=[1])  # all of them at the beginning
        asker.ask("/master", 0.25, 3.0)
        assert faders.await_values(master=[0.25]) == ["/master"]
        asker.ask("/cue", "storm")
        heard = faders.await_values(cue=["storm"], look=["ink"], master=[0.5], seed=[7.0])
        assert "/strings" not in heard and len(heard) == len(set(heard))
        asker.ask("/panic")
        assert faders.await_values(panic=[1]) == ["/panic"]
        asker.ask("/master", 0.5)
        assert faders.hear(0.3) == [], "it is there already"
    finally:
        asker.close()
        control.close()


def test_the_one_that_moves_a_lever_is_not_told_until_it_rests(faders: Controller) -> None:
    feedback = Feedback([faders.at], NOW)
    feedback.look(ShowState(), NOW)
    assert len(faders.hear(1.0)) >= 4
    moved = ShowState().to(MASTER, 0.3, NOW)
    feedback.look(moved, NOW + 1.0, faders.at)
    assert faders.hear(0.2) == []
    feedback.look(moved.to(LOOK, "ink"), NOW + 2.0, ("10.0.0.9", 9000))
    assert faders.hear(1.0) == [("/look", ["ink"])]
    feedback.look(moved.to(LOOK, "ink"), NOW + 1.0 + AGAIN_S, None)
    assert dict(faders.hear(1.0))["/master"] == [pytest.approx(0.3)], "switched on late, it catches up"
    feedback.close()


def test_a_program_is_known_by_its_address_whatever_port_it_sends_from() -> None:
    sent: list[Any] = []

    class Sent:
        def send(self, message: Any) -> None:
            sent.append(message)

    feedback = Feedback([], NOW)
    feedback._hosts, feedback._due = [("10.0.0.5", 9001)], [NOW + 100.0]
    feedback._listeners = [Sent()]  # type: ignore[list-item]
    feedback.look(ShowState().to(MASTER, 0.3), NOW, ("10.0.0.5", 60000))
    assert sent == []
    feedback.look(ShowState().to(MASTER, 0.4), NOW, ("10.0.0.6", 9001))
    assert ("/master", 0.4) in sent


def test_each_lever_is_told_as_a_command_that_sets_the_same() -> None:
    """So a controller may send back what it was told; part of a camera, as cues give it, has no such form."""
    changes = [Change(one, value) for one in LEVERS if one.address and (value := _other(one)) is not None]
    state = ShowState().changed(NOW, [*changes, Change(hand("lShldr"), False)])
    reported = {message[0]: message[1:] for message in messages_of(state)}
    assert {one.lever.address for one in changes} <= reported.keys()
    for change in changes:
        address, arguments = change.lever.address, reported[change.lever.address]
        asked = command(address, arguments)
        assert change.lever.given(str(asked.text), asked.values)[0] == change.value, address
    assert reported["/hold"] == ("lShldr", 0.0)
    partly = ShowState().to(CAMERA, {"angle_deg": 20.0})
    assert "/camera" not in {message[0] for message in messages_of(partly)}


def _other(lever: Any) -> Any:
    """Another value than the usual one, in the lever's bounds."""
    if lever.kind.text:
        return None if lever.kind.numbers else "ink"
    numbers: list[tuple[float, bool]] = [
        ((one.least + one.most) / 2, one.is_whole) for one in lever.kind.numbers
    ][:4]
    return lever.kind.given("", [float(round(one)) if whole else one for one, whole in numbers])
