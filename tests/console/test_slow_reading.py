"""What is read slowly: a file by a browser far away, a stick that is dying."""

from __future__ import annotations

import asyncio
import os
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from appliance.box.parent_death import PARENT
from appliance.console import child
from appliance.console import help as help_requests
from appliance.console import update as update_requests
from appliance.console.box_view import BoxView
from appliance.console.help import Help
from appliance.console.logs import Logs
from appliance.console.update import Update

SIZE = 8 << 20  # bytes; more than waits in sockets


def test_a_help_file_that_is_fetched_is_not_replaced_under_the_browser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    letters = iter(b"ab")

    async def made(function: str, patience_s: float, out: str, **_: Any) -> bytes:
        Path(out).write_bytes(bytes([next(letters)]) * SIZE)
        return b"{}"

    monkeypatch.setattr(help_requests, "answer_of", made)

    async def main() -> None:
        view = cast(BoxView, SimpleNamespace(text="{}"))
        app = web.Application()
        app.add_routes(Help(view, Logs(tmp_path, False), tmp_path, None, {}).routes())
        async with TestClient(TestServer(app)) as client:
            await client.post("/api/help", json={})
            async with client.get("/api/help.zip") as far_away:
                first = await far_away.content.readexactly(1)
                async with client.post("/api/help", json={}) as answer:
                    assert answer.status == 200
                assert first + await far_away.content.read() == b"a" * SIZE
            async with client.get("/api/help.zip") as near:
                assert (await near.read())[:1] == b"b"

    asyncio.run(main())
    assert [one.name for one in tmp_path.iterdir()] == ["help.zip"]


def test_a_stick_that_is_dying_does_not_hold_up_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The watchdog would end the page's process after five seconds."""
    (tmp_path / "keys").touch()
    answers, was_free = threading.Event(), []

    def names(folder: Path) -> list[str]:
        was_free.append(answers.wait(10.0))
        return []

    monkeypatch.setattr(update_requests, "_names", names)

    async def main() -> None:
        app = web.Application()
        app.add_routes(Update(tmp_path, True, lambda: False, tmp_path / "stick", tmp_path / "keys").routes())
        async with TestClient(TestServer(app)) as client:
            asking = asyncio.create_task(client.post("/api/update/stick", json={"name": "x"}))
            await asyncio.sleep(0.3)
            answers.set()
            assert (await asking).status == 404

    asyncio.run(main())
    assert was_free == [True], "the page stood still until the stick answered"


def test_what_reads_for_the_page_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[dict[str, str]] = []

    async def noted(*command: str, env: dict[str, str], **_: Any) -> tuple[int, bytes, bytes]:
        started.append(env)
        return 0, b"{}", b""

    monkeypatch.setattr(child, "output_of", noted)
    asyncio.run(child.answer_of("about", 1.0))
    assert started[0][PARENT] == str(os.getpid())
