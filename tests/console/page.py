"""The page under test, alone or beside a real box with emulated sensors; and an HTTP client of it."""

from __future__ import annotations

import contextlib
import functools
import http.client
import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from hw_sim.peers import HOST, free_ports
from tests.system.box import Box, playing
from tests.system.processes import BUNRAKU, Process, run_bunraku, wait_until

CUES: list[dict[str, Any]] = [
    {"name": "calm", "look": "lines", "fade_s": 0.1},
    {"name": "storm", "look": "ink", "master": 0.5, "fade_s": 0.1},
]


class Answer(NamedTuple):
    """Of one request."""

    status: int
    text: str
    headers: dict[str, str]

    @property
    def value(self) -> Any:
        return json.loads(self.text)


class Page:
    """Where a page is served, and one device that opens it: `cookie` is what the box remembers it by."""

    def __init__(self, port: int, box_file: Path) -> None:
        self.port, self.box_file, self.cookie = port, box_file, ""

    @property
    def origin(self) -> str:
        return f"http://{HOST}:{self.port}"

    @functools.cached_property
    def pin(self) -> str:
        """As `bunraku console pin` printed it when it was asked first."""
        done = run_bunraku("console", "pin", "--box", self.box_file)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def get(self, path: str, **headers: str) -> Answer:
        return self.request("GET", path, None, headers)

    def post(self, path: str, said: Any, **headers: str) -> Answer:
        """From the page itself, unless the headers name another origin."""
        body = said if isinstance(said, bytes) else json.dumps(said).encode()
        return self.request("POST", path, body, {"Origin": self.origin, **headers})

    def request(self, method: str, path: str, body: bytes | None, headers: dict[str, str]) -> Answer:
        with contextlib.closing(http.client.HTTPConnection(HOST, self.port, timeout=60)) as connection:
            sent = {name.replace("_", "-"): value for name, value in headers.items()}
            if self.cookie:
                sent.setdefault("Cookie", self.cookie)
            connection.request(method, path, body, sent)
            response = connection.getresponse()
            return Answer(response.status, response.read().decode(), dict(response.getheaders()))

    def unlock(self) -> None:
        """Give the PIN, as a device does once."""
        answer = self.post("/api/pin", {"pin": self.pin, "name": "a test"})
        assert answer.status == 200, answer
        self.cookie = answer.headers["Set-Cookie"].partition(";")[0]

    def command(self, address: str, *arguments: object) -> Answer:
        return self.post("/api/command", {"address": address, "arguments": list(arguments)})

    def does(self, address: str, *arguments: object) -> bool:
        """Whether a command was carried out; False too while show control starts."""
        answer = self.command(address, *arguments)
        return answer.status == 200 and bool(answer.value["done"])

    def order(self, address: str, *arguments: object) -> Any:
        """The answer to a command, sent again while the stage or show control is too slow to answer."""

        def answered() -> Any:
            answer = self.command(address, *arguments)
            is_late = answer.status != 200 or "not answer" in answer.value["message"]
            return None if is_late else answer.value

        return wait_until(answered, f"{address} is not answered")

    def status(self) -> dict[str, Any]:
        """What the page tells now."""
        value: dict[str, Any] = self.get("/status").value
        return value

    def is_open(self) -> bool:
        with contextlib.suppress(OSError), socket.create_connection((HOST, self.port), 1.0):
            return self.get("/").status == 200
        return False


@contextlib.contextmanager
def page_alone(
    folder: Path, sensors: dict[str, Any] | None = None, **console: Any
) -> Iterator[tuple[Page, Process]]:
    """`bunraku console` without any stage or show control; sensors: this section of the box file."""
    (port,) = free_ports(1, socket.SOCK_STREAM)
    box_file = folder / "box.yaml"
    whole = {"console": {"port": port, **console}, "control": None, "runtime": "runtime", "state": "state"}
    box_file.write_text(yaml.safe_dump(whole | ({"sensors": sensors} if sensors else {})))
    with Process(folder / "page.txt", [*BUNRAKU, "console", "--box", box_file]) as process:
        page = Page(port, box_file)
        wait_until(lambda: page.is_open() or process.process.poll() is not None, lambda: process.output)
        assert process.process.poll() is None, process.output
        yield page, process


@contextlib.contextmanager
def box_with_page(
    show: Path,
    folder: Path,
    *arguments: str,
    settings: dict[str, Any] | None = None,
    has_sensors: bool = True,
) -> Iterator[tuple[Box, Page]]:
    """A box that dances with its emulated sensors, and its page; `settings`: more of the box file."""
    (port,) = free_ports(1, socket.SOCK_STREAM)
    given = settings or {}
    whole = {**given, "console": {"port": port, **given.get("console", {})}}
    emulated = ("--emulate",) if has_sensors else ()
    with playing(show, folder, *emulated, *arguments, settings=whole) as box:
        page = Page(port, box.box_file)
        wait_until(page.is_open, lambda: box.output)
        wait_until(
            lambda: _is_linked(page) if has_sensors else page.status().get("status"), lambda: box.output
        )
        try:
            yield box, page
        finally:
            box.end()


def _is_linked(page: Page) -> bool:
    return any(sensor["heard"] for sensor in page.status().get("sensors", ()))
