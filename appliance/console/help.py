"""The help file for a browser: made by a separate process, one at a time, and kept until the next one."""

from __future__ import annotations

import asyncio
import json
import re
import socket
import time
from pathlib import Path

from aiohttp import web

from appliance.console.body import said
from appliance.console.box_view import BoxView
from appliance.console.child import answer_of
from appliance.console.logs import Logs

FILE = "help.zip"  # in the runtime folder
_PATIENCE_S = 120.0


class Help:
    """Requests for it. journal: its folder; None: this box keeps none. box: as in Settings."""

    def __init__(
        self, view: BoxView, logs: Logs, runtime: Path, journal: str | None, box: dict[str, str]
    ) -> None:
        self._view, self._logs, self._box = view, logs, box
        self._file, self._journal, self._name = runtime / FILE, journal, FILE
        self._making = asyncio.Lock()

    def routes(self) -> list[web.RouteDef]:
        return [web.post("/api/help", self._make), web.get("/api/help.zip", self._serve)]

    async def _make(self, request: web.Request) -> web.Response:
        """{"journal": whether the newest minutes of it are wanted} -> {"name"} of the file."""
        wanted = (await said(request)).get("journal")
        if self._making.locked():
            raise web.HTTPConflict(text="The file is being made already. Try again in a moment.")
        async with self._making:
            try:
                log = [
                    f"{_clock(one['time'])} {one['unit']}: {one['message']}"
                    for one in await self._logs.lines()
                ]
            except web.HTTPException as error:
                log = [error.text or ""]
            part = self._file.with_suffix(".part")  # another browser may still be fetching the last one
            try:
                await answer_of(
                    "help_file",
                    _PATIENCE_S,
                    out=str(part),
                    journal=self._journal if wanted else None,
                    log=log,
                    status=json.loads(self._view.text),
                    **self._box,
                )
                part.replace(self._file)
            finally:
                part.unlink(missing_ok=True)
        host = re.sub(r"[^A-Za-z0-9-]", "", socket.gethostname())
        self._name = f"bunraku-help-{host}-{time.strftime('%Y%m%d-%H%M%S')}.zip"
        return web.json_response({"name": self._name})

    async def _serve(self, request: web.Request) -> web.Response:
        try:
            body = self._file.open("rb")  # sent piece by piece, and closed then
        except OSError:
            raise web.HTTPNotFound(text="No help file was made yet.") from None
        headers = {"Content-Disposition": f'attachment; filename="{self._name}"'}
        return web.Response(body=body, content_type="application/zip", headers=headers)


def _clock(seconds: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds))
