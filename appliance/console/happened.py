"""The journal for the page, read by a separate process when a browser asks for it."""

from __future__ import annotations

import asyncio
import contextlib
import tempfile
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.console.child import answer_of
from appliance.console.guard import Guard

LONGEST_S = 60.0  # seconds of the dance at once; 2 MB of frames
_PATIENCE_S = 60.0  # for reading half an hour
_FRESH_S = 5.0
_LARGEST = 64 << 20  # bytes of a download; a minute of the show that comes with the box has 2 MB
_JOURNAL = "bunraku"  # the journal itself, as `bunraku replay` reads it
_ENDINGS = {"bvh": "text/plain", "glb": "model/gltf-binary", _JOURNAL: "application/x-tar"}


class Happened:
    """Runs one reader at a time: browsers that ask often take no processor from the dance.

    journal: its folder; None: this box keeps none.
    """

    def __init__(self, guard: Guard, journal: str | None) -> None:
        self._guard, self._journal = guard, journal
        self._reading = asyncio.Lock()
        self._timeline, self._read_at = b"", -_FRESH_S

    async def timeline(self, request: web.Request) -> web.Response:
        """All runs, newest last, as JSON: recorder/timeline.py."""
        async with self._turn():
            if time.monotonic() - self._read_at > _FRESH_S:
                self._timeline = await self._read("timelines")
                self._read_at = time.monotonic()
            return web.Response(body=self._timeline, content_type="application/json")

    async def stretch(self, request: web.Request) -> web.Response:
        """A stretch of the dance, as frames for the page."""
        part = self._part(request)
        async with self._turn():
            body = await self._read("stretch", **part)
        return web.Response(body=body, content_type="application/octet-stream")

    async def download(self, request: web.Request) -> web.Response:
        """A stretch of the dance as a recording, BVH or glTF; or the journal's own, which needs the PIN."""
        part, ending = self._part(request), request.match_info["ending"]
        if ending not in _ENDINGS:
            raise web.HTTPNotFound(text="There is nothing at this address.")
        if ending == _JOURNAL:
            self._guard.require_device(request)
        async with self._turn():
            with tempfile.TemporaryDirectory(prefix="bunraku-") as folder:
                out = Path(folder) / f"dance.{ending}"
                await self._read("stretch", **part, out=str(out))
                if out.stat().st_size > _LARGEST:
                    raise web.HTTPServiceUnavailable(text="That is too much at once. Take fewer seconds.")
                body = out.open("rb")  # sent piece by piece, and closed then
        name = f"bunraku-{time.strftime('%Y%m%d-%H%M%S')}.{ending}"
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return web.Response(body=body, content_type=_ENDINGS[ending], headers=headers)

    @contextlib.asynccontextmanager
    async def _turn(self) -> AsyncIterator[None]:
        if self._reading.locked():
            raise web.HTTPServiceUnavailable(text="The journal is being read already. Try again in a moment.")
        async with self._reading:
            yield

    def _part(self, request: web.Request) -> dict[str, float]:
        """Keywords of a stretch from a request's query. Raises 400."""
        try:
            run, start_s = int(request.query["run"]), float(request.query["from"])
            seconds = float(request.query.get("seconds", "10"))
        except (KeyError, ValueError):
            raise web.HTTPBadRequest(text="Give run, from and seconds as numbers.") from None
        if not (1 <= run < 1e6 and 0 <= start_s < 1e7 and 0 < seconds <= LONGEST_S):
            raise web.HTTPBadRequest(text=f"A stretch has at most {LONGEST_S:g} seconds.")
        return {"run": run, "start": start_s, "seconds": seconds}

    async def _read(self, function: str, **keywords: Any) -> bytes:
        """The answer of a reading process. Raises 404 with its own sentence, 503 where it takes too long."""
        if self._journal is None:
            raise web.HTTPNotFound(
                text="This box keeps no journal. Write `journal: {folder: journal}` into its box file."
            )
        return await answer_of(function, _PATIENCE_S, journal=self._journal, **keywords)
