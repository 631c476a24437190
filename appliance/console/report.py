"""Reports to a technician far away, by webhook or mail: the box came on, a fallback lasts, it is over."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

FILE = "console.report"  # in the runtime folder, readable for the box only: addresses and passwords are in it
_PATIENCE_S = 15.0
_LOOK_S = 1.0
_LONGEST = 300  # characters of a sentence
_JUST_S = 300.0  # a stage that started within this time has just come on

Send = Callable[[Mapping[str, Any], Mapping[str, Any]], None]


class Reports:
    """Which changes are due. settings: as `after_s` and `every_s` in the box file; times in Unix seconds.

    A fallback counts by its name and subject. A fallback that is over before it was due is never reported.
    """

    def __init__(self, after_s: float, every_s: float) -> None:
        self._after_s, self._every_s = after_s, every_s
        self._since: dict[tuple[str, str], float] = {}
        self._messages: dict[tuple[str, str], str] = {}
        self._told: set[tuple[str, str]] = set()
        self._is_on = False
        self._lines: list[str] = []
        self._sent_at = -every_s

    def look(self, value: Mapping[str, Any], now: float) -> list[str]:
        """The sentences of the report that is due now; empty: none."""
        status = value.get("status")
        if not self._is_on and status and value.get("frames") == "fresh":
            self._is_on = True
            if status["uptime_s"] < _JUST_S:  # else the page's process was restarted, not the box
                self._lines.append(f"The box is on. Show: {status['show']}.")
        active = {(one["name"], one["about"]): one["message"] for one in _active(value)}
        for key, message in active.items():
            if now - self._since.setdefault(key, now) >= self._after_s and key not in self._told:
                self._told.add(key)
                self._messages[key] = message
                self._lines.append(f"Fallback: {message[:_LONGEST]}")
        for key in self._since.keys() - active.keys():
            del self._since[key]
            if key in self._told:
                self._told.discard(key)
                self._lines.append(f"Over: {self._messages.pop(key)[:_LONGEST]}")
        if not self._lines or now - self._sent_at < self._every_s:
            return []
        self._sent_at = now
        lines, self._lines = self._lines, []
        return lines


async def watch(settings: Mapping[str, Any], value: Callable[[], Mapping[str, Any]], send: Send) -> None:
    """Report until cancelled. A report that does not arrive is logged, and its changes are not told again."""
    reports = Reports(settings["after_s"], settings["every_s"])
    while True:
        await asyncio.sleep(_LOOK_S)
        if lines := reports.look(value(), time.time()):
            told = report(lines, value(), time.time())
            try:
                await asyncio.to_thread(send, settings, told)
            except Exception as error:  # a server far away may answer with anything
                print(f"A report could not be sent ({error}). The show goes on.", flush=True)


def report(lines: Iterable[str], value: Mapping[str, Any], now: float) -> dict[str, Any]:
    """As a webhook gets it."""
    host = socket.gethostname()
    return {
        "text": f"{host}: {' '.join(lines)}",
        "host": host,
        "time": now,
        "fallbacks": [{"name": one["name"], "about": one["about"]} for one in _active(value)],
    }


def send(settings: Mapping[str, Any], told: Mapping[str, Any]) -> None:
    """Send a report, blocking, for 15 s at most each way. Raises OSError and what servers answer."""
    if settings.get("webhook"):
        _post(settings["webhook"], told)
    if settings.get("mail"):
        _mail(settings["mail"], told)


def settings_in(folder: Path) -> dict[str, Any] | None:
    """The settings as the box file has them; None: no reports are wanted."""
    with contextlib.suppress(OSError, ValueError):
        found = json.loads((folder / FILE).read_text())
        return found if isinstance(found, dict) else None
    return None


def _active(value: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [one for one in value.get("fallbacks", ()) if one["active"]]


def _post(address: str, told: Mapping[str, Any]) -> None:
    from urllib.request import Request, urlopen

    headers = {"Content-Type": "application/json", "User-Agent": "bunraku"}
    asked = Request(address, json.dumps(told).encode(), headers)
    with urlopen(asked, timeout=_PATIENCE_S) as answer:
        answer.read(1024)


def _mail(settings: Mapping[str, Any], told: Mapping[str, Any]) -> None:
    import smtplib
    import ssl
    from email.message import EmailMessage

    letter = EmailMessage()
    letter["Subject"] = f"Bunraku {told['host']}"
    letter["From"], letter["To"] = settings["sender"], ", ".join(settings["to"])
    letter.set_content(told["text"].replace(". ", ".\n"))
    context = ssl.create_default_context()
    place = settings["host"], settings["port"]
    if settings["encryption"] == "tls":
        server: smtplib.SMTP = smtplib.SMTP_SSL(*place, timeout=_PATIENCE_S, context=context)
    else:
        server = smtplib.SMTP(*place, timeout=_PATIENCE_S)
    with server:
        if settings["encryption"] == "starttls":
            server.starttls(context=context)
        if settings["user"]:
            server.login(settings["user"], Path(settings["password"]).read_text().strip())
        server.send_message(letter)
