"""Who may command the box; everybody else is dropped, counted, and said now and then."""

from __future__ import annotations

import socket
import time
from contextlib import closing
from pathlib import Path

import pytest

from appliance.show_control.packet import datagram
from appliance.show_control.port import LARGEST_DATAGRAM, Address, Port, open_port
from tests.show_control.doubles import Asker, ControlInThread, until
from tests.system.namespace import Cable, Namespace, why_not

NOW = 1000.0
WHY_NOT = why_not()


class Wire:
    """A socket on which datagrams come from wherever the test says."""

    def __init__(self, host: str, came: list[tuple[bytes, Address] | OSError]) -> None:
        self._host, self._came = host, came

    def setblocking(self, flag: bool) -> None:
        assert not flag

    def getsockname(self) -> Address:
        return self._host, 9002

    def recvfrom(self, size: int) -> tuple[bytes, Address]:
        if not self._came:
            raise BlockingIOError
        one = self._came.pop(0)
        if isinstance(one, OSError):
            raise one
        return one[0][:size], one[1]


def port_with(host: str, senders: list[str], came: list[tuple[bytes, Address] | OSError]) -> Port:
    return Port(Wire(host, came), senders)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("host", "senders", "sender", "may"),
    [
        ("0.0.0.0", ["192.168.4.20"], "192.168.4.20", True),
        ("0.0.0.0", ["192.168.4.20"], "192.168.4.21", False),
        ("0.0.0.0", ["192.168.4.0/24"], "192.168.4.255", True),
        ("0.0.0.0", ["192.168.4.0/24"], "192.168.5.1", False),
        ("0.0.0.0", ["192.168.4.0/24"], "127.0.0.1", True),
        ("192.168.4.1", ["192.168.4.20"], "192.168.4.1", True),
        ("127.0.0.1", [], "127.0.0.1", True),
        ("127.0.0.1", [], "10.0.0.1", False),
    ],
)
def test_this_machine_and_the_listed_may_command(
    host: str, senders: list[str], sender: str, may: bool
) -> None:
    port = port_with(host, senders, [(b"/go", (sender, 5000))])
    assert port.take() == (b"/go" if may else b"", (sender, 5000))
    assert port.strangers == (not may)


def test_strangers_are_said_at_most_once_a_minute_with_their_address() -> None:
    came: list[tuple[bytes, Address] | OSError] = [(b"/go", (f"10.0.0.{n}", 1)) for n in range(1, 6)]
    port = port_with("0.0.0.0", ["192.168.4.20"], came)
    assert port.news(NOW) == ""
    for _ in range(3):
        port.take()
    message = port.news(NOW)
    assert "10.0.0.3 sends commands and is not listed (3 dropped so far)" in message
    assert "`senders` under control" in message
    port.take()
    assert port.news(NOW + 59.0) == ""
    assert "10.0.0.4" in port.news(NOW + 60.0)
    assert port.news(NOW + 200.0) == ""


def test_a_flood_from_made_up_addresses_fills_no_memory() -> None:
    came: list[tuple[bytes, Address] | OSError] = [
        (b"x", (f"10.{n >> 16 & 255}.{n >> 8 & 255}.{n & 255}", 1)) for n in range(5000)
    ]
    port = port_with("0.0.0.0", ["192.168.4.20"], came)
    while port.take() is not None:
        pass
    assert port.strangers == 5000
    assert len(port._known) <= 1001


def test_an_asker_that_is_gone_is_passed_over() -> None:
    here = ("127.0.0.1", 5)
    port = port_with("127.0.0.1", [], [ConnectionRefusedError(), (b"/go", here)])
    assert [port.take() for _ in range(3)] == [(b"", ("", 0)), (b"/go", here), None]


def test_the_largest_datagram_of_udp_comes_whole() -> None:
    port = Port(open_port("127.0.0.1", 0))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program:
        program.sendto(b"/" * LARGEST_DATAGRAM, ("127.0.0.1", port.number))
        taken = port.take()
    assert taken is not None and len(taken[0]) == LARGEST_DATAGRAM
    port.close()


@pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))
@pytest.mark.parametrize(("senders", "may"), [(["10.77.0.3"], False), (["10.77.0.0/24"], True)])
def test_over_a_network_the_listed_are_heard_and_strangers_change_nothing(
    folder: Path, senders: list[str], may: bool
) -> None:
    with Namespace("box") as box, Namespace("desk") as desk:
        Cable(box, "10.77.0.1/24", desk, "10.77.0.2/24")
        with box.entered():
            control = ControlInThread(folder, host="0.0.0.0", senders=senders)
        with desk.entered():
            asker = Asker(control.port, "10.77.0.1")
        for _ in range(50):
            asker.tell("/panic")
        until(lambda: control.process.port.strangers == 50 or asker.hear(0.0) is not None)
        assert control.process.handler.show_state.panic == may
        assert control.process.port.strangers == (0 if may else 50)
        until(lambda: may or bool(control.said))
        reported = {one.name: one for one in control.process.observer.own.happened(time.monotonic())}
        assert ("sender-not-listed" in reported) == (not may)
        assert may or (reported["sender-not-listed"].about, reported["sender-not-listed"].active) == (
            "10.77.0.2",
            True,
        )
        strangers = ["10.77.0.2" in message for message in control.said if "Panic" not in message]
        assert strangers == ([] if may else [True])
        if not may:
            assert asker.hear(0.1) is None  # not even told
        control.close()
        asker.close()


def test_a_taken_port_raises_and_a_closed_one_is_free_again() -> None:
    first = open_port("127.0.0.1", 0)
    number = first.getsockname()[1]
    with pytest.raises(OSError, match="in use"):
        open_port("127.0.0.1", number)
    first.close()
    open_port("127.0.0.1", number).close()


@pytest.mark.parametrize(
    "unsendable", [("/x", "\udcff"), ("", 1), ("/x", object()), ("/x", 1e39), ("/x", 1 << 70)]
)
def test_what_osc_cannot_carry_is_not_sent(unsendable: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="no OSC"):
        datagram(unsendable)
    port = Port(open_port("127.0.0.1", 0))
    port.send(("127.0.0.1", port.number), unsendable)
    assert port.take() is None
    port.close()


@pytest.mark.parametrize("address", ["127.0.0.1", "255.255.255.255", "240.0.0.1"])
def test_an_asker_out_of_reach_costs_nobody_else_an_answer(address: str) -> None:
    port = Port(open_port("127.0.0.1", 0))
    with closing(Asker(port.number)) as asker:
        port.send((address, 1), ("/pong",))
        asker.tell("/ping")
        until(lambda: (taken := port.take()) is not None and taken[0] == datagram(("/ping",)))
        port.send(asker.socket.getsockname(), ("/pong",))
        assert asker.hear() == ["/pong"]
    port.close()


def test_a_port_takes_over_the_socket_that_another_process_has_bound() -> None:
    bound = open_port("127.0.0.1", 0)
    number = bound.getsockname()[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as early:
        early.sendto(b"/go", ("127.0.0.1", number))
        port = Port(bound)
        taken = port.take()
    assert taken is not None
    assert taken[0] == b"/go"
    port.close()
