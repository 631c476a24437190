"""Changes that a venue makes to its box: keys of the box file, and which of its shows dances."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.box.durable import private_folder
from appliance.console.body import received, said
from appliance.console.child import answer_of
from appliance.console.learning import FOLDER as LEARNING
from appliance.console.learning import Learning
from appliance.console.rehearsed import FOLDER as REHEARSED

_LARGEST_FILE = 1 << 18  # bytes, as in show/yaml_file.py
_LARGEST_SHOW = 400 << 20  # bytes; release/shelf.py takes no larger one
_ARRIVED = "arrived"  # the folder of a show while it comes from another box
_PATIENCE_S = 420.0  # the whole show is checked on a new box file, as from a stick
_ANSWERED_S = 1.0  # the units that start anew are this process's too
ANEW = "anew"  # cli/preflight.py
_SHOW = re.compile(r"[0-9a-f]{0,64}\+[0-9a-f]{0,64}")


class Venue:
    """Each in a separate process, one at a time.

    runtime: where the box's processes meet; box: as in Settings; state: where the copy of the show with its
    new cues lies, and what was learned; show_goes: whether people see the show now.
    """

    def __init__(
        self,
        runtime: Path,
        box: dict[str, str],
        is_installed: bool,
        state: Path,
        show_goes: Callable[[], bool],
    ) -> None:
        self._box, self._is_installed = box, is_installed
        self._show_goes, self._state = show_goes, state
        self._anew = runtime / ANEW
        self._busy = asyncio.Lock()

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/box/file", self._file),
            web.post("/api/box/file", self._change),
            web.post("/api/box/show", self._dance_again),
            web.post("/api/show", self._take_show),
            web.post("/api/cue/dance", partial(self._dance_here, REHEARSED, "rehearsal")),
            web.post("/api/learn/dance", partial(self._dance_here, LEARNING, "learning")),
        ]

    async def _file(self, request: web.Request) -> web.Response:
        return await self._done("box_file")

    async def _change(self, request: web.Request) -> web.Response:
        values = await said(request, 4 * _LARGEST_FILE)
        text, keys, read = values.get("text"), values.get("values", []), values.get("read")
        now, sure = values.get("now", False), values.get("sure", False)
        switches = isinstance(now, bool) and isinstance(sure, bool)
        if not isinstance(text, str) or not switches or not _are_values(keys) or not _is_text(read):
            raise web.HTTPBadRequest(text="A change is a text, values of keys, and whether it counts now.")
        now = now and self._is_installed
        wanted = {"text": text, "values": keys, "now": now, "sure": sure, "read": read}
        return await self._done("change_box_file", change=wanted)

    async def _dance_again(self, request: web.Request) -> web.Response:
        show = (await said(request)).get("id")
        if not self._is_installed or not isinstance(show, str) or _SHOW.fullmatch(show) is None:
            raise web.HTTPBadRequest(text="There is no such show.")
        return await self._done("dance_again", show=show)

    async def _dance_here(self, folder: str, source: str, request: web.Request) -> web.Response:
        await said(request)
        self._require_shelf()
        if folder == LEARNING and Learning(self._state / folder).reported().get("state") != "learned":
            raise web.HTTPConflict(text="No show was learned that reaches the bar.")
        return await self._done("adopt_show", folder=str(self._state / folder), source=source)

    async def _take_show(self, request: web.Request) -> web.Response:
        """The body is a show, packed by another box. It dances at once, or after the next power-on where a
        show goes now.
        """
        self._require_shelf()
        async with self._alone():
            file = self._state / _ARRIVED / "show.zip"
            private_folder(file.parent)
            await received(request, file, _LARGEST_SHOW)
            return await self._answered("take_show", file=str(file), now=not self._show_goes())

    def _require_shelf(self) -> None:
        if not self._is_installed:
            raise web.HTTPBadRequest(text="This box keeps no shows: give bunraku play the copy, with --show.")

    async def _done(self, function: str, **keywords: Any) -> web.Response:
        async with self._alone():
            return await self._answered(function, **keywords)

    @contextlib.asynccontextmanager
    async def _alone(self) -> AsyncIterator[None]:
        if self._busy.locked():
            raise web.HTTPConflict(text="The box file is being checked already. Try again in a moment.")
        async with self._busy:
            yield

    async def _answered(self, function: str, **keywords: Any) -> web.Response:
        answer = await answer_of(function, _PATIENCE_S, **keywords, **self._box)
        if json.loads(answer).get("anew"):
            asyncio.get_running_loop().call_later(_ANSWERED_S, self._anew.touch)
        return web.Response(body=answer, content_type="application/json")


def _is_text(read: object) -> bool:
    return read is None or isinstance(read, str)


def _are_values(values: object) -> bool:
    """Pairs of a location (keys and places) and a value that YAML takes."""
    if not isinstance(values, list) or len(values) > 64:
        return False
    return all(
        isinstance(one, list)
        and len(one) == 2
        and isinstance(one[0], list)
        and 0 < len(one[0]) <= 8
        and all(isinstance(step, str) or type(step) is int for step in one[0])
        for one in values
    )
