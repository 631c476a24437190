"""Sensors renamed, replaced, revoked and paired from the page: by the same commands as at the prompt."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Sequence
from typing import Any

from aiohttp import web

from appliance.box.child import BUNRAKU
from appliance.console.body import said
from appliance.console.stage_view import StageView

_LONGEST = 80  # letters of a name, a network or a password
_MOST_BYTES = 1 << 16  # a command's output
_PATIENCE_S = 180.0  # a wearable on a cable that does not answer is given up before that
_EMULATED = "These sensors are emulated for a rehearsal: there is nothing to change about them."


class SensorChanges:
    """Runs one command at a time and passes its output on. box: options that name the box file."""

    def __init__(self, stage: StageView, box: Sequence[str]) -> None:
        self._stage, self._box = stage, tuple(box)
        self._changing = asyncio.Lock()

    def routes(self) -> list[web.RouteDef]:
        return [web.post("/api/sensors", self.change)]

    async def change(self, request: web.Request) -> web.StreamResponse:
        """A line of JSON for each sentence, {"message": ...}; the last one is {"done": ...}."""
        wanted = await said(request)
        try:
            command, secret = _command(wanted, self._box)
        except (KeyError, ValueError):
            raise web.HTTPBadRequest(text="This is no change of a sensor.") from None
        if self._stage.facts.get("rehearsal"):
            raise web.HTTPConflict(text=_EMULATED)
        if self._changing.locked():
            raise web.HTTPConflict(text="Another change of a sensor is under way. Wait until it is done.")
        response = web.StreamResponse(headers={"Content-Type": "application/x-ndjson"})
        await response.prepare(request)
        telling: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        running = asyncio.create_task(self._run(command, secret, telling))
        try:
            while True:
                reported = await telling.get()
                await response.write(json.dumps(reported).encode() + b"\n")
                if "done" in reported:
                    break
        except ConnectionError:
            await asyncio.shield(running)  # a wearable is never left half-way because a phone fell asleep
        await response.write_eof()
        return response

    async def _run(self, command: Sequence[str], secret: str, telling: asyncio.Queue[dict[str, Any]]) -> None:
        async with self._changing:
            child = await asyncio.create_subprocess_exec(
                *BUNRAKU,
                *command,
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.STDOUT,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONIOENCODING": "utf-8"},
            )
            assert child.stdin is not None and child.stdout is not None
            child.stdin.write(f"{secret}\n".encode())
            child.stdin.close()
            left = _MOST_BYTES
            try:
                async with asyncio.timeout(_PATIENCE_S):
                    while left > 0 and (line := await child.stdout.readline()):
                        left -= len(line)
                        if message := line.decode(errors="replace").strip().removeprefix("bunraku: "):
                            telling.put_nowait({"message": message})
                    status = await child.wait()
            except (TimeoutError, ValueError):
                child.kill()
                status = await child.wait()
                telling.put_nowait(
                    {"message": "This took too long and was ended. Run it again: that mends it."}
                )
            telling.put_nowait({"done": status == 0})


def _command(wanted: dict[str, Any], box: Sequence[str]) -> tuple[list[str], str]:
    """The command line and the password. Raises KeyError, ValueError."""
    act = wanted["act"]
    options = [*box, "--anyway"] if wanted.get("anyway") is True else box
    if act == "rename":
        return ["sensors", "rename", *options, "--", _text(wanted["name"]), _text(wanted["new"])], ""
    if act == "revoke":
        return ["sensors", "revoke", *options, "--", _text(wanted["name"])], ""
    if act == "replace":
        return ["sensors", "replace", *options, "--", _text(wanted["name"]), _text(wanted["spare"])], ""
    if act != "pair":
        raise ValueError("no such act")
    named = [f"--name={_text(wanted['name'])}"]
    if port := wanted.get("port"):
        if not _text(port).startswith("/dev/") or ".." in port:
            raise ValueError("no serial port")
        named.append(f"--port={port}")
    if not (network := wanted.get("network")):
        return ["provision", *named, *box], ""
    password = wanted.get("password", "")
    named += [f"--network={_text(network)}", "--password-file=-"]
    return ["provision", *named, *box], _text(password) if password else ""


def _text(given: object) -> str:
    if not isinstance(given, str) or not 0 < len(given) <= _LONGEST or not given.isprintable():
        raise ValueError("no text")
    return given
