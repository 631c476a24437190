"""Updates from the page: what is taken and from whom; nothing is installed without the wall's code."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from appliance.console import body
from appliance.console.guard import Handler, needs_device
from appliance.console.update import FOLDER, TRIES, WANTED, Update
from appliance.console.update_code import CODE_FILE, pending_code

DEB = "bunraku_0.3.0_arm64.deb"


class Hall:
    """A box in a folder: its stick, its maker's keys, whether its show goes, whether the device is known."""

    def __init__(self, folder: Path) -> None:
        self.runtime, self.stick, self.keys = folder / "run", folder / "stick", folder / "keys"
        self.runtime.mkdir()
        self.stick.mkdir()
        self.keys.write_text("a key")
        self.show_goes = False
        self.is_known = self.is_installed = True

    @web.middleware
    async def check(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if needs_device(request) and not self.is_known:
            raise web.HTTPUnauthorized
        return await handler(request)

    @property
    def wants(self) -> bool:
        return (self.runtime / FOLDER / WANTED).exists()

    def files(self) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in (self.runtime / FOLDER).iterdir()}

    def run(self, act: Callable[[TestClient[Any, Any]], Awaitable[None]]) -> None:
        async def main() -> None:
            update = Update(self.runtime, self.is_installed, lambda: self.show_goes, self.stick, self.keys)
            app = web.Application(middlewares=[self.check])
            app.add_routes(update.routes())
            async with TestClient(TestServer(app)) as client:
                await act(client)

        asyncio.run(main())


@pytest.fixture
def hall(tmp_path: Path) -> Hall:
    return Hall(tmp_path)


async def status(client: TestClient[Any, Any], path: str, **said: Any) -> int:
    async with client.post(f"/api/update/{path}", json=said) as answer:
        return answer.status


async def send(
    client: TestClient[Any, Any], name: str, content: bytes | AsyncIterator[bytes] = b"package"
) -> int:
    async with client.post("/api/update/file", params={"name": name}, data=content) as answer:
        return answer.status


def test_files_arrive_and_the_code_on_the_wall_installs_them(hall: Hall) -> None:
    async def act(client: TestClient[Any, Any]) -> None:
        assert await status(client, "begin") == 409, "nothing is here"
        assert await send(client, DEB) == 200
        assert await status(client, "begin") == 409, "its signature is not here"
        assert await send(client, f"{DEB}.sig", b"signature") == 200
        assert hall.files() == {DEB: b"package", f"{DEB}.sig": b"signature"}
        assert await status(client, "confirm", code="") == 410, "no code was made"
        assert await status(client, "begin") == 200
        code = pending_code(hall.runtime)
        assert len(code) == 14 and (hall.runtime / CODE_FILE).stat().st_mode & 0o077 == 0
        assert await status(client, "confirm", code="aaaa-bbbb-cccc") == 403
        assert not hall.wants
        assert await status(client, "confirm", code=code.upper().replace("-", " ")) == 200
        assert hall.wants and not pending_code(hall.runtime)
        assert await send(client, DEB, b"another") == 409, "not while it is installed"

    hall.run(act)


def test_a_code_is_over_after_a_few_wrong_ones(hall: Hall) -> None:
    async def act(client: TestClient[Any, Any]) -> None:
        await send(client, DEB)
        await send(client, f"{DEB}.sig")
        await status(client, "begin")
        code = pending_code(hall.runtime)
        for _ in range(TRIES):
            assert await status(client, "confirm", code="no") == 403
        assert await status(client, "confirm", code=code) == 410
        assert not hall.wants

    hall.run(act)


def test_nothing_is_installed_under_a_show(hall: Hall) -> None:
    async def act(client: TestClient[Any, Any]) -> None:
        await send(client, DEB)
        await send(client, f"{DEB}.sig")
        hall.show_goes = True
        assert await status(client, "begin") == 409
        hall.show_goes = False
        assert await status(client, "begin") == 200
        hall.show_goes = True
        assert await status(client, "confirm", code=pending_code(hall.runtime)) == 409
        assert not hall.wants

    hall.run(act)


@pytest.mark.parametrize(
    "name", ["../x.deb", "bunraku_1_arm64.deb/../y", "other_1_arm64.deb", "", f"{DEB}.exe"]
)
def test_other_files_are_refused(hall: Hall, name: str) -> None:
    async def act(client: TestClient[Any, Any]) -> None:
        assert await send(client, name) == 400
        assert not (hall.runtime / FOLDER).exists()

    hall.run(act)


def test_a_phone_that_leaves_the_network_in_mid_upload_holds_up_the_next_one_shortly(
    hall: Hall, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(body, "SILENT_S", 0.3)

    async def act(client: TestClient[Any, Any]) -> None:
        _, gone = await asyncio.open_connection(client.host, client.port)
        head = f"POST /api/update/file?name={DEB} HTTP/1.1\r\nHost: box\r\nContent-Length: 1000\r\n\r\n"
        gone.write(head.encode() + b"some of it")
        await gone.drain()
        while not (hall.runtime / FOLDER / DEB).exists():
            await asyncio.sleep(0.01)
        begun = time.monotonic()
        while (taken := await send(client, DEB)) == 409 and time.monotonic() - begun < 10.0:
            await asyncio.sleep(0.05)
        assert taken == 200 and hall.files() == {DEB: b"package"}
        gone.close()

    hall.run(act)


def test_a_slow_sender_is_waited_for(hall: Hall, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(body, "SILENT_S", 0.5)

    async def slowly() -> AsyncIterator[bytes]:
        for letter in b"package":
            yield bytes([letter])
            await asyncio.sleep(0.15)

    async def act(client: TestClient[Any, Any]) -> None:
        assert await send(client, DEB, slowly()) == 200
        assert hall.files() == {DEB: b"package"}

    hall.run(act)


def test_an_update_comes_from_the_stick_and_no_link_is_followed(hall: Hall) -> None:
    (hall.stick / DEB).write_bytes(b"package")
    (hall.stick / f"{DEB}.sig").write_bytes(b"signature")
    link = "bunraku_0.4.0_arm64.deb"
    (hall.stick / link).symlink_to("/etc/shadow")
    (hall.stick / f"{link}.sig").write_bytes(b"signature")

    async def act(client: TestClient[Any, Any]) -> None:
        async with client.get("/api/update") as answer:
            assert (await answer.json())["stick"] == [DEB, link]
        assert await status(client, "stick", name="../keys") == 404
        assert await status(client, "stick", name=link) == 503
        assert await status(client, "stick", name=DEB) == 200
        assert hall.files() == {DEB: b"package", f"{DEB}.sig": b"signature"}

    hall.run(act)


@pytest.mark.parametrize("lack", ["is_known", "is_installed", "keys"])
def test_a_stranger_and_a_box_without_keys_get_nothing(hall: Hall, lack: str) -> None:
    if lack == "keys":
        hall.keys.unlink()
    else:
        setattr(hall, lack, False)

    async def act(client: TestClient[Any, Any]) -> None:
        assert await send(client, DEB) == (401 if lack == "is_known" else 409)
        for path in ("stick", "begin", "confirm"):
            assert await status(client, path) in (401, 409)
        assert not (hall.runtime / FOLDER).exists()

    hall.run(act)
