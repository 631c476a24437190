"""The real box with a timecode by Art-Net, its own one out, and a MIDI controller on a pseudo-terminal."""

from __future__ import annotations

import json
import os
import pty
import socket
import time
import tty
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from appliance.box.show_state import ShowStateReader
from appliance.levers.table import MASTER
from appliance.outputs.frame_reader import FrameReader
from appliance.remote import art_net_timecode
from appliance.remote.timecode import BY_NAME, at
from hw_sim.peers import HOST, free_ports
from tests.bundles import write_show
from tests.system.box import Box, playing
from tests.system.processes import wait_until

pytestmark = pytest.mark.realtime

TV = BY_NAME["25"]
CUES = [{"name": "first", "at": "10:00:01:00"}, {"name": "second", "at": "10:10:00:00"}, {"name": "free"}]
BINDING = {"device": "midiC1D0", "kind": "controller", "channel": 1, "number": 7, "address": "/master"}


class Sender:
    """A desk that sends a timecode from a place on."""

    def __init__(self, port: int, code_s: float) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._port, self._began, self._count = port, time.monotonic(), 0
        self.code_s = code_s

    def locate(self, code_s: float) -> None:
        self._began, self.code_s, self._count = time.monotonic(), code_s, 0

    def now_s(self) -> float:
        return self.code_s + time.monotonic() - self._began

    def pause(self) -> None:
        """Send what is due, in the pauses of a test that waits."""
        while self._count <= 25 * (time.monotonic() - self._began):
            label = at(self.code_s + self._count / 25, TV)
            self._socket.sendto(art_net_timecode.packed(label), (HOST, self._port))
            self._count += 1
        time.sleep(0.01)

    def close(self) -> None:
        self._socket.close()


def led(reader: FrameReader) -> dict[str, Any]:
    return next(iter((reader.health() or {}).get("puppets", [])), {})


def test_the_show_follows_timecode_and_a_controller(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show", cues=CUES)
    code, sent = free_ports(2)
    desk, own = pty.openpty()
    tty.setraw(own)
    (tmp_path / "midiC1D0").symlink_to(os.ttyname(own))
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "midi-bindings.json").write_text(json.dumps({"bindings": [BINDING]}))
    settings = {
        "state": "kept",
        "timecode": {"source": "art-net", "port": code, "chase": "dance", "freewheel_s": 0.5},
        "midi": {"devices": [str(tmp_path / "midiC1D0")]},
    }
    settings["timecode"] |= {"send": [{"host": HOST, "port": sent}]}
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
        playing(show, tmp_path, settings=settings) as box,
        closing(FrameReader(box.runtime)) as reader,
        closing(ShowStateReader(box.runtime)) as state,
        closing(Sender(code, 36000.0)) as sender,
    ):
        receiver.bind((HOST, sent))
        receiver.settimeout(5.0)
        box.frames(1)
        _cues_come_at_their_time(box, state, sender)
        _the_phrase_is_in_step(box, reader, sender)
        _newest(receiver)  # its buffer was full

        def is_sent_on() -> bool:
            label = art_net_timecode.label_in(_newest(receiver))
            return label is not None and abs(label.time_s - sender.now_s()) < 0.2

        wait_until(is_sent_on, lambda: box.output, sender.pause)
        os.write(desk, b"\xb0\x07\x20")
        wait_until(
            lambda: abs(state.read()[MASTER].value - 32 / 127) < 1e-6, lambda: box.output, sender.pause
        )
        os.write(desk, b"\xf0\x7f\x01\x02\x01\x01free\xf7")  # GO of MIDI show control, by name
        wait_until(lambda: state.read().cue == "free", lambda: box.output, sender.pause)
        time.sleep(1.0)
        wait_until(lambda: "timecode-away" in _fallbacks(box), lambda: box.output)  # it stays away
        assert box.end() == 0
    assert "Traceback" not in box.output
    os.close(desk)
    os.close(own)


def _cues_come_at_their_time(box: Box, state: ShowStateReader, sender: Sender) -> None:
    assert state.read().cue == ""
    sender.locate(36000.0)
    wait_until(lambda: state.read().cue == "first", lambda: box.output, sender.pause)
    assert sender.now_s() >= 36001.0
    sender.locate(36601.0)  # ten minutes: a busy machine cannot pass the second cue before it heard the first
    wait_until(lambda: state.read().cue == "second", lambda: box.output, sender.pause)


def _the_phrase_is_in_step(box: Box, reader: FrameReader, sender: Sender) -> None:
    """Since the cue at 10:10:00:00, in a phrase of three seconds."""

    def is_in_step() -> bool:
        reader.newest(time.monotonic())
        health = reader.health() or {}
        behind_s = time.monotonic() - float(health.get("looked_at", 0.0))
        begin, end = led(reader)["excerpt_s"]
        code_s = (sender.now_s() - behind_s - 36600.0) % (end - begin)
        away_s = abs(float(led(reader)["position_s"]) - begin - code_s)
        return min(away_s, end - begin - away_s) < 0.1

    for _ in range(3):  # and it stays there, but for moments in which this machine holds a process up
        wait_until(is_in_step, lambda: box.output, sender.pause)
        until = time.monotonic() + 1.5
        while time.monotonic() < until:
            sender.pause()


def _newest(receiver: socket.socket) -> bytes:
    receiver.setblocking(False)
    newest = b""
    try:
        while True:
            newest = receiver.recv(100)
    except BlockingIOError:
        return newest


def _fallbacks(box: Box) -> str:
    return (box.runtime / "remote.health").read_bytes().decode("latin-1")


def _master(state: ShowStateReader) -> float:
    return state.read()[MASTER].value
