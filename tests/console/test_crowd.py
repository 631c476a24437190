"""Strangers crowd the page: connections, WebSockets, wrong PINs. A device with the PIN notices none of it."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import itertools
import json
import resource
import socket
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from appliance.box.door import IDLE_S, MOST, MOST_FROM_ONE, MOST_STRANGERS, Door
from appliance.box.fallback import Fallbacks
from appliance.box.open_files import open_more_files
from appliance.console.devices import FREE_TRIES, LONG_DIGITS, LONGEST_PAUSE_S, MOST_WRONG, PAUSE_S, WrongPins
from appliance.console.fallback import CROWDED, OF_THE_PAGE, PIN_CHANGED, note_crowd
from appliance.console.watchers import MOST as MOST_WATCHERS
from hw_sim.peers import HOST
from tests.console.page import Page, page_alone
from tests.system.box import Box
from tests.system.processes import PATIENCE_S, Process, wait_until

STRANGERS = 1100
MOST_TAKEN = 40 << 20  # bytes: ten connections have 10 to 26 MB in buffers, and send up to 950 MB


@contextlib.contextmanager
def strangers(page: Page, count: int, *, watch: bool = False) -> Iterator[list[socket.socket]]:
    """Connections without the PIN, which say nothing or watch."""
    open_more_files()
    with contextlib.ExitStack() as opened:
        found = []
        for _ in range(count):
            one = opened.enter_context(socket.create_connection((HOST, page.port), PATIENCE_S))
            if watch:
                shake_hands(one, page)
            found.append(one)
        yield found


def shake_hands(one: socket.socket, page: Page, cookie: str = "") -> bytes:
    """Begin to watch; the first line of the answer."""
    more = f"Cookie: {cookie}\r\n" if cookie else ""
    one.sendall(
        f"GET /watch HTTP/1.1\r\nHost: {HOST}:{page.port}\r\nOrigin: {page.origin}\r\n{more}"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    return one.recv(12)


def are_open(connections: list[socket.socket]) -> int:
    """How many the other side has not closed."""
    count = 0
    for one in connections:
        one.setblocking(False)
        try:
            count += one.recv(1 << 16) != b""
        except BlockingIOError:
            count += 1
        except OSError:
            continue
    return count


def give_pin(page: Page, address: str, body: bytes) -> int:
    """The status that a device at this address gets for it."""
    connection = http.client.HTTPConnection(HOST, page.port, timeout=PATIENCE_S, source_address=(address, 0))
    with contextlib.closing(connection):
        connection.request("POST", "/api/pin", body, {"Origin": page.origin})
        return connection.getresponse().status


def test_a_thousand_strangers_take_nothing_from_a_technician(venue: tuple[Box, Page]) -> None:
    box, page = venue
    page.unlock()
    said = _events(box.output)
    with strangers(page, STRANGERS) as crowd:
        for _ in range(6):
            done = page.command("/panic").value
            assert done["done"], done
        wait_until(lambda: are_open(crowd) <= MOST_FROM_ONE)
        reported = wait_until(
            lambda: [one for one in page.status()["fallbacks"] if one["name"] == CROWDED.name]
        )
        assert (
            reported[0]["active"] and reported[0]["process"] == "console" and HOST in reported[0]["message"]
        )
    assert page.command("/go").value["done"]
    assert _events(box.output) - said < 20, "the log does not grow with the crowd"
    page.cookie = ""


def test_a_flood_without_an_end_takes_no_memory(tmp_path: Path) -> None:
    """Ten strangers send as fast as the page takes it: each kind of request, for a second."""
    with page_alone(tmp_path) as (page, process):
        page.unlock()
        before = _most_bytes(process)
        named = f"Host: {HOST}:{page.port}\r\nOrigin: {page.origin}\r\n"
        pin = f"POST /api/pin HTTP/1.1\r\n{named}Transfer-Encoding: chunked\r\n\r\n"
        for head, rest in (
            ("GET / HTTP/1.1\r\n", "X-Y: y\r\n" * 4000),
            ("GET / HTTP/1.1\r\nX-Y: ", "y" * 65536),
            ("GET /", "y" * 65536),
            (pin, f"10000\r\n{'y' * 65536}\r\n"),
            (f"{pin}1;", "y" * 65536),
            (f"{pin}0\r\n", "X-Y: y\r\n" * 4000),
            ("", f"GET /status HTTP/1.1\r\n{named}\r\n" * 1000),
        ):
            with strangers(page, 10) as crowd:
                sent = _flood(crowd, head.encode(), rest.encode())
                assert page.command("/panic").status == 503, "answered: there is no show control here"
            assert sent > 1 << 18, head
        assert _most_bytes(process) < before + MOST_TAKEN


def _events(output: str) -> int:
    """Lines of the log but for the one a second about the ticks."""
    return sum("Hz  tick" not in line for line in output.splitlines())


def _most_bytes(process: Process) -> int:
    """The most memory that a process has had so far."""
    status = Path(f"/proc/{process.process.pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) << 10


def _flood(crowd: list[socket.socket], head: bytes, rest: bytes) -> int:
    """For a second; the bytes that were taken."""
    for one in crowd:
        one.settimeout(0.1)
        one.sendall(head)
    until, sent = time.monotonic() + 1.0, 0
    for one in itertools.cycle(crowd):
        with contextlib.suppress(OSError):
            sent += one.send(rest)
        if time.monotonic() > until:
            return sent
    return sent


def test_a_crowd_where_the_system_gives_few_descriptors(tmp_path: Path) -> None:
    with page_alone(tmp_path) as (page, process):
        page.unlock()
        resource.prlimit(process.process.pid, resource.RLIMIT_NOFILE, (50, 50))
        with strangers(page, 200):
            for _ in range(6):
                assert page.command("/panic").status == 503, "answered: there is no show control here"
        assert len(process.output.splitlines()) < 20


def test_the_technician_watches_although_strangers_hold_every_place(own_page: Page) -> None:
    own_page.unlock()
    with strangers(own_page, MOST_WATCHERS, watch=True) as crowd:
        with socket.create_connection((HOST, own_page.port), PATIENCE_S) as stranger:
            assert shake_hands(stranger, own_page) == b"HTTP/1.1 503"
        with socket.create_connection((HOST, own_page.port), PATIENCE_S) as technician:
            assert shake_hands(technician, own_page, own_page.cookie) == b"HTTP/1.1 101"
        wait_until(lambda: are_open(crowd) == MOST_WATCHERS - 1)


def test_wrong_pins_from_twelve_addresses_hold_up_nobody_else(own_page: Page) -> None:
    wrong = json.dumps({"pin": "x" * 6, "name": ""}).encode()
    right = json.dumps({"pin": own_page.pin, "name": "phone"}).encode()
    for number in range(12):
        for _ in range(FREE_TRIES):
            assert give_pin(own_page, f"127.0.1.{number + 1}", wrong) == 403
        assert give_pin(own_page, f"127.0.1.{number + 1}", right) == 429
    assert give_pin(own_page, "127.0.2.1", right) == 200


@pytest.mark.parametrize(
    "body",
    [
        b'{"pin": "\\ud800", "name": ""}',
        b'{"pin": "123456", "name": "\\udfff"}',
        b'{"pin": NaN}',
        b'{"pin": 123456}',
        b'{"name": "x"}',
        b"[" * 3000,
        b"[]",
        b"\xff",
        b"",
        b"{",
    ],
)
def test_what_is_no_pin_is_refused_and_counted_as_a_wrong_one(own_page: Page, body: bytes) -> None:
    assert [give_pin(own_page, HOST, body) for _ in range(FREE_TRIES)] == [400] * FREE_TRIES
    right = json.dumps({"pin": own_page.pin, "name": ""}).encode()
    assert give_pin(own_page, HOST, right) == 429
    assert "Traceback" not in (own_page.box_file.parent / "page.txt").read_text()


def test_after_a_thousand_wrong_pins_it_is_a_longer_one(own_page: Page) -> None:
    own_page.unlock()
    before = own_page.pin
    wrong = json.dumps({"pin": "x" * 6, "name": ""}).encode()
    for number in range(MOST_WRONG):
        assert give_pin(own_page, f"127.1.{number // 250}.{number % 250 + 1}", wrong) == 403
    assert own_page.get("/api/me").value["known"], "a device that gave the PIN stays known"
    again = Page(own_page.port, own_page.box_file)
    assert len(again.pin) == LONG_DIGITS and again.pin != before
    reported = wait_until(lambda: own_page.status().get("fallbacks"))
    assert [one["name"] for one in reported] == [PIN_CHANGED.name]
    again.unlock()


def test_each_further_wrong_pin_doubles_the_pause_of_its_address() -> None:
    wrong, now = WrongPins(), 0.0
    for _ in range(FREE_TRIES):
        wrong.note("a", now)
    pauses = []
    for _ in range(6):
        pauses.append(wrong.wait_s("a", now))
        now += pauses[-1]
        assert wrong.wait_s("a", now) == 0.0
        wrong.note("a", now)
    assert pauses == [PAUSE_S, 2 * PAUSE_S, 4 * PAUSE_S, 8 * PAUSE_S, LONGEST_PAUSE_S, LONGEST_PAUSE_S]
    wrong.forget("a")
    assert wrong.wait_s("a", now) == 0.0


class _Transport(asyncio.Transport):
    def __init__(self) -> None:
        super().__init__()
        self.is_closed = False

    def is_closing(self) -> bool:
        return self.is_closed

    def abort(self) -> None:
        self.is_closed = True


class _Doorway:
    """A door with a clock of its own, and connections that are no sockets."""

    def __init__(self) -> None:
        self.now, self.fallbacks = 1000.0, Fallbacks(OF_THE_PAGE)
        self.door = Door(partial(note_crowd, self.fallbacks), lambda: self.now)

    def comes(self, address: str, port: int) -> _Transport:
        made = _Transport()
        self.door.let_in((address, port), self.now).transport = made
        self.now += 0.001
        return made

    @property
    def reported(self) -> list[bool]:
        return [one.active for one in self.fallbacks.happened(self.now)]


def test_idle_strangers_are_closed_and_watchers_and_known_devices_are_not() -> None:
    doorway = _Doorway()
    idle, watching, known = (doorway.comes("10.0.0.1", port) for port in range(3))
    doorway.door.note_request(("10.0.0.1", 1), is_known=False, watches=True)
    doorway.door.note_request(("10.0.0.1", 2), is_known=True, watches=False)
    doorway.door.look(doorway.now + IDLE_S - 1.0)
    assert not idle.is_closed
    doorway.door.look(doorway.now + IDLE_S + 1.0)
    assert [one.is_closed for one in (idle, watching, known)] == [True, False, False]
    assert doorway.reported == [], "nobody had to give way"


def test_one_address_gives_way_to_itself_and_many_to_each_other() -> None:
    doorway = _Doorway()
    own = [doorway.comes("10.0.0.1", port) for port in range(MOST_FROM_ONE + 3)]
    assert [one.is_closed for one in own].index(False) == 3 == sum(one.is_closed for one in own)
    assert doorway.reported == [True]
    for number in range(2 * MOST_STRANGERS):
        doorway.comes(f"10.0.1.{number % 250}", 100 + number)
    assert len(doorway.door) == MOST_STRANGERS
    doorway.door.look(doorway.now + 20.0)
    assert doorway.reported == [False], "the crowd is over"


def test_whatever_strangers_do_known_devices_have_room() -> None:
    doorway = _Doorway()
    known = []
    for port in range(MOST - MOST_STRANGERS):
        known.append(doorway.comes("10.0.0.9", port))
        doorway.door.note_request(("10.0.0.9", port), is_known=True, watches=False)
    for number in range(4 * MOST):
        doorway.comes(f"10.1.{number // 250}.{number % 250}", number)
        doorway.comes("10.0.0.9", 1000 + number)
    assert not any(one.is_closed for one in known)
    assert len(doorway.door) == MOST


def test_what_is_no_http_leaves_no_traceback_in_the_log(own_page: Page) -> None:
    for head in (b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n", b"GET /\xff HTTP/1.1\r\n\r\n", b"\0" * 99):
        with socket.create_connection((HOST, own_page.port), PATIENCE_S) as one:
            one.sendall(head)
            assert b" 400 " in one.recv(1 << 10)
    output = (own_page.box_file.parent / "page.txt").read_text()
    assert len(output.splitlines()) == 1, output


def test_a_process_takes_the_descriptors_that_it_may_have() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, before[1]))
    try:
        open_more_files()
        assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] >= min(4096, before[1])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
