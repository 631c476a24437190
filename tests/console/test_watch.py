"""Browsers that watch the real box: frames as they leave it, slow and hostile readers, floods of requests."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import socket
import struct
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType

from appliance.console.watchers import LONGEST_MESSAGE, MOST
from appliance.outputs.frame_layout import BROWSER_HEAD
from appliance.outputs.frame_reader import FrameReader
from hw_sim.peers import HOST
from tests.console.page import Page
from tests.system.box import Box
from tests.system.processes import PATIENCE_S, children_running, wait_until

pytestmark = pytest.mark.realtime

# Of the ticks, on a machine that other programs hold up too; a stage that waits for browsers loses all.
LOST_AT_MOST = 0.04
FLOOD, PIPELINED = 10_000, 200  # requests in all, and over one connection
BACKLOG_BYTES = 300_000  # what may wait for a reader that takes nothing: the kernel's buffers on both sides


async def watching(session: ClientSession, page: Page, frames: bool = True) -> ClientWebSocketResponse:
    browser = await session.ws_connect(f"{page.origin}/watch", headers={"Origin": page.origin})
    await browser.send_json({"frames": frames})
    return browser


async def next_frame(browser: ClientWebSocketResponse) -> bytes:
    async with asyncio.timeout(PATIENCE_S):
        while (message := await browser.receive()).type != WSMsgType.BINARY:
            assert message.type == WSMsgType.TEXT, message
    frame: bytes = message.data
    return frame


async def next_status(browser: ClientWebSocketResponse) -> dict[str, Any]:
    async with asyncio.timeout(PATIENCE_S):
        while (message := await browser.receive()).type != WSMsgType.TEXT:
            assert message.type == WSMsgType.BINARY, message
    text: dict[str, Any] = message.json()
    return text


async def _listen(browser: ClientWebSocketResponse, heard: set[str]) -> None:
    async for message in browser:
        heard.add(message.type.name)


def test_a_browser_gets_the_poses_that_leave_the_box(venue: tuple[Box, Page]) -> None:
    box, page = venue
    reader = FrameReader(box.runtime)

    async def compare() -> int:
        equal = 0
        async with ClientSession() as session:
            browser = await watching(session, page)
            until = time.monotonic() + PATIENCE_S
            while equal < 20 and time.monotonic() < until:
                frame = await next_frame(browser)
                tick, _, joints = BROWSER_HEAD.unpack_from(frame)
                puppets = np.frombuffer(frame, "<f4", -1, BROWSER_HEAD.size).reshape(2, 8 * joints)
                for seen in reader.frames(60, time.monotonic()):
                    if seen.tick == tick:
                        for numbers, puppet in zip(puppets, seen.puppets, strict=True):
                            assert np.array_equal(numbers[: 4 * joints], puppet.world.ravel())
                            assert np.array_equal(numbers[4 * joints : 7 * joints], puppet.positions.ravel())
                            assert np.array_equal(numbers[7 * joints :], puppet.holds)
                        equal += 1
        return equal

    assert asyncio.run(compare()) == 20
    shown = page.get("/api/show").value
    assert reader.facts is not None
    assert shown["joints"] == list(reader.facts.skeleton.names) and shown["held"]
    assert str(box.runtime) not in str(shown), "no paths of the box"
    reader.close()


def test_frames_come_only_to_a_browser_that_wants_them_and_words_to_all(venue: tuple[Box, Page]) -> None:
    _, page = venue

    async def count() -> tuple[int, int]:
        async with ClientSession() as session:
            browser = await watching(session, page, frames=False)
            kinds = [(await browser.receive()).type for _ in range(3)]
            await browser.send_json({"frames": True})
            frames, until = 0, time.monotonic() + PATIENCE_S
            while frames < 25 and time.monotonic() < until:
                await next_frame(browser)
                began, frames = time.monotonic(), 0
                while time.monotonic() - began < 2.0:
                    await next_frame(browser)
                    frames += 1
            return kinds.count(WSMsgType.TEXT), frames

    text, frames = asyncio.run(count())
    assert text == 3
    assert frames >= 25, "25 a second on a quiet machine, and half of it in some two seconds of a busy one"


@pytest.mark.parametrize(
    "said", ["", "5", "{", '{"frames": 1}', '{"other": true}', "x" * (LONGEST_MESSAGE + 1), b"\0"]
)
def test_garbage_closes_its_own_connection_alone(venue: tuple[Box, Page], said: str | bytes) -> None:
    _, page = venue

    async def send() -> None:
        async with ClientSession() as session:
            good, bad = await watching(session, page), await watching(session, page)
            await (bad.send_bytes(said) if isinstance(said, bytes) else bad.send_str(said))
            async with asyncio.timeout(PATIENCE_S):
                while (await bad.receive()).type in (WSMsgType.TEXT, WSMsgType.BINARY):
                    pass
            assert bad.closed
            await next_frame(good)

    asyncio.run(send())


def test_raw_garbage_after_the_handshake(venue: tuple[Box, Page], rng: random.Random, long_run: bool) -> None:
    _, page = venue
    for _ in range(300 if long_run else 30):
        with raw_watcher(page) as one, contextlib.suppress(OSError):
            one.sendall(rng.randbytes(rng.randrange(1, 400)))
    assert page.get("/status").value["frames"] == "fresh"


def test_a_reader_that_takes_nothing_gets_the_newest_when_it_wakes(venue: tuple[Box, Page]) -> None:
    """What waited for it meanwhile is bounded, however long it slept: one slot and the kernel's buffers."""
    box, page = venue
    with raw_watcher(page) as asleep:
        asleep.sendall(masked(b'{"frames": true}'))
        time.sleep(4.0)
        asleep.setblocking(False)
        waited = 0
        with contextlib.suppress(BlockingIOError):
            while received := asleep.recv(1 << 20):
                waited += len(received)
        assert 0 < waited < BACKLOG_BYTES
        asleep.settimeout(PATIENCE_S)
        assert asleep.recv(1), "and it gets more now"
    assert box.process.poll() is None


def test_there_is_room_for_a_number_of_browsers(venue: tuple[Box, Page]) -> None:
    _, page = venue

    async def crowd() -> None:
        async with ClientSession() as session:
            heard: list[set[str]] = [set() for _ in range(MOST)]
            listening = []
            for one in heard:  # each answers the page's heartbeat while the others still come
                browser = await watching(session, page, frames=False)
                listening.append(asyncio.create_task(_listen(browser, one)))
            with pytest.raises(Exception, match="503"):
                await watching(session, page)
            async with asyncio.timeout(PATIENCE_S):
                while not all(heard):
                    await asyncio.sleep(0.05)
            for task in listening:
                task.cancel()

    asyncio.run(crowd())
    wait_until(lambda: page.get("/status").status == 200)


def test_twenty_browsers_five_of_them_stuck_and_a_flood_cost_the_dance_nothing(
    venue: tuple[Box, Page],
) -> None:
    box, page = venue
    box.pause()
    stop = threading.Event()
    answered: list[int] = []
    request = f"GET /status HTTP/1.1\r\nHost: {HOST}:{page.port}\r\n"
    pipelined = (f"{request}\r\n" * (PIPELINED - 1) + f"{request}Connection: close\r\n\r\n").encode()

    def flood() -> None:
        while not stop.is_set() or sum(answered) < FLOOD:
            with socket.create_connection((HOST, page.port), PATIENCE_S) as one:
                one.sendall(pipelined)
                answers = b"".join(iter(lambda: one.recv(1 << 20), b""))
            answered.append(answers.count(b"HTTP/1.1 200 OK"))

    async def crowd() -> list[list[Any]]:
        async with ClientSession() as session:
            browsers = [await watching(session, page) for _ in range(15)]
            reading = [asyncio.create_task(read_on(browser)) for browser in browsers]
            frames = await asyncio.to_thread(box.frames, 250)
            while sum(answered) < FLOOD and any(one.is_alive() for one in floods):
                frames += await asyncio.to_thread(box.frames, 50)
            for task in reading:
                task.cancel()
            return frames

    with contextlib.ExitStack() as stuck:
        for _ in range(5):
            stuck.enter_context(raw_watcher(page)).sendall(masked(b'{"frames": true}'))
        floods = [threading.Thread(target=flood) for _ in range(2)]
        began = time.monotonic()
        for one in floods:
            one.start()
        try:
            frames = asyncio.run(crowd())
        finally:
            stop.set()
    for one in floods:
        one.join(PATIENCE_S)
    assert sum(answered) >= FLOOD and set(answered) == {PIPELINED}
    ticks = [frame[0] for frame in frames]
    missing = ticks[-1] - ticks[0] + 1 - len(ticks)
    late, rate = sum(bool(frame[3]) for frame in frames), sum(answered) / (time.monotonic() - began)
    print(f"{sum(answered)} requests, {rate:.0f} a second, all answered.")
    print(f"Of {len(ticks)} ticks {missing} were missing and {late} late.")
    assert missing <= LOST_AT_MOST * len(ticks), f"{missing} ticks of {len(ticks)} are missing"
    assert page.get("/status").value["frames"] == "fresh"


def test_a_command_of_the_page_is_one_of_a_desk(venue: tuple[Box, Page]) -> None:
    _, page = venue
    page.unlock()
    done = page.order("/panic")
    assert done["done"] and "black" in done["message"]
    wait_until(lambda: page.status()["verdict"]["key"] == "panic")
    page.order("/go")
    wait_until(lambda: page.status()["status"]["panic"] == 0)
    refused = page.order("/cue", "clam")
    assert not refused["done"] and "calm" in refused["message"], "the nearest name"
    assert page.order("/cue", "calm")["done"]
    wait_until(lambda: {"name": "calm", "now": True} in page.status()["cues"])
    assert page.order("/player/rate", 1)["done"], "a stream is not answered when it is done"


def test_metrics_are_for_prometheus(venue: tuple[Box, Page]) -> None:
    _, page = venue
    answer = page.get("/metrics")
    assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
    values: dict[str, float] = {}
    for line in answer.text.splitlines():
        if not line.startswith("#"):
            name, value = line.rsplit(" ", 1)
            values[name] = float(value)
    assert values["bunraku_up"] == 1 and 30 < values["bunraku_rate_hertz"] < 70
    assert values['bunraku_sensor_heard{sensor="left-wrist"}'] == 1
    typed = {line.split()[2] for line in answer.text.splitlines() if line.startswith("# TYPE")}
    assert {name.partition("{")[0] for name in values} == typed


def test_the_page_dies_and_comes_back_and_the_dance_does_not_notice(venue: tuple[Box, Page]) -> None:
    box, page = venue

    def deaths() -> int:
        reported = page.status().get("fallbacks", ())
        return sum(one["times"] for one in reported if one["name"] == "console-died")

    assert f"The page: {page.origin}, PIN {page.pin}." in box.output
    page.unlock()
    before = deaths()
    box.pause()
    first = box.frames(1)[0][0]
    (process,) = children_running(box.process.pid, "appliance.console")
    for number in (signal.SIGKILL, signal.SIGSTOP, signal.SIGCONT):
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(os.pidfd_open(process), number)
    wait_until(lambda: children_running(box.process.pid, "appliance.console") not in ([process], []))
    wait_until(page.is_open)
    assert page.get("/api/me").value["known"], "the device is remembered"
    box.pause()
    assert box.frames(1)[0][0] > first and box.process.poll() is None
    wait_until(lambda: deaths() > before)


async def read_on(browser: ClientWebSocketResponse) -> None:
    async for _ in browser:
        pass


@contextlib.contextmanager
def raw_watcher(page: Page) -> Iterator[socket.socket]:
    """A WebSocket after its handshake, with a small buffer, which the test reads or not."""
    with socket.socket() as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        one.settimeout(60)
        one.connect((HOST, page.port))
        one.sendall(
            f"GET /watch HTTP/1.1\r\nHost: {HOST}:{page.port}\r\nOrigin: {page.origin}\r\n"
            "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
        )
        assert one.recv(12) == b"HTTP/1.1 101"
        yield one


def masked(text: bytes) -> bytes:
    """A text frame as browsers send it, masked with zeros (RFC 6455, section 5.2)."""
    return struct.pack(">BB4x", 0x81, 0x80 | len(text)) + text
