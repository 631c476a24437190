"""Prove it: the page begins a measurement, shows it while it runs, and lists what was proven."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path

from aiohttp import web

from appliance.box.child import environment
from appliance.console.body import said
from appliance.console.child import own_child
from appliance.console.proofs import FOLDER, Proofs
from appliance.console.proving import KINDS, LONGEST_S, SHORTEST_S, SHOW_GOES, Proving, Wanted
from appliance.console.show_goes import show_goes

_USUAL_S = 30
_LARGEST_PART = 1 << 18  # bytes of progress in one answer
_ENDS_WITHIN_S = 20.0


class Prove:
    """Requests about proofs. box: as in Settings.

    On an installed box systemd starts the prover, with the stage's rights, when something is wanted;
    elsewhere it is a child of this process.
    """

    def __init__(self, runtime: Path, state: Path, box: dict[str, str], is_installed: bool) -> None:
        self._runtime, self._box, self._is_installed = runtime, box, is_installed
        self._proving, self._proofs = Proving(runtime), Proofs(state / FOLDER)
        self._child: asyncio.subprocess.Process | None = None
        self._proving.end()  # what a page before this one began ended with it, or ends now

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/prove", self._state),
            web.post("/api/prove", self._begin),
            web.post("/api/prove/end", self._end),
            web.get("/api/prove/progress", self._progress),
            web.get("/api/prove/{number}", self._document),
        ]

    async def close(self) -> None:
        """End what is being proven."""
        self._proving.end()
        if self._child is not None:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._child.wait(), _ENDS_WITHIN_S)
            with contextlib.suppress(ProcessLookupError):
                self._child.kill()

    async def _state(self, request: web.Request) -> web.Response:
        return web.json_response(
            {
                "runs": None if (wanted := self._running()) is None else wanted._asdict(),
                "show_goes": show_goes(self._runtime),
                "proofs": self._proofs.listed(),
            }
        )

    async def _begin(self, request: web.Request) -> web.Response:
        values = await said(request)
        kind, seconds = values.get("kind"), values.get("seconds", _USUAL_S)
        if kind not in KINDS:
            raise web.HTTPBadRequest(text=f"The box can prove one of these: {', '.join(KINDS)}.")
        if type(seconds) is not int or not SHORTEST_S <= seconds <= LONGEST_S:
            raise web.HTTPBadRequest(text=f"Measure for {SHORTEST_S} to {LONGEST_S} seconds.")
        if self._running() is not None:
            raise web.HTTPConflict(text="Something is being proven already. Wait for its end, or end it.")
        if kind == "latency" and show_goes(self._runtime):
            raise web.HTTPConflict(text=SHOW_GOES)
        try:
            self._proving.want(Wanted(kind, seconds))
            if not self._is_installed:
                await self._start()
        except OSError as error:
            self._proving.end()
            raise web.HTTPServiceUnavailable(text=f"It cannot be begun ({error.strerror}).") from None
        return web.json_response({"done": True})

    async def _end(self, request: web.Request) -> web.Response:
        self._proving.end()
        return web.json_response({"done": True})

    async def _progress(self, request: web.Request) -> web.Response:
        """Whole lines of the progress from an offset on; X-Next: the offset behind them."""
        try:
            start = min(max(0, int(request.query.get("from", "0")[:12])), 1 << 40)
            with self._proving.progress.open("rb") as stream:
                stream.seek(start)
                part = stream.read(_LARGEST_PART)
        except ValueError:
            raise web.HTTPBadRequest(text="`from` is a number.") from None
        except OSError:
            part, start = b"", 0
        lines = part[: part.rfind(b"\n") + 1]
        headers = {"X-Next": str(start + len(lines)), "X-Runs": "1" if self._running() else "0"}
        return web.Response(body=lines, content_type="application/x-ndjson", headers=headers)

    async def _document(self, request: web.Request) -> web.Response:
        number = request.match_info["number"]
        content = self._proofs.content(number)
        if content is None:
            raise web.HTTPNotFound(text="There is no such proof.")
        headers = {"Content-Disposition": f'inline; filename="bunraku-proof-{number}.json"'}
        return web.Response(body=content, content_type="application/json", headers=headers)

    def _running(self) -> Wanted | None:
        """The proof in progress; one that died is over."""
        wanted = self._proving.wanted()
        is_over = self._child is not None and self._child.returncode is not None
        if wanted is not None and (is_over or self._proving.is_silent()):
            self._proving.end()
            return None
        return wanted

    async def _start(self) -> None:
        env = environment(OPENBLAS_NUM_THREADS="1")
        self._child = await own_child("appliance.cli.proof", self._box, env)
