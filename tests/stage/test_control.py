"""Commands come in by real OSC datagrams; what is no command is counted and changes nothing."""

from __future__ import annotations

import random
import socket
import time
from collections.abc import Iterator

import pytest
from pythonosc.udp_client import SimpleUDPClient

from appliance.stage.control import Command, Control, command


@pytest.fixture
def control() -> Iterator[Control]:
    control = Control("127.0.0.1", 0)
    yield control
    control.close()


def next_command(control: Control) -> Command:
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        taken = control.take()
        if taken is not None:
            return taken
        time.sleep(0.001)
    raise AssertionError("no command came")


def test_commands_arrive_in_order(control: Control) -> None:
    client = SimpleUDPClient("127.0.0.1", control.port)
    client.send_message("/player/stop", [])
    client.send_message("/player/jump", 12.5)
    client.send_message("/iterations", [12, 11])
    client.send_message("/mocap/setjointrot", ["lShldr", 0.0, 1.0, 0.0, 1.5])
    assert next_command(control) == Command("stop")
    assert next_command(control) == Command("jump", (12.5,))
    assert next_command(control) == Command("iterations", (12.0, 11.0))
    assert next_command(control) == Command("hold", (0.0, 1.0, 0.0, 1.5), "lShldr")


@pytest.mark.parametrize(
    ("address", "arguments", "complaint"),
    [
        ("/player/go", [], "is no command"),
        ("/player/jump", [], "takes 1 numbers"),
        ("/player/jump", ["soon"], "takes 1 numbers"),
        ("/player/jump", [-1.0], "from 0 to"),
        ("/player/rate", [float("nan")], "from -4 to 4"),
        ("/player/rate", [5.0], "from -4 to 4"),
        ("/iterations", [1, 2, 3], "takes 2 numbers"),
        ("/iterations", [65, 2], "from 0 to 64"),
        ("/mocap/setjointrot", [0.1, 0.0, 1.0, 0.0, 1.5], "begins with the joint"),
        ("/mocap/setjointrot", ["lShldr", 1.0], "takes 4 numbers"),
        ("/player/excerpt", [1.0, 2.0, 3.0], "takes 1 to 2 numbers"),
    ],
)
def test_what_is_no_command_is_refused_in_words(
    address: str, arguments: list[object], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        command(address, arguments)


def test_nonsense_is_counted_and_the_port_goes_on_listening(control: Control) -> None:
    noise = random.Random(5)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(100):
            sender.sendto(noise.randbytes(noise.randrange(64)), ("127.0.0.1", control.port))
        sender.sendto(b"/player/jump\0\0\0\0,s\0\0soon\0\0\0\0", ("127.0.0.1", control.port))
    SimpleUDPClient("127.0.0.1", control.port).send_message("/player/start", [])
    assert next_command(control) == Command("start")
    assert control.refused > 0
    assert control.reason


def test_a_taken_port_raises_and_a_closed_one_is_free_again() -> None:
    control = Control("127.0.0.1", 0)
    with pytest.raises(OSError, match="in use"):
        Control("127.0.0.1", control.port)
    control.close()
    Control("127.0.0.1", control.port).close()
