"""The boxes in this network: found by avahi, each asked how it is."""

from __future__ import annotations

import asyncio
import ssl
import time
from typing import Any, NamedTuple

import aiohttp
from aiohttp import web

from appliance.console.child import output_of
from appliance.console.guard import Guard

SERVICE = "_bunraku._tcp"
_BROWSE = ("avahi-browse", "--resolve", "--terminate", "--parsable", "--no-db-lookup", SERVICE)
_PATIENCE_S, _ANSWERS_WITHIN_S, _FRESH_S = 8.0, 3.0, 10.0
MOST_BOXES = 20
_LARGEST = 1 << 20
_NO_AVAHI = "No other box can be found: install the Debian packages avahi-daemon and avahi-utils."


class Neighbour(NamedTuple):
    """A box as avahi knows it. host: its name in the network; version: of its release."""

    name: str
    host: str
    address: str
    port: int
    version: str = ""
    scheme: str = "http"

    @property
    def origin(self) -> str:
        """Where its page is."""
        return f"{self.scheme}://{self.address}:{self.port}"


def neighbours(browsed: str) -> list[Neighbour]:
    """The boxes in what `avahi-browse --parsable` prints; the same box on two networks once."""
    found: dict[str, Neighbour] = {}
    for line in browsed.splitlines():
        parts = line.split(";", 9)
        if len(parts) < 10 or parts[0] != "=" or parts[2] != "IPv4" or not parts[8].isdecimal():
            continue
        told = dict(one.strip('"').partition("=")[::2] for one in parts[9].split('" "'))
        scheme = "https" if told.get("scheme") == "https" else "http"
        name = _unescaped(parts[3])
        one = Neighbour(name, parts[6], parts[7], int(parts[8]), told.get("version", ""), scheme)
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


class Fleet:
    """Looks at most once in ten seconds, however many browsers ask."""

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
        self._looking = asyncio.Lock()
        self._seen: list[dict[str, Any]] = []
        self._seen_at = -_FRESH_S

    def routes(self) -> list[web.RouteDef]:
        """For the server."""
        return [web.get("/api/fleet", self._serve)]

    async def _serve(self, request: web.Request) -> web.Response:
        self._guard.require_device(request)
        async with self._looking:
            if time.monotonic() - self._seen_at > _FRESH_S:
                self._seen = await self._look()
                self._seen_at = time.monotonic()
        return web.json_response(self._seen)

    async def _look(self) -> list[dict[str, Any]]:
        try:
            status, browsed, _ = await output_of(*_BROWSE, patience_s=_PATIENCE_S)
        except (OSError, TimeoutError):
            status, browsed = 1, b""
        if status:
            raise web.HTTPServiceUnavailable(text=_NO_AVAHI)
        found = neighbours(browsed.decode("utf-8", "replace"))
        without_check = ssl.create_default_context()  # each box is its own authority; only reading is done
        without_check.check_hostname, without_check.verify_mode = False, ssl.CERT_NONE
        patience = aiohttp.ClientTimeout(total=_ANSWERS_WITHIN_S)
        connector = aiohttp.TCPConnector(ssl=without_check)
        async with aiohttp.ClientSession(connector=connector, timeout=patience) as session:
            return list(await asyncio.gather(*(_asked(session, one) for one in found)))


async def _asked(session: aiohttp.ClientSession, one: Neighbour) -> dict[str, Any]:
    """How it is, as its own page has it; without `verdict` where it does not answer."""
    told: dict[str, Any] = {"name": one.name, "host": one.host, "origin": one.origin, "version": one.version}
    try:
        async with session.get(f"{one.origin}/status") as answer:
            value = await answer.json() if (answer.content_length or 0) < _LARGEST else {}
    except (aiohttp.ClientError, TimeoutError, ValueError):
        return told
    if not (isinstance(value, dict) and isinstance(value.get("verdict"), dict)):
        return told
    status = value.get("status") or {}
    return told | {"verdict": value["verdict"], "show": status.get("show", ""), "cue": status.get("cue", "")}
