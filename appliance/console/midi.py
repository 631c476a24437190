"""MIDI bindings on the page: which control gives which command, learned by moving it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.console.body import said
from appliance.console.box_view import BoxView
from appliance.console.stage_view import StageView
from appliance.levers.addresses import ADDRESSES, THE_SHOW, Address
from appliance.show_control.midi_bindings import Binding, MidiBindings, checked, range_of

_ELSEWHERE = "No process hears MIDI on this box. Add `midi: {}` to its box file."
_FULL = "The binding cannot be saved ({reason}). What was bound before still is."


class Midi:
    """The bindings of the process that hears MIDI; its report has their folder."""

    def __init__(self, stage: StageView, box: BoxView) -> None:
        self._stage, self._box = stage, box

    def routes(self) -> list[web.RouteDef]:
        return [
            web.get("/api/midi", self._list),
            web.post("/api/midi/bind", self._bind),
            web.post("/api/midi/remove", self._remove),
        ]

    async def _list(self, request: web.Request) -> web.Response:
        bindings = [one._asdict() for one in self._bindings().all]
        return web.json_response({"bindings": bindings, "targets": list(self._targets())})

    async def _bind(self, request: web.Request) -> web.Response:
        return await self._change(request, MidiBindings.bind)

    async def _remove(self, request: web.Request) -> web.Response:
        return await self._change(request, MidiBindings.remove)

    async def _change(self, request: web.Request, change: Any) -> web.Response:
        try:
            one: Binding = checked(await said(request))
            change(self._bindings(), one)
        except ValueError as error:
            raise web.HTTPBadRequest(text=str(error)) from None
        except OSError as error:
            raise web.HTTPInsufficientStorage(text=_FULL.format(reason=error.strerror)) from None
        return await self._list(request)

    def _bindings(self) -> MidiBindings:
        folder = self._box.value.get("remote", {}).get("bindings")
        if not folder:
            raise web.HTTPNotFound(text=_ELSEWHERE)
        return MidiBindings(Path(folder))

    def _targets(self) -> Iterator[dict[str, Any]]:
        """Commands that a control may have: those of the show, and levers that take one number or name."""
        of_show = {one.address for one in THE_SHOW}
        for address, one in ADDRESSES.items():
            if address not in of_show and one.lever is None:
                continue
            names = self._names(one)
            if names is None:
                continue
            with contextlib.suppress(ValueError):
                bounds = range_of(address)
                yield {
                    "address": address,
                    "names": names,
                    "least": None if bounds is None else bounds.least,
                    "most": None if bounds is None else bounds.most,
                }

    def _names(self, one: Address) -> list[str] | None:
        """The names that it may be about; []: it takes none; None: the show has none of these."""
        if not one.form.text:
            return []
        facts: Any = self._stage.seen_facts
        if facts is None:
            return None
        if one.address == "/cue":
            return ["", *(str(cue["name"]) for cue in facts.cues)]
        found = getattr(facts, one.lever.names[0], ()) if one.lever and one.lever.names[0] else ()
        return [str(name) for name in found] or None
