"""Reports to a technician far away, by webhook or mail: the box came on, a fallback lasts, it is over."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from appliance.box.fallback import Fallbacks
from appliance.console.fallback import UNSENT, note_unsent

FILE = "console.report"  # in the runtime folder, readable for the box only: addresses and passwords are in it
_PATIENCE_S = 15.0
_LOOK_S = 1.0
_LONGEST = 300  # characters of a sentence
_JUST_S = 300.0  # a stage that started within this time has just come on

_MOST_LINES = 40  # that wait while reports do not arrive
_RETRY_S, _LONGEST_RETRY_S = 5.0, 300.0

Send = Callable[[Mapping[str, Any]], None]


class Reports:
    """Which changes are due. settings: as `after_s` and `every_s` in the box file; times: monotonic seconds.

    A fallback counts by its name and subject. A fallback that is over before it was due is never reported.
    """

    def __init__(self, after_s: float, every_s: float) -> None:
        self._after_s, self._every_s = after_s, every_s
        self._since: dict[tuple[str, str], float] = {}
        self._messages: dict[tuple[str, str], str] = {}
        self._reported: set[tuple[str, str]] = set()
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
            if now - self._since.setdefault(key, now) >= self._after_s and key not in self._reported:
                self._reported.add(key)
                self._messages[key] = message
                self._lines.append(f"Fallback: {message[:_LONGEST]}")
        for key in self._since.keys() - active.keys():
            del self._since[key]
            if key in self._reported:
                self._reported.discard(key)
                self._lines.append(f"Over: {self._messages.pop(key)[:_LONGEST]}")
        if not self._lines or now - self._sent_at < self._every_s:
            return []
        self._sent_at = now
        lines, self._lines = self._lines, []
        return lines


class Post:
    """One way of reports, with those that have not arrived yet: tried again ever later.

    name: in the box file, "webhook" or "mail". trouble: why the last one did not arrive, else "".
    """

    def __init__(self, name: str, send: Send) -> None:
        self.name, self.trouble = name, ""
        self._send = send
        self._lines: list[str] = []
        self._tries, self._next_at = 0, 0.0

    def add(self, lines: Iterable[str]) -> None:
        """More to tell; of very many the newest."""
        self._lines = [*self._lines, *lines][-_MOST_LINES:]

    async def look(self, value: Mapping[str, Any], now: float) -> None:
        """Send what waits, if it is time to; monotonic seconds."""
        if not self._lines or now < self._next_at:
            return
        reported = report(self._lines, value, time.time())
        try:
            await asyncio.to_thread(self._send, reported)
        except Exception as error:  # a server far away may answer with anything
            if not self.trouble:
                print(f"A report by {self.name} could not be sent ({error}). It is tried again.", flush=True)
            self.trouble = str(error) or type(error).__name__
            self._next_at = now + min(_RETRY_S * 2.0**self._tries, _LONGEST_RETRY_S)
            self._tries = min(self._tries + 1, 30)
            return
        self.trouble, self._tries, self._lines = "", 0, []


async def watch(
    settings: Mapping[str, Any], value: Callable[[], Mapping[str, Any]], fallbacks: Fallbacks
) -> None:
    """Report until cancelled. A report that does not arrive is a fallback, and is tried again."""
    reports, posts = Reports(settings["after_s"], settings["every_s"]), posts_of(settings)
    while True:
        await asyncio.sleep(_LOOK_S)
        lines = reports.look(value(), time.monotonic())
        for post in posts:
            post.add(lines)
            await post.look(value(), time.monotonic())
        note_unsent(fallbacks, [post.name for post in posts if post.trouble])


def report(lines: Iterable[str], value: Mapping[str, Any], now: float) -> dict[str, Any]:
    """As a webhook gets it."""
    host = socket.gethostname()
    return {
        "text": f"{host}: {' '.join(lines)}",
        "host": host,
        "time": now,
        "fallbacks": [{"name": one["name"], "about": one["about"]} for one in _active(value)],
    }


def posts_of(settings: Mapping[str, Any]) -> list[Post]:
    """The ways that the box file has; each blocks for 15 s at most, and raises OSError and what servers
    answer."""
    ways: dict[str, Callable[[Any, Mapping[str, Any]], None]] = {"webhook": _post, "mail": _mail}
    return [Post(name, partial(way, settings[name])) for name, way in ways.items() if settings.get(name)]


def settings_in(folder: Path) -> dict[str, Any] | None:
    """The settings as the box file has them; None: no reports are wanted."""
    with contextlib.suppress(OSError, ValueError):
        found = json.loads((folder / FILE).read_text())
        return found if isinstance(found, dict) else None
    return None


def _active(value: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Without the one of these reports themselves: who reads one has got it."""
    return [one for one in value.get("fallbacks", ()) if one["active"] and one["name"] != UNSENT.name]


def _post(address: str, reported: Mapping[str, Any]) -> None:
    from urllib.request import Request, urlopen

    headers = {"Content-Type": "application/json", "User-Agent": "bunraku"}
    asked = Request(address, json.dumps(reported).encode(), headers)
    with urlopen(asked, timeout=_PATIENCE_S) as answer:
        answer.read(1024)


def _mail(settings: Mapping[str, Any], reported: Mapping[str, Any]) -> None:
    import smtplib
    import ssl
    from email.message import EmailMessage

    letter = EmailMessage()
    letter["Subject"] = f"Bunraku {reported['host']}"
    letter["From"], letter["To"] = settings["sender"], ", ".join(settings["to"])
    letter.set_content(reported["text"].replace(". ", ".\n"))
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
