"""`bunraku sensors` against a program that holds the control port without being show control."""

from __future__ import annotations

import re
import socket
import threading
from pathlib import Path

import pytest
import yaml

from appliance.cli.sensors.control_client import ControlClient
from appliance.sensor.keys import create_keys
from appliance.show_control.packet import Message, datagram
from tests.command import Command


class Impostor:
    """Another program on the control port while no box runs, with replies of the test's choice."""

    def __init__(self, folder: Path, replies: list[Message]) -> None:
        self._replies = replies
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.box_file = folder / "box.yaml"
        control = {"host": "127.0.0.1", "port": self._socket.getsockname()[1]}
        self.box_file.write_text(yaml.safe_dump({"sensors": {"keys": "sensors.keys"}, "control": control}))
        threading.Thread(target=self._answer, daemon=True).start()

    def _answer(self) -> None:
        _, asker = self._socket.recvfrom(4096)
        for reply in self._replies:
            self._socket.sendto(datagram(reply), asker)


ESCAPES = "\x1b]0;mine\x07\x1b[2J\x9b31m"


def test_an_impostor_cannot_control_the_terminal(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    line = ("name", "1", *(ESCAPES,) * 2, 50.0, 0.0, 0.0, 0.0, 9, 0, 0, *(ESCAPES,) * 4, 0.0, -1.0)
    listed: list[Message] = [("/sensors/sensor", *line), ("/sensors/end", 1, 0.1, ESCAPES)]
    out, _ = bunraku("sensors", "--box", str(Impostor(tmp_path, listed).box_file))
    assert "mine" in out
    reported: list[Message] = [("/sensors/reply", "/sensors/strobe", 1, ESCAPES)]
    message, _ = bunraku("sensors", "strobe", "head", "--box", str(Impostor(tmp_path, reported).box_file))
    assert "mine" in message
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", out + message)


@pytest.mark.parametrize(
    "replies",
    [
        [("/sensors/end", 0, "x", 7)],
        [("/sensors/end", "0", 0.1, "")],
        [("/sensors/sensor", *range(17)), ("/sensors/end", 1, 0.1, "")],
        [("/sensors/sensor", *"abcdefghijklmnopq"), ("/sensors/end", 1, 0.1, "")],
        [
            ("/sensors/sensor", *"abcd", float("nan"), float("inf"), 0.0, 0.0, 1, 1, 1, *"lmno", 0.0, -1.0),
            ("/sensors/end", 1, 0.1, ""),
        ],
    ],
)
def test_nonsense_from_an_impostor_does_not_count_as_a_box(
    tmp_path: Path, bunraku: Command, replies: list[Message], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ControlClient.__init__, "__defaults__", (0.2,))
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    out, _ = bunraku("sensors", "--box", str(Impostor(tmp_path, replies).box_file))
    assert "No box answers" in out
