"""A browser inside the box that gave the page's PIN."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import closing
from http.client import HTTPConnection, HTTPException
from typing import Any, TypeVar

from tests.boot.box import Box
from tests.boot.machine import PATIENCE_S
from tests.system.processes import wait_until

BUNRAKU = "/opt/bunraku/current/bin/bunraku"
PROVE = "bunraku-prove"
MEASURED_WITHIN_S = 240.0  # six seconds, and five starts of a box
ORIGIN = "http://127.0.0.1:8080"
LOOK_S = 0.2

Found = TypeVar("Found")


class Device:
    """What it asks, with its cookie."""

    def __init__(self, box: Box) -> None:
        self._box, self._cookie = box, ""
        box.await_unit("bunraku-console")
        pin = box.machine.run(BUNRAKU, "console", "pin").strip()
        self.await_that(lambda: self._unlocked(pin), "the page takes no PIN")

    def ask(self, path: str, said: Any = None) -> tuple[int, Any]:
        """Status and value; a text where it is no JSON, status 0 where nothing answers."""
        body = None if said is None else json.dumps(said)
        try:
            with closing(HTTPConnection(*ORIGIN.removeprefix("http://").split(":"), timeout=120.0)) as page:
                with self._box.hall.box_network.entered():
                    page.connect()
                headers = {"Origin": ORIGIN, "Cookie": self._cookie}
                page.request("GET" if body is None else "POST", path, body, headers)
                answer = page.getresponse()
                text = answer.read().decode()
        except (OSError, HTTPException) as error:
            return 0, str(error)
        self._cookie = answer.getheader("Set-Cookie", "").partition(";")[0] or self._cookie
        try:
            return answer.status, json.loads(text)
        except ValueError:
            return answer.status, text

    def await_that(
        self, find: Callable[[], Found | None], else_say: str, patience_s: float = PATIENCE_S
    ) -> Found:
        """The first true thing that `find` gives; the page has other things to do than to answer."""
        machine = self._box.machine
        return wait_until(
            find, lambda: f"{else_say}\n{machine.log()}", lambda: time.sleep(LOOK_S), patience_s
        )

    def proven(self, kind: str) -> dict[str, Any]:
        """What is kept once it is proven."""
        machine = self._box.machine
        self.await_that(
            lambda: self.ask("/api/prove")[1]["runs"] is None, "the proof has no end", MEASURED_WITHIN_S
        )
        status, newest = self.ask("/api/prove")
        reported = machine.run("cat", "/run/bunraku/prove/progress")
        assert status == 200 and newest["proofs"] and newest["proofs"][0]["kind"] == kind, (
            f"{reported}\n{machine.log(PROVE)}"
        )
        document: dict[str, Any] = self.ask(f"/api/prove/{newest['proofs'][0]['id']}")[1]
        return document

    def _unlocked(self, pin: str) -> bool:
        return self.ask("/api/pin", {"pin": pin, "name": "a test"})[0] == 200
