"""The page's server: what can be looked at, what can be done, and each request's bounds."""

from __future__ import annotations

import asyncio
import gzip
import hashlib
import math
import secrets
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from aiohttp import web

from appliance.box.fallback import Fallbacks
from appliance.console.about import About
from appliance.console.body import said
from appliance.console.box_view import BoxView
from appliance.console.desk import Desk, NoAnswerError
from appliance.console.devices import LONG_DIGITS, LONGEST_NAME, Devices, WrongPins
from appliance.console.fallback import PIN_CHANGED
from appliance.console.guard import COOKIE, Guard, peer
from appliance.console.happened import Happened
from appliance.console.metrics import CONTENT_TYPE, metrics
from appliance.console.stage_view import StageView
from appliance.console.watchers import Watchers
from appliance.levers.addresses import FORMS, QUESTIONS
from appliance.show_control.command import command
from appliance.show_control.packet import is_readable

FOLDER = Path(__file__).with_name("page")
_KINDS = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".webp": "image/webp",
    ".webmanifest": "application/manifest+json",
}

_YEAR_S = 365 * 24 * 3600
_MOST_ARGUMENTS = 32  # a line over the map
_WRONG = (web.HTTPBadRequest, web.HTTPForbidden, web.HTTPRequestEntityTooLarge, web.HTTPRequestTimeout)
_QUESTIONS = [question.address for question in QUESTIONS]
_NOT_FROM_HERE = frozenset((*_QUESTIONS, "/sensors/list", "/ping"))  # answered to the page in another way


class Server:
    """The routes of the page and their handlers. offers: optional parts that this box has for browsers."""

    def __init__(
        self,
        guard: Guard,
        devices: Devices,
        desk: Desk,
        stage: StageView,
        box: BoxView,
        watchers: Watchers,
        happened: Happened,
        about: About,
        fallbacks: Fallbacks,
        offers: Callable[[], dict[str, bool]],
        others: Iterable[web.RouteDef] = (),
    ) -> None:
        self._others = tuple(others)
        self._happened, self._about, self._offers = happened, about, offers
        self._fallbacks = fallbacks
        self._guard, self._devices, self._desk = guard, devices, desk
        self._stage, self._box, self._watchers = stage, box, watchers
        self._wrong_pins, self._languages = WrongPins(), languages()
        self._refreshing: set[asyncio.Task[None]] = set()

    def app(self) -> web.Application:
        """The application, ready to serve."""
        app = web.Application(middlewares=[self._guard.check])
        app.add_routes(
            [
                web.get("/status", self._status),
                web.get("/metrics", self._metrics),
                web.get("/watch", self._watch),
                web.get("/frame", self._frame),
                web.get("/api/show", self._show),
                web.get("/api/me", self._me),
                web.get("/api/box", self._about.serve),
                web.get("/api/happened", self._happened.timeline),
                web.get("/api/happened/stretch", self._happened.stretch),
                web.get("/api/happened/dance.{ending}", self._happened.download),
                web.get("/api/devices", self._listed),
                web.post("/api/pin", self._take_pin),
                web.post("/api/revoke", self._revoke),
                web.post("/api/command", self._command),
                *self._others,
                web.get("/{path:.*}", PageFiles().serve),
            ]
        )
        return app

    async def _status(self, request: web.Request) -> web.Response:
        return web.Response(text=self._box.text, content_type="application/json")

    async def _metrics(self, request: web.Request) -> web.Response:
        return web.Response(body=metrics(self._box.value).encode(), headers={"Content-Type": CONTENT_TYPE})

    async def _watch(self, request: web.Request) -> web.StreamResponse:
        is_known = self._guard.device(request) is not None
        return await self._watchers.serve(request, self._box.text, peer(request), is_known)

    async def _frame(self, request: web.Request) -> web.Response:
        frame = self._watchers.polled("ghost" in request.query)
        return web.Response(body=frame, content_type="application/octet-stream")

    async def _show(self, request: web.Request) -> web.Response:
        return web.json_response({**self._stage.facts, "generation": self._stage.generation})

    async def _me(self, request: web.Request) -> web.Response:
        device = self._guard.device(request)
        return web.json_response(
            {
                "known": device is not None,
                "name": None if device is None else device.name,
                "languages": self._languages,
                **self._offers(),
            }
        )

    async def _listed(self, request: web.Request) -> web.Response:
        own = self._guard.device(request)
        return web.json_response(
            [
                {"id": one.id, "name": one.name, "since": one.since, "own": one == own}
                for one in self._devices.devices
            ]
        )

    async def _take_pin(self, request: web.Request) -> web.Response:
        try:
            return await self._unlock(request)
        except _WRONG:
            self._wrong_pins.note(peer(request), time.monotonic())
            if self._wrong_pins.are_too_many and self._devices.lengthen_pin():
                self._fallbacks.set(PIN_CHANGED.name, True)
            raise

    async def _unlock(self, request: web.Request) -> web.Response:
        values = await said(request)
        pin, name = values.get("pin"), values.get("name", "")
        asker, now = peer(request), time.monotonic()  # after the body: no other request comes in between
        if wait_s := self._wrong_pins.wait_s(asker, now):
            headers = {"Retry-After": str(math.ceil(wait_s))}
            raise web.HTTPTooManyRequests(text="Too many wrong PINs. Wait a minute.", headers=headers)
        if not isinstance(pin, str) or not isinstance(name, str) or not is_readable([name]):
            raise web.HTTPBadRequest(text="A PIN is a text of digits, and a name is a text.")
        if not secrets.compare_digest(pin.encode()[: 4 * LONG_DIGITS], self._devices.pin.encode()):
            raise web.HTTPForbidden(text="This is not the PIN. The box says it: bunraku console pin.")
        self._wrong_pins.forget(asker)
        self._fallbacks.set(PIN_CHANGED.name, "")
        token = self._devices.remember(name.strip()[:LONGEST_NAME] or "unnamed")
        response = web.json_response({"known": True})
        is_https = request.scheme == "https"
        response.set_cookie(
            COOKIE, token, max_age=_YEAR_S, httponly=True, samesite="Strict", secure=is_https, path="/"
        )
        return response

    async def _revoke(self, request: web.Request) -> web.Response:
        device_id = (await said(request)).get("id")
        if not isinstance(device_id, str) or not self._devices.revoke(device_id):
            raise web.HTTPNotFound(text="There is no such device.")
        return web.json_response({"done": True})

    async def _command(self, request: web.Request) -> web.Response:
        values = await said(request)
        address, arguments = values.get("address"), values.get("arguments", [])
        if not isinstance(address, str) or address not in FORMS or address in _NOT_FROM_HERE:
            raise web.HTTPBadRequest(text="This is no command of the page.")
        if not _are_plain(arguments):
            raise web.HTTPBadRequest(text="Arguments are numbers and texts, 32 at most.")
        try:
            command(address, arguments)  # show control says the same; this keeps its port free of it
            done, message = await self._desk.send_command(address, arguments)
        except ValueError as error:
            done, message = False, str(error)
        except NoAnswerError as error:
            raise web.HTTPServiceUnavailable(text=str(error)) from None
        self._refresh_soon()
        return web.json_response({"done": done, "message": message})

    def _refresh_soon(self) -> None:
        """All browsers see what a command changed without waiting for the next second."""
        if not self._refreshing:
            task = asyncio.create_task(self._refresh())
            self._refreshing.add(task)
            task.add_done_callback(self._refreshing.discard)

    async def _refresh(self) -> None:
        self._box.refresh()
        self._watchers.put_text(self._box.text)


def _are_plain(arguments: object) -> bool:
    if not isinstance(arguments, list) or len(arguments) > _MOST_ARGUMENTS:
        return False
    return all(isinstance(one, str) or (isinstance(one, int | float) and abs(one) < 1e9) for one in arguments)


@dataclass(frozen=True)
class _File:
    content: bytes
    kind: str
    tag: str

    @cached_property
    def packed(self) -> bytes:
        """By gzip: a third of the bytes, on a venue's Wi-Fi a third of the time."""
        return gzip.compress(self.content, mtime=0)


def read_files(folder: Path = FOLDER) -> dict[str, _File]:
    """By the path at which browsers ask for them."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix in _KINDS:
            content = path.read_bytes()
            tag = f'W/"{hashlib.sha256(content).hexdigest()[:16]}"'
            found[f"/{path.relative_to(folder).as_posix()}"] = _File(content, _KINDS[path.suffix], tag)
    return found | {"/": found["/index.html"], "/phone": found["/phone.html"]}


def languages(folder: Path = FOLDER) -> list[str]:
    """Those that have a table of words."""
    return sorted(path.stem for path in (folder / "words").glob("*.json"))


class PageFiles:
    """Serves them; a browser that has the newest gets 304."""

    def __init__(self) -> None:
        self._files = read_files()

    async def serve(self, request: web.Request) -> web.Response:
        """Raises 404 for a path without a file: no path leads anywhere else."""
        file = self._files.get(request.path)
        if file is None:
            raise web.HTTPNotFound(text="There is nothing at this address.")
        headers = {"Cache-Control": "no-cache", "ETag": file.tag, "Vary": "Accept-Encoding"}
        if request.headers.get("If-None-Match") == file.tag:
            return web.Response(status=304, headers=headers)
        content = file.content
        if "gzip" in request.headers.get("Accept-Encoding", ""):
            content, headers["Content-Encoding"] = file.packed, "gzip"
        return web.Response(body=content, content_type=file.kind, charset="utf-8", headers=headers)
