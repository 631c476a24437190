"""The picture as a stream: real HTTP clients get what was rendered, and none holds the projector up."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from io import BytesIO
from pathlib import Path

import moderngl
import numpy as np
import pytest
from aiohttp import web
from PIL import Image

from appliance.box.door import MOST_FROM_ONE, Door
from appliance.box.open_files import open_more_files
from appliance.pose.recording import Recording
from appliance.projector.picture.renderer import Renderer
from appliance.projector.still import draw_still, moment_of
from appliance.projector.stream import server
from appliance.projector.stream.feed import HUNG_S, Feed
from appliance.projector.stream.keying import keyed
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.stream import StreamConfig
from hw_sim.peers import free_ports
from tests.logged import said
from tests.projector.golden_looks import AT_S, SIZE
from tests.system.processes import BUNRAKU

WITHIN_S = 60.0
HOST = "127.0.0.1"


def connected(port: int, path: str) -> HTTPConnection:
    """A connection that has sent its question."""
    until = time.monotonic() + WITHIN_S
    while True:
        try:
            connection = HTTPConnection(HOST, port, timeout=WITHIN_S)
            connection.request("GET", path)
            return connection
        except ConnectionRefusedError:
            assert time.monotonic() < until, "nothing listens"
            time.sleep(0.02)


class Shown:
    """A feed that is offered the newest picture from a thread of the test's, as a projector does."""

    def __init__(self, port: int) -> None:
        self.feed = Feed(StreamConfig(port=port, rate=60.0, quality=95))
        self.reads = 0
        self.worst_s = 0.0
        self.pixels, self.size = bytes(4), (1, 1)

    def show(self, pixels: bytes, size: tuple[int, int]) -> None:
        self.pixels, self.size = pixels, size

    def offer(self) -> None:
        began = time.thread_time()
        self.feed.offer(time.monotonic(), self.size, self._read)
        self.worst_s = max(self.worst_s, time.thread_time() - began)

    def _read(self) -> bytes:
        self.reads += 1
        return self.pixels


@pytest.fixture
def shown() -> Iterator[tuple[Shown, int]]:
    port = free_ports(1, socket.SOCK_STREAM)[0]
    shown = Shown(port)
    shown.offer()
    yield shown, port
    shown.feed.close()


def answered(shown: Shown, connection: HTTPConnection) -> bytes:
    """The body of an answer, or the next part of a stream, while the projector goes on."""
    sock = connection.sock
    sock.setblocking(False)
    found = b""
    until = time.monotonic() + WITHIN_S
    while not _is_whole(found):
        assert time.monotonic() < until
        shown.offer()
        try:
            found += sock.recv(1 << 20)
        except BlockingIOError:
            time.sleep(0.002)
    return found


def _is_whole(found: bytes) -> bool:
    head, _, body = found.partition(b"\r\n\r\n")
    if b"multipart" in head:
        head, _, body = body.partition(b"\r\n\r\n")
    lengths = [
        line.split(b":")[1] for line in head.splitlines() if line.lower().startswith(b"content-length")
    ]
    return bool(lengths) and len(body) >= int(lengths[0])


def test_a_client_gets_the_rendered_picture_and_the_next_one(
    shown: tuple[Shown, int], dance: Recording, gl: moderngl.Context, looks: Renderer
) -> None:
    projector, port = shown
    for path, at_s in (("/picture.mjpg", AT_S), ("/picture.jpg", AT_S + 2.0)):
        rendered = draw_still(gl, looks, moment_of(dance, at_s), "plaster", SIZE)
        bottom_first = np.dstack([rendered, np.zeros(rendered.shape[:2], np.uint8)])[::-1].tobytes()
        projector.show(bottom_first, SIZE)
        connection = connected(port, path)
        found = answered(projector, connection)
        connection.close()
        seen = Image.open(BytesIO(found[found.index(b"\xff\xd8") :]))
        assert seen.size == SIZE
        assert np.abs(np.asarray(seen, int) - rendered).mean() < 2.0
    assert b"multipart/x-mixed-replace" not in found


def test_alpha_is_as_much_as_a_pixel_shines(shown: tuple[Shown, int]) -> None:
    projector, port = shown
    projector.show(bytes([0, 0, 0, 9, 128, 64, 0, 9]), (1, 2))
    connection = connected(port, "/picture.png")
    found = answered(projector, connection)
    connection.close()
    image = np.asarray(Image.open(BytesIO(found[found.index(b"\x89PNG") :])))
    assert image.tolist() == [[[255, 128, 0, 128]], [[0, 0, 0, 0]]]
    light = np.random.default_rng(3).integers(0, 256, (500, 4), np.uint8)
    over_black = np.frombuffer(keyed(light.tobytes()), np.uint8).reshape(-1, 4).astype(float)
    assert np.abs(over_black[:, :3] * over_black[:, 3:] / 255 - light[:, :3]).max() <= 0.51


def test_without_a_client_no_picture_is_read_back(shown: tuple[Shown, int]) -> None:
    projector, port = shown
    connection = connected(port, "/picture.jpg")
    answered(projector, connection)
    connection.close()
    reads = projector.reads
    for _ in range(100):
        projector.offer()
        time.sleep(0.005)  # the process may ask 30 times in this time
    assert projector.reads <= reads + 2


def test_a_client_that_reads_nothing_holds_up_nobody(shown: tuple[Shown, int]) -> None:
    """It keeps at most a buffer of old pictures; another client gets the newest, and offering never waits."""
    projector, port = shown
    noise = np.random.default_rng(1).integers(0, 256, 4 * 640 * 360, np.uint8).tobytes()
    projector.show(noise, (640, 360))
    stuck = connected(port, "/picture.mjpg")
    for number in range(12):
        projector.show(bytes([20 * number]) * (4 * 640 * 360), (640, 360))
        connection = connected(port, "/picture.jpg")
        found = answered(projector, connection)
        connection.close()
        seen = np.asarray(Image.open(BytesIO(found[found.index(b"\xff\xd8") :])), int)
        assert np.abs(seen - 20 * number).max() <= 20 + 2, "the newest, or the one before it"
    assert projector.worst_s < 0.5
    stuck.close()


def test_a_client_that_takes_nothing_for_long_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_STUCK_S", 0.2)
    noise = bytes(1 << 20)

    async def until_it_is_gone() -> None:
        newest = server.Newest(StreamConfig(), BytesIO())
        runner = web.AppRunner(server._app(StreamConfig(), newest, Door(print)))
        await runner.setup()
        await web.TCPSite(runner, HOST, port := free_ports(1, socket.SOCK_STREAM)[0]).start()
        _, writer = await asyncio.open_connection(HOST, port, limit=64)
        writer.write(b"GET /picture.mjpg HTTP/1.1\r\nHost: localhost\r\n\r\n")
        async with asyncio.timeout(WITHIN_S):
            while not newest.watching:
                await asyncio.sleep(0.01)
            while newest.clients:
                await newest.put((1, 1, bytes(4)), noise)
                await asyncio.sleep(0.01)
        writer.close()
        await runner.cleanup()

    asyncio.run(until_it_is_gone())


def test_a_projector_serves_what_its_display_shows_and_takes_the_process_along(tmp_path: Path) -> None:
    port = free_ports(1, socket.SOCK_STREAM)[0]
    box = tmp_path / "box.yaml"
    box.write_text(f"runtime: run\nprojector:\n  stream: {{port: {port}}}\n")
    command = [*BUNRAKU, "project", "--box", box, "--offscreen", "64x36"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        connection = connected(port, "/picture.jpg")
        answer = connection.getresponse()
        seen = Image.open(BytesIO(answer.read()))
        assert (answer.status, seen.size) == (200, (64, 36))
        assert not np.asarray(seen).any(), "no stage: black"
        connection.close()
        process.send_signal(signal.SIGTERM)
        output = process.communicate(timeout=WITHIN_S)[0].decode()
    assert process.returncode == 0 and "Traceback" not in output, output
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((HOST, port))


def test_a_taken_port_is_told_once_and_the_projector_goes_on() -> None:
    with socket.create_server((HOST, 0)) as taken:
        shown = Shown(taken.getsockname()[1])
        now = time.monotonic()
        shown.feed.offer(now, (1, 1), lambda: bytes(4))
        assert shown.feed._process is not None
        shown.feed._process.wait(WITHIN_S)
        for later in (1.0, 6.0, 12.0):
            shown.feed.offer(now + later, (1, 1), lambda: bytes(4))
        shown.feed.close()
    assert len(said) == 1 and "another program's?" in said[0]


@pytest.mark.parametrize(("host", "through"), [("::", HOST), ("::", "::1"), ("0.0.0.0", HOST)])
def test_every_network_is_ipv4_and_ipv6_and_no_foreign_name_is_answered(host: str, through: str) -> None:
    """A foreign page points its own name at the box (DNS rebinding), and its browser sends that name."""
    if ":" in host + through and not socket.has_dualstack_ipv6():
        pytest.skip("this machine has no IPv6")
    (port,) = free_ports(1, socket.SOCK_STREAM)
    config = StreamConfig(host=host, port=port, viewers=["10.0.0.0/8"], names=["Hall.example"])
    feed = Feed(config)
    feed.offer(time.monotonic(), (1, 1), lambda: bytes(4))
    until, found = time.monotonic() + WITHIN_S, dict[str, int]()
    own = f"[{through}]" if ":" in through else through
    for name in (f"{own}:{port}", "hall.example", f"localhost:{port}", "evil.example", "evil.example:80"):
        while name not in found:
            connection = HTTPConnection(through, port, timeout=WITHIN_S)
            try:
                connection.request("GET", "/nothing", headers={"Host": name})
                found[name] = connection.getresponse().status
            except ConnectionRefusedError:
                assert time.monotonic() < until, "nothing listens"
                time.sleep(0.02)
            connection.close()
    feed.close()
    assert list(found.values()) == [404, 404, 404, 403, 403]


def test_a_thousand_connections_that_say_nothing_leave_room_for_a_client(shown: tuple[Shown, int]) -> None:
    projector, port = shown
    projector.show(bytes(4), (1, 1))
    first = connected(port, "/picture.jpg")
    answered(projector, first)
    first.close()
    open_more_files()
    with contextlib.ExitStack() as opened:
        for _ in range(1100):
            opened.enter_context(socket.create_connection((HOST, port), WITHIN_S))
        connection = connected(port, "/picture.jpg")
        assert b"200 OK" in answered(projector, connection)
        connection.close()
        process = projector.feed._process
        assert process is not None
        held = list(Path(f"/proc/{process.pid}/fd").iterdir())
        assert len(held) < MOST_FROM_ONE + 40


def test_a_process_that_cannot_be_started_is_told_once_and_tried_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """For lack of memory. The picture goes on."""
    tried: list[float] = []
    clock = 0.0

    def refused(*_: object, **__: object) -> None:
        tried.append(clock)
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))

    monkeypatch.setattr("appliance.projector.stream.feed.start_child", refused)
    descriptors = len(list(Path("/proc/self/fd").iterdir()))
    stream = Feed(StreamConfig(port=1))
    for clock in np.arange(0.0, 11.0, 0.5).tolist():
        stream.offer(clock, (2, 1), lambda: bytes(8))
    stream.close()
    assert tried == [0.0, 5.0, 10.0] and len(said) == 1 and "Cannot allocate memory" in said[0]
    assert len(list(Path("/proc/self/fd").iterdir())) == descriptors


def test_a_process_that_hangs_is_started_again() -> None:
    (port,) = free_ports(1, socket.SOCK_STREAM)
    feed = Feed(StreamConfig(port=port))
    feed.offer(time.monotonic(), (1, 1), lambda: bytes(4))
    connected(port, "/nothing").close()
    first, begun = feed._process, feed._hangs_at
    assert first is not None
    until = time.monotonic() + WITHIN_S
    while feed._hangs_at == begun:  # until its first sign
        assert time.monotonic() < until
        feed.offer(time.monotonic(), (1, 1), lambda: bytes(4))
        time.sleep(0.02)
    first.send_signal(signal.SIGSTOP)
    now = time.monotonic()
    for later in (0.1, 0.2, 0.3):  # what it said before it hung
        time.sleep(0.1)
        feed.offer(now + later, (1, 1), lambda: bytes(4))
    feed.offer(now + HUNG_S - 1.0, (1, 1), lambda: bytes(4))
    assert first.poll() is None
    feed.offer(now + HUNG_S + 1.0, (1, 1), lambda: bytes(4))
    first.wait(WITHIN_S)
    feed.offer(now + HUNG_S + 2.0, (1, 1), lambda: bytes(4))
    assert feed._process is not first and len(said) == 1 and "or hung" in said[0]
    connected(port, "/nothing").close()
    feed.close()


def test_a_stream_into_the_network_names_its_viewers(tmp_path: Path) -> None:
    box = tmp_path / "box.yaml"
    box.write_text("projector:\n  stream: {host: 0.0.0.0}\n")
    with pytest.raises(ConfigError, match="no device may fetch it"):
        load_box(box)
