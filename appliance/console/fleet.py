"""The boxes in this network: found by avahi, each asked how it is; and this box's show goes to others."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import aiohttp
from aiohttp import web

from appliance.console.body import said
from appliance.console.child import answer_of, output_of
from appliance.console.push import PASSES, Neighbour, Passes, body_of, push, unchecked
from appliance.console.stage_view import StageView
from appliance.pose.foreign_file import plain_json

SERVICE = "_bunraku._tcp"
_BROWSE = ("avahi-browse", "--resolve", "--terminate", "--parsable", "--no-db-lookup", SERVICE)
_PATIENCE_S, _ANSWERS_WITHIN_S, _FRESH_S = 8.0, 3.0, 10.0
MOST_BOXES = 20
_LARGEST = 1 << 20
_SENT_AT_ONCE, _PACKED_WITHIN_S = 4, 60.0
_NO_AVAHI = "No other box can be found: install the Debian packages avahi-daemon and avahi-utils."


def neighbours(printed: str) -> list[Neighbour]:
    """The boxes in what `avahi-browse --parsable` prints; the same box on two networks once."""
    found: dict[str, Neighbour] = {}
    for line in printed.splitlines():
        parts = line.split(";", 9)
        if len(parts) < 10 or parts[0] != "=" or parts[2] != "IPv4" or not parts[8].isdecimal():
            continue
        reported = dict(one.strip('"').partition("=")[::2] for one in parts[9].split('" "'))
        scheme = "https" if reported.get("scheme") == "https" else "http"
        name = _unescaped(parts[3])
        one = Neighbour(name, parts[6], parts[7], int(parts[8]), reported.get("version", ""), scheme)
        found.setdefault(parts[6], one)
    return sorted(found.values(), key=lambda one: one.host)[:MOST_BOXES]


def _unescaped(name: str) -> str:
    r"""DNS-SD writes a blank as \032."""
    text, bytes_ = name.split("\\"), bytearray()
    bytes_ += text[0].encode()
    for part in text[1:]:
        if part[:3].isdecimal() and int(part[:3]) < 256:
            bytes_.append(int(part[:3]))
            bytes_ += part[3:].encode()
        else:
            bytes_ += part.encode()
    return bytes_.decode("utf-8", "replace")


async def browsed() -> list[Neighbour]:
    """The boxes that announce themselves now. Raises OSError where avahi is not there."""
    try:
        status, reported, _ = await output_of(*_BROWSE, patience_s=_PATIENCE_S)
    except (OSError, TimeoutError):
        status, reported = 1, b""
    if status:
        raise OSError(_NO_AVAHI)
    return neighbours(reported.decode("utf-8", "replace"))


async def asked(found: Iterable[Neighbour]) -> list[dict[str, Any]]:
    """How each is; each box is its own authority, and only reading is done."""
    patience = aiohttp.ClientTimeout(total=_ANSWERS_WITHIN_S)
    connector = aiohttp.TCPConnector(ssl=unchecked())
    async with aiohttp.ClientSession(connector=connector, timeout=patience) as session:
        return list(await asyncio.gather(*(_asked(session, one) for one in found)))


class Fleet:
    """Looks at most once in ten seconds, however many browsers ask. state: where the page keeps things."""

    def __init__(self, state: Path, stage: StageView) -> None:
        self._stage = stage
        self._passes, self._packed = Passes(state / PASSES), state / "fleet.zip"
        self._packing = asyncio.Lock()
        self._packed_of: tuple[Path, int] | None = None  # the show in `_packed`, and the stage's generation
        self._sending = asyncio.Semaphore(_SENT_AT_ONCE)
        self._looking = asyncio.Lock()
        self._found: dict[str, Neighbour] = {}
        self._seen: list[dict[str, Any]] = []
        self._seen_at = -_FRESH_S

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/fleet", self._serve), web.post("/api/fleet/push", self._push)]

    async def _serve(self, request: web.Request) -> web.Response:
        async with self._looking:
            if time.monotonic() - self._seen_at > _FRESH_S:
                try:
                    self._found = {one.host: one for one in await browsed()}
                except OSError as error:
                    raise web.HTTPServiceUnavailable(text=str(error)) from None
                self._seen = await asked(self._found.values())
                self._seen_at = time.monotonic()
        return web.json_response(self._seen)

    async def _push(self, request: web.Request) -> web.Response:
        """{"host", "pin"}: this box's show to a box that was found; the PIN of that box once."""
        values = await said(request)
        host, pin = values.get("host"), values.get("pin", "")
        one = self._found.get(host) if isinstance(host, str) else None
        if one is None or not isinstance(pin, str):
            raise web.HTTPNotFound(text="There is no such box in this network. Look for them again.")
        show = self._stage.show_directory
        if show is None:
            raise web.HTTPConflict(text="No stage dances on this box: it has no show to send.")
        await self._pack(show)
        async with self._sending:
            pushed = await push(one, self._packed, self._passes, pin, socket.gethostname())
        return web.json_response(pushed._asdict())

    async def _pack(self, show: Path) -> None:
        """Once for each start of a stage: a show does not change while it is danced."""
        async with self._packing:
            danced = show, self._stage.generation
            if danced == self._packed_of and self._packed.is_file():
                return
            await answer_of("pack_show", _PACKED_WITHIN_S, show=str(show), into=str(self._packed))
            self._packed_of = danced


async def _asked(session: aiohttp.ClientSession, one: Neighbour) -> dict[str, Any]:
    """How it is, as its own page has it; without `verdict` where it does not answer."""
    reported: dict[str, Any] = {
        "name": one.name,
        "host": one.host,
        "origin": one.origin,
        "version": one.version,
    }
    try:
        async with session.get(f"{one.origin}/status") as answer:
            value = plain_json(await body_of(answer, _LARGEST))
    except (aiohttp.ClientError, TimeoutError, ValueError):
        return reported
    if not (isinstance(value, dict) and isinstance(value.get("verdict"), dict)):
        return reported
    status = found if isinstance(found := value.get("status"), dict) else {}
    return reported | {
        "verdict": value["verdict"],
        "show": status.get("show", ""),
        "cue": status.get("cue", ""),
    }
