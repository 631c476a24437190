"""Learn tonight, dance tomorrow: recordings are chosen, learning begins, and the show is offered."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import shutil
import time
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.box.child import environment
from appliance.box.durable import private_folder
from appliance.console.body import received, said
from appliance.console.child import answer_of, own_child
from appliance.console.learning import (
    FOLDER,
    RECORDINGS,
    STUDIO_MISSING,
    USUAL_MIN,
    Learning,
    Wanted,
    has_studio,
)
from appliance.console.stage_view import StageView
from appliance.pose.recorded_minutes import recorded_minutes

STICK = Path("/media/bunraku/bunraku") / RECORDINGS
_EXPORTED_S, _ENDS_WITHIN_S, _CHECKED_S, _LISTED_S = 120.0, 10.0, 60.0, 20.0
LARGEST_RECORDING, LEFT_FREE = 64 << 20, 1 << 30  # bytes; ten minutes of a figure with fingers have 60 MB
MOST_UPLOADED = 500
_FILE = re.compile(r"(?!\.)[^/\\\x00-\x1f]{1,96}\.bvh", re.IGNORECASE)
_RUNS = "Something is being learned already. Wait for its end, or end it."


class Learn:
    """Requests about learning. kept: where the box keeps what it learns; journal, box: as in Settings.

    On an installed box systemd starts the learner; elsewhere it is a child of this process, and what was
    begun before goes on when this process starts.
    """

    def __init__(
        self, state: Path, journal: str | None, box: dict[str, str], is_installed: bool, stage: StageView
    ) -> None:
        self._journal, self._box, self._is_installed = journal, box, is_installed
        self._stage, self._uploading = stage, asyncio.Lock()
        self._recordings, self._learning = state / RECORDINGS, Learning(state / FOLDER)
        self._child: asyncio.subprocess.Process | None = None

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/learn", self._state),
            web.post("/api/learn", self._begin),
            web.post("/api/learn/end", self._end),
            web.post("/api/learn/rehearsal", self._use_rehearsal),
            web.post("/api/learn/recording", self._take_recording),
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
        runs = self._learning.wanted() is not None
        listed = await asyncio.to_thread(self._listed)
        return web.json_response(
            {
                "studio": "" if has_studio() else STUDIO_MISSING,
                "recordings": listed,
                "shows": [] if runs else await self._shows(),
                "journal": self._journal is not None,
                "runs": runs,
                "progress": self._learning.reported(),
                "can_dance": self._is_installed,
                "show": str(self._learning.show),
            }
        )

    async def _begin(self, request: web.Request) -> web.Response:
        values = await said(request)
        name, minutes = values.get("recordings"), values.get("minutes", USUAL_MIN)
        folder, begins_with = await asyncio.to_thread(self._folder, name), values.get("begins_with", "")
        if begins_with != "" and begins_with not in [one["id"] for one in await self._shows()]:
            raise web.HTTPBadRequest(text="There is no such show to begin with.")
        if folder is None or not isinstance(minutes, int | float) or not 1 <= minutes <= 720:
            raise web.HTTPBadRequest(text="Choose a folder of recordings, and 1 to 720 minutes.")
        if not has_studio():
            raise web.HTTPConflict(text=STUDIO_MISSING)
        if self._learning.wanted() is not None:
            raise web.HTTPConflict(text=_RUNS)
        try:
            await asyncio.to_thread(self._learning.begin, Wanted(str(folder), float(minutes), begins_with))
            if not self._is_installed:
                await self._start()
        except OSError as error:
            self._learning.end()
            raise web.HTTPServiceUnavailable(text=f"It cannot be begun ({error.strerror}).") from None
        return web.json_response({"done": True})

    async def _end(self, request: web.Request) -> web.Response:
        """Only what is still being learned: another browser's second touch must not undo what was learned."""
        was_wanted = self._learning.wanted() is not None
        self._learning.end()
        if was_wanted:
            self._learning.report(state="ended")
        return web.json_response({"done": True})

    async def _use_rehearsal(self, request: web.Request) -> web.Response:
        """Turn a live dancer's dance in the journal into recordings to learn from."""
        await said(request)
        if self._journal is None:
            raise web.HTTPConflict(text="This box keeps no journal: there is no rehearsal to learn from.")
        name = time.strftime("rehearsal-%Y-%m-%d-%H%M%S", time.localtime())
        places = {"journal": self._journal, "into": str(self._recordings / name)}
        return web.Response(
            body=await answer_of("use_rehearsal", _EXPORTED_S, **places), content_type="application/json"
        )

    async def _take_recording(self, request: web.Request) -> web.Response:
        """The body is a BVH file; ?name= is its name. It is read once, as a training would read it."""
        name = request.query.get("name", "")
        if _FILE.fullmatch(name) is None:
            raise web.HTTPBadRequest(text="Recordings are BVH files, such as solo.bvh.")
        folder = self._recordings / time.strftime("uploaded-%Y-%m-%d", time.localtime())
        async with self._uploading:
            part = folder / f".{name}.part"  # no recording until it is whole and was read
            try:
                private_folder(folder)
                for left in folder.glob(".*.part"):  # by a power cut
                    left.unlink()
                if shutil.disk_usage(folder).free < LEFT_FREE + LARGEST_RECORDING:
                    raise web.HTTPInsufficientStorage(text="The disk is nearly full. Delete what you can.")
                if sum(1 for _ in folder.iterdir()) >= MOST_UPLOADED:
                    raise web.HTTPInsufficientStorage(text="That is enough for one day. Begin with these.")
                await received(request, part, LARGEST_RECORDING)
                read = await answer_of("check_recording", _CHECKED_S, file=str(part), name=name)
                part.replace(folder / name)
            except OSError as error:
                raise web.HTTPServiceUnavailable(text=f"It cannot be kept ({error.strerror}).") from None
            finally:
                with contextlib.suppress(OSError):
                    part.unlink(missing_ok=True)
                with contextlib.suppress(OSError):
                    folder.rmdir()  # where nothing is in it
        return web.json_response({"name": f"box/{folder.name}"} | json.loads(read))

    async def _shows(self) -> list[dict[str, Any]]:
        """release/shows_here.py: a learning begins with the dancer of one of them, or with a new dancer."""
        danced, learned = self._stage.show_directory, self._learning.playable()
        folders = {"danced": danced and str(danced), "learned": learned and str(learned)}
        found: list[dict[str, Any]] = json.loads(
            await answer_of("shows_here", _LISTED_S, **folders, **self._box)
        )
        return found

    def _listed(self) -> list[dict[str, Any]]:
        """The folders with recordings on the box and on the stick."""
        found = []
        for place, root in (("box", self._recordings), ("stick", STICK)):
            with contextlib.suppress(OSError):
                inside = sorted(one for one in root.iterdir() if one.is_dir() and one.name[0] != ".")
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
        if root is None or inner.startswith(".") or "/" in inner:  # hidden: a rehearsal that is not whole yet
            return None
        folder = root / inner if inner else root
        return folder if folder.is_dir() else None

    async def _start(self) -> None:
        quiet = asyncio.subprocess.DEVNULL
        self._child = await own_child("appliance.cli.learn", self._box, environment(), quiet)
