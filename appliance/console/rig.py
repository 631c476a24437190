"""The rig with its live levels, as the lights tell it."""

from __future__ import annotations

from pathlib import Path

from aiohttp import web

from appliance.box.live_rig import LiveRigReader


class Rig:
    """Reads what the lights of a runtime folder write."""

    def __init__(self, folder: Path) -> None:
        self._reader = LiveRigReader(folder)

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/rig", self._newest)]

    async def _newest(self, request: web.Request) -> web.Response:
        """As JSON: box/live_rig.py."""
        return web.Response(body=self._reader.newest(), content_type="application/json")

    def close(self) -> None:
        self._reader.close()
