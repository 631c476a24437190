"""Serves the newest picture: as MJPEG to several clients, each at its own pace, as one file, and by NDI."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import signal
import socket
import threading
from collections.abc import Awaitable, Callable
from io import BytesIO
from math import inf
from typing import BinaryIO

from aiohttp import web
from PIL import Image

from appliance.box.door import IDLE_S, Door
from appliance.box.open_files import open_more_files
from appliance.box.served import OwnNames, listening, plain_address
from appliance.projector.stream.keying import keyed
from appliance.projector.stream.ndi import NdiSource
from appliance.projector.stream.pipe import ALIVE, WANTED, Picture, read_picture
from appliance.show.stream import StreamConfig

_log = logging.getLogger(__name__)

BOUNDARY = "picture"
MOST_CLIENTS = 8
_BUFFER = 1 << 18  # bytes that the system keeps for a slow client: more would be old pictures
_UNANSWERED_S = 1.0  # before a picture that did not come is asked for again
_SIGN_S = 1.0
_HANGS_S = 4.0  # with one picture: NDI's library does not return
_STUCK_S = 10.0  # before a client that takes nothing makes room for another: its machine may be gone
_HEAD = "--{}\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n"

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Newest:
    """The newest picture as JPEG; clients wait for the next one here."""

    def __init__(self, config: StreamConfig, asks: BinaryIO, ndi: NdiSource | None = None) -> None:
        self._config, self._asks, self._ndi = config, asks, ndi
        self._come = asyncio.Condition()
        self._asked_at = 0.0
        self.picture: Picture = (1, 1, bytes(4))
        self.jpeg = b""
        self.number = 0
        self.watching = self.clients = 0
        self.began_at = inf  # monotonic seconds; inf between pictures

    async def put(self, picture: Picture, jpeg: bytes | None) -> None:
        """A picture has come; jpeg None: nobody waits for it here."""
        self._asked_at = 0.0
        if jpeg is not None:
            async with self._come:
                self.picture, self.jpeg, self.number = picture, jpeg, self.number + 1
                self._come.notify_all()

    async def after(self, number: int) -> int:
        """Wait for a picture that is newer than this one; its number."""
        self.watching += 1
        try:
            async with self._come:
                await self._come.wait_for(lambda: self.number > number)
                return self.number
        finally:
            self.watching -= 1

    async def ask(self) -> None:
        """Ask the projector for pictures, as often as the box file says, while a client waits.

        Once a second it hears that this process lives, unless a picture takes too long: one that hangs is
        started again.
        """
        loop, sign_at = asyncio.get_running_loop(), 0.0
        while True:
            await asyncio.sleep(1.0 / self._config.rate)
            if loop.time() - self.began_at > _HANGS_S:
                continue
            if loop.time() >= sign_at:
                sign_at = loop.time() + _SIGN_S
                self._asks.write(ALIVE)
                self._asks.flush()
            is_wanted = self.watching or (self._ndi is not None and self._ndi.receivers)
            if is_wanted and loop.time() - self._asked_at > _UNANSWERED_S:
                self._asked_at = loop.time()
                self._asks.write(WANTED)
                self._asks.flush()


async def serve(config: StreamConfig, pictures: BinaryIO, asks: BinaryIO) -> None:
    """Listen, until the pictures end or the process is asked to stop. Raises OSError where it cannot."""
    open_more_files()
    ndi = _ndi_source(config)
    newest, loop = Newest(config, asks, ndi), asyncio.get_running_loop()
    over = asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, over.set)
    door, listens = Door(_say_crowd), listening(config.host, config.port)
    listens.setblocking(False)
    runner = web.AppRunner(
        _app(config, newest, door), access_log=None, shutdown_timeout=0.5, keepalive_timeout=IDLE_S
    )
    await runner.setup()
    serve_client = runner.server
    assert serve_client is not None

    def take_pictures() -> None:
        """In a separate thread: clients are served while a picture is encoded."""
        try:
            while (picture := read_picture(pictures)) is not None:
                newest.began_at = loop.time()
                if ndi is not None and ndi.receivers:
                    ndi.send(picture)
                jpeg = jpeg_of(picture, config.quality) if newest.watching else None
                asyncio.run_coroutine_threadsafe(newest.put(picture, jpeg), loop).result()
                newest.began_at = inf
        finally:
            loop.call_soon_threadsafe(over.set)

    threading.Thread(target=take_pictures, name="pictures", daemon=True).start()
    works = newest.ask(), door.accept(listens, serve_client), door.watch()
    tasks = [loop.create_task(one) for one in works]
    await over.wait()
    for task in tasks:
        task.cancel()
    await runner.cleanup()
    listens.close()


def _ndi_source(config: StreamConfig) -> NdiSource | None:
    """None where none is wanted or can be had."""
    try:
        return None if config.ndi is None else NdiSource(config.ndi, config.rate, config.ndi_alpha)
    except OSError as error:
        _log.warning(
            f"The picture does not go out by NDI: {error}. Programs that fetch it by HTTP see it. Install "
            "the NDI runtime, or remove `ndi` from the box file."
        )
        return None


def jpeg_of(picture: Picture, quality: int) -> bytes:
    width, height, pixels = picture
    file = BytesIO()
    Image.frombuffer("RGBX", (width, height), pixels, "raw", "RGBX", 0, 1).convert("RGB").save(
        file, "JPEG", quality=quality
    )
    return file.getvalue()


def png_of(picture: Picture) -> bytes:
    """A picture as PNG with alpha, as much as it shines."""
    width, height, pixels = picture
    file = BytesIO()
    Image.frombytes("RGBA", (width, height), keyed(pixels)).save(file, "PNG", compress_level=1)
    return file.getvalue()


def _say_crowd(address: str) -> None:
    if address:
        _log.warning(
            f"{address} holds so many connections to the stream that the oldest are closed. Audience and "
            "media servers get the picture. Leave that address out of `stream: viewers`."
        )


def _app(config: StreamConfig, newest: Newest, door: Door) -> web.Application:
    networks, names = [ipaddress.ip_network(one) for one in config.viewers], OwnNames(config.names)

    @web.middleware
    async def viewers_only(request: web.Request, handler: Handler) -> web.StreamResponse:
        address = ipaddress.ip_address(plain_address(request.remote or ""))
        may_look = address.is_loopback or any(address in network for network in networks)
        if request.transport is not None:
            connection = request.transport.get_extra_info("peername")
            door.note_request(connection, is_known=may_look, watches=False)
        if not may_look:
            raise web.HTTPForbidden(text="The box file lists this device nowhere under stream: viewers.")
        if not names.has(request.host):  # a foreign page that points its own name at the box
            raise web.HTTPForbidden(text="This is no name of the box. Use its address, or stream: names.")
        return await handler(request)

    async def stream(request: web.Request) -> web.StreamResponse:
        return await _stream(request, newest)

    async def jpeg(request: web.Request) -> web.Response:
        await newest.after(newest.number)
        return web.Response(body=newest.jpeg, content_type="image/jpeg", headers=_NEVER_KEPT)

    async def png(request: web.Request) -> web.Response:
        await newest.after(newest.number)
        png = await asyncio.to_thread(png_of, newest.picture)
        return web.Response(body=png, content_type="image/png", headers=_NEVER_KEPT)

    app = web.Application(middlewares=[viewers_only])
    app.add_routes(
        [web.get("/picture.mjpg", stream), web.get("/picture.jpg", jpeg), web.get("/picture.png", png)]
    )
    return app


_NEVER_KEPT = {"Cache-Control": "no-store"}


async def _stream(request: web.Request, newest: Newest) -> web.StreamResponse:
    """Each client takes the newest picture when it has taken the one before: a slow one gets fewer."""
    if newest.clients >= MOST_CLIENTS:
        raise web.HTTPServiceUnavailable(text=f"{MOST_CLIENTS} programs fetch the picture already.")
    newest.clients += 1
    kind = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
    response = web.StreamResponse(headers={**_NEVER_KEPT, "Content-Type": kind})
    try:
        await response.prepare(request)
        if request.transport is not None:
            request.transport.get_extra_info("socket").setsockopt(
                socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER
            )
        number = newest.number
        while True:
            number = await newest.after(number)
            jpeg = newest.jpeg
            async with asyncio.timeout(_STUCK_S):
                await response.write(_HEAD.format(BOUNDARY, len(jpeg)).encode() + jpeg + b"\r\n")
    except ConnectionError:
        return response
    except TimeoutError:
        if request.transport is not None:
            request.transport.abort()
        return response
    finally:
        newest.clients -= 1
