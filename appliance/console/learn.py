"""Learn tonight, dance tomorrow: recordings are chosen, learning begins, and the show is offered."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.box.child import environment
from appliance.console.body import said
from appliance.console.child import answer_of, own_child
from appliance.console.guard import Guard
from appliance.console.learning import FOLDER, RECORDINGS, STUDIO_MISSING, USUAL_MIN, Learning, Wanted
from appliance.pose.recorded_minutes import recorded_minutes

STICK = Path("/media/bunraku/bunraku") / RECORDINGS
_EXPORTED_S, _ENDS_WITHIN_S = 120.0, 10.0
_RUNS = "Something is being learned already. Wait for its end, or end it."


class Learn:
    """Requests about learning. kept: where the box keeps what it learns; journal, box: as in Settings.

    On an installed box systemd starts the learner; elsewhere it is a child of this process, and what was
    begun before goes on when this process starts.
    """

    def __init__(
        self, guard: Guard, state: Path, journal: str | None, box: dict[str, str], is_installed: bool
    ) -> None:
        self._guard, self._journal, self._box, self._is_installed = guard, journal, box, is_installed
        self._recordings, self._learning = state / RECORDINGS, Learning(state / FOLDER)
        self._child: asyncio.subprocess.Process | None = None

    def routes(self) -> list[web.RouteDef]:
        """For the server."""
        return [
            web.get("/api/learn", self._state),
            web.post("/api/learn", self._begin),
            web.post("/api/learn/end", self._end),
            web.post("/api/learn/rehearsal", self._use_rehearsal),
        ]

    async def go_on(self) -> None:
        """Continue what a power cut or the end of this process interrupted."""
        if not self._is_installed and self._learning.wanted() is not None and has_studio():
            with contextlib.suppress(OSError):
                await self._start()

    async def close(self) -> None:
        """End the learner; what it learned is kept, and it goes on with the next start."""
        if self._child is not None and self._child.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._child.terminate()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._child.wait(), _ENDS_WITHIN_S)

    async def _state(self, request: web.Request) -> web.Response:
        self._guard.require_device(request)
        listed = await asyncio.to_thread(self._listed)
        return web.json_response(
            {
                "studio": "" if has_studio() else STUDIO_MISSING,
                "recordings": listed,
                "journal": self._journal is not None,
                "runs": self._learning.wanted() is not None,
                "progress": self._learning.told(),
                "can_dance": self._is_installed,
                "show": str(self._learning.show),
            }
        )

    async def _begin(self, request: web.Request) -> web.Response:
        self._guard.require_device(request)
        values = await said(request)
        name, minutes = values.get("recordings"), values.get("minutes", USUAL_MIN)
        folder = self._folder(name)
        if folder is None or not isinstance(minutes, int | float) or not 1 <= minutes <= 720:
            raise web.HTTPBadRequest(text="Choose a folder of recordings, and 1 to 720 minutes.")
        if not has_studio():
            raise web.HTTPConflict(text=STUDIO_MISSING)
        if self._learning.wanted() is not None:
            raise web.HTTPConflict(text=_RUNS)
        try:
            await asyncio.to_thread(shutil.rmtree, self._learning.show, True)
            self._learning.want(Wanted(str(folder), float(minutes)))
            if not self._is_installed:
                await self._start()
        except OSError as error:
            self._learning.end()
            raise web.HTTPServiceUnavailable(text=f"It cannot be begun ({error.strerror}).") from None
        return web.json_response({"done": True})

    async def _end(self, request: web.Request) -> web.Response:
        self._guard.require_device(request)
        self._learning.end()
        self._learning.tell(state="ended")
        return web.json_response({"done": True})

    async def _use_rehearsal(self, request: web.Request) -> web.Response:
        """Turn a live dancer's dance in the journal into recordings to learn from."""
        self._guard.require_device(request)
        await said(request)
        if self._journal is None:
            raise web.HTTPConflict(text="This box keeps no journal: there is no rehearsal to learn from.")
        name = time.strftime("rehearsal-%Y-%m-%d-%H%M%S", time.localtime())
        places = {"journal": self._journal, "into": str(self._recordings / name)}
        return web.Response(
            body=await answer_of("use_rehearsal", _EXPORTED_S, **places), content_type="application/json"
        )

    def _listed(self) -> list[dict[str, Any]]:
        """The folders with recordings on the box and on the stick."""
        found = []
        for place, root in (("box", self._recordings), ("stick", STICK)):
            with contextlib.suppress(OSError):
                inside = sorted(one for one in root.iterdir() if one.is_dir())
                for folder in (root, *inside):
                    files, minutes = recorded_minutes(folder)
                    if files:
                        name = place if folder == root else f"{place}/{folder.name}"
                        found.append({"name": name, "files": files, "minutes": round(minutes, 1)})
        return found

    def _folder(self, name: Any) -> Path | None:
        """A folder of recordings by the name that the page was given: only those that it lists."""
        if not isinstance(name, str) or "\0" in name:
            return None
        place, _, inner = name.partition("/")
        root = {"box": self._recordings, "stick": STICK}.get(place)
        if root is None or inner in (".", "..") or "/" in inner:
            return None
        folder = root / inner if inner else root
        return folder if folder.is_dir() else None

    async def _start(self) -> None:
        quiet = asyncio.subprocess.DEVNULL
        self._child = await own_child("appliance.cli.learn", self._box, environment(), quiet)


def has_studio() -> bool:
    """Whether dancers can be trained here; nothing is imported for it."""
    return all(find_spec(name) is not None for name in ("appliance.studio", "torch", "onnx"))
