"""About the box: its shows, release and addresses, read by a separate process when a browser asks."""

from __future__ import annotations

import asyncio
import time

from aiohttp import web

from appliance.console.child import answer_of

_PATIENCE_S = 60.0
_FRESH_S = 10.0


class About:
    """Reads at most once in 10 s, however many browsers ask. box: as in Settings."""

    def __init__(self, box: dict[str, str]) -> None:
        self._box = box
        self._reading = asyncio.Lock()
        self._read, self._read_at = b"", -_FRESH_S

    async def serve(self, request: web.Request) -> web.Response:
        """As JSON: release/about.py."""
        async with self._reading:
            if time.monotonic() - self._read_at > _FRESH_S:
                self._read = await answer_of("about", _PATIENCE_S, **self._box)
                self._read_at = time.monotonic()
        return web.Response(body=self._read, content_type="application/json")
