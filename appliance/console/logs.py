"""The last lines of the box's units; on a machine without them, what `bunraku play` said."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from aiohttp import web

from appliance.box.log import INFO_PRIORITY, MOST_SAID, SAID
from appliance.console.child import output_of

_PATIENCE_S = 10.0
_LONGEST = 600  # characters of a line
_MOST = 200  # lines for a browser
_FIGURES = re.compile(r" *[0-9.]+ Hz +tick ")  # the stage's line of each second; its newest is enough
_JOURNALCTL = (
    *("journalctl", "--boot", "--no-pager", f"--lines={MOST_SAID}", "--output=json", "--unit=bunraku*"),
    "--output-fields=_SYSTEMD_UNIT,UNIT,PRIORITY,MESSAGE",
)


class Logs:
    """Requests for records: time (Unix seconds), unit, priority (syslog(3)), message; the newest last."""

    def __init__(self, runtime: Path, is_installed: bool) -> None:
        self._said, self._is_installed = runtime / SAID, is_installed

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/logs", self._lines)]

    async def _lines(self, request: web.Request) -> web.Response:
        return web.json_response((await self.lines())[-_MOST:])

    async def lines(self) -> list[dict[str, Any]]:
        """The last lines, the newest last. Raises 404, 503."""
        lines = await _of_units() if self._is_installed else self._of_play()
        figures = [line for line in lines if _FIGURES.match(line["message"])]
        return [line for line in lines if line in figures[-1:] or not _FIGURES.match(line["message"])]

    def _of_play(self) -> list[dict[str, Any]]:
        try:
            said = self._said.read_text(errors="replace").splitlines()
        except OSError:
            raise web.HTTPNotFound(
                text="Nothing is kept of what `bunraku play` said: is it running?"
            ) from None
        parts = [line.split(" ", 2) for line in said]
        return [_line(float(one[0]), "play", one[1], one[2]) for one in parts if _is_record(one)]


async def _of_units() -> list[dict[str, Any]]:
    """Raises 503 where systemd's journal does not answer."""
    try:
        status, said, troubles = await output_of(*_JOURNALCTL, patience_s=_PATIENCE_S)
    except TimeoutError:
        raise web.HTTPServiceUnavailable(text="Reading the log took too long. Try again.") from None
    except OSError as error:
        raise web.HTTPServiceUnavailable(text=f"journalctl cannot be run ({error.strerror}).") from None
    if status:
        raise web.HTTPServiceUnavailable(
            text=f"The log cannot be read: {troubles.decode(errors='replace')[:300]}"
        )
    return [one for line in said.splitlines() if (one := _of_journal(line))]


def _of_journal(line: bytes) -> dict[str, Any] | None:
    """An entry of journalctl's; None for one that is no text."""
    try:
        entry = json.loads(line)
        unit = str(entry.get("UNIT") or entry["_SYSTEMD_UNIT"])  # UNIT: systemd's messages about a unit
        at, text = int(entry["__REALTIME_TIMESTAMP"]) / 1e6, entry["MESSAGE"]
    except (ValueError, KeyError, TypeError):
        return None
    priority = str(entry.get("PRIORITY", INFO_PRIORITY))
    return _line(at, unit.removesuffix(".service"), priority, text) if isinstance(text, str) else None


def _line(at: float, unit: str, priority: str, text: str) -> dict[str, Any]:
    urgent = int(priority) if priority.isdecimal() else INFO_PRIORITY
    return {"time": at, "unit": unit, "priority": urgent, "message": text[:_LONGEST]}


def _is_record(parts: list[str]) -> bool:
    return len(parts) == 3 and parts[0].replace(".", "", 1).isdecimal() and parts[1].isdecimal()
