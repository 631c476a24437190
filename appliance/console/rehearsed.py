"""Keep this as a cue: the present settings go into a copy of the show, which can be downloaded."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.console.body import said
from appliance.console.box_view import BoxView
from appliance.console.child import answer_of
from appliance.console.stage_view import StageView
from appliance.levers.sources import MADE

_PATIENCE_S = 120.0
_LONGEST_NAME = 64
FOLDER, ZIP = "rehearsed", "show.zip"


class Rehearsed:
    """kept: the folder in which the page keeps things."""

    def __init__(self, stage: StageView, box: BoxView, state: Path) -> None:
        self._stage, self._box = stage, box
        self._folder = state / FOLDER
        self._writing = asyncio.Lock()

    def routes(self) -> list[web.RouteDef]:
        return [web.post("/api/cue", self.keep), web.get("/api/cue/show.zip", self.download)]

    async def keep(self, request: web.Request) -> web.Response:
        """Write a cue. Raises 404 with the message of the show where it refuses it."""
        name = (await said(request)).get("name")
        if not isinstance(name, str) or not 0 < len(name.strip()) <= _LONGEST_NAME or not name.isprintable():
            raise web.HTTPBadRequest(text="A cue needs a name, of 64 letters at most.")
        show = self._stage.show_directory
        if show is None or self._box.value.get("status") is None:
            raise web.HTTPConflict(text="No stage dances on this box: there are no settings to keep.")
        cue = present_cue(name.strip(), self._box.value, self._stage.facts)
        async with self._writing:
            places = {"show": str(show), "into": str(self._folder)}
            message = await answer_of("keep_cue", _PATIENCE_S, cue=cue, **places)
        return web.json_response({"message": json.loads(message)})

    async def download(self, request: web.Request) -> web.StreamResponse:
        """The copy, packed in the layout of a stick."""
        if not (self._folder / ZIP).is_file():
            raise web.HTTPNotFound(text="No cue was kept yet.")
        headers = {"Content-Disposition": 'attachment; filename="bunraku-show.zip"'}
        return web.FileResponse(self._folder / ZIP, headers=headers)


def present_cue(name: str, value: dict[str, Any], facts: dict[str, Any]) -> dict[str, Any]:
    """The settings in force, as show.yaml writes a cue. value: of BoxView; facts: of the stage."""
    status, phrase = value["status"], value["status"]["phrase"]
    cue: dict[str, Any] = {"name": name, "phrase": phrase}
    section = facts.get("motion", {}).get(phrase)
    if phrase in MADE and section is not None:
        declared = {key: given[0] for key, given in value["motion"].items() if given}
        parameters = {
            key: declared.get(f"{phrase} {key}", number)
            for key, number in section.items()
            if isinstance(number, int | float)
        }
        whole = {key: int(number) if key == "seed" else number for key, number in parameters.items()}
        cue["motion"] = {phrase: whole}
    cue["iterations"] = [status["coding"], status["interaction"]]
    if status["seed"] >= 0:
        cue |= {"liveliness": round(status["liveliness"], 3), "seed": status["seed"]}
    cue["hands"] = [one["joint"] for one in value["hands"] if one["holds"]]
    cue |= {key: status[key] for key in ("look", "lights") if status[key]}
    return cue
