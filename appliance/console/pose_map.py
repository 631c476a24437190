"""The map of the dancer's poses, made by a separate process when a browser first asks for it."""

from __future__ import annotations

import asyncio

from aiohttp import web

from appliance.console.child import answer_of
from appliance.console.stage_view import StageView

_PATIENCE_S = 60.0


class PoseMap:
    """The map of the show that the stage dances; made once for each stage."""

    def __init__(self, stage: StageView) -> None:
        self._stage = stage
        self._making = asyncio.Lock()
        self._made, self._generation = b"", 0

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/map", self.serve)]

    async def serve(self, request: web.Request) -> web.Response:
        """As JSON: generator/pose_map.py. Raises 404 where there is none."""
        async with self._making:
            folder, generation = self._stage.show_directory, self._stage.generation
            if folder is None:
                raise web.HTTPNotFound(text="No stage dances on this box. Start it: bunraku play.")
            if generation != self._generation:
                self._made = await answer_of("pose_map", _PATIENCE_S, show=str(folder))
                self._generation = generation
            return web.Response(body=self._made, content_type="application/json")
