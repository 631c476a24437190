"""Codes by which a phone becomes a sensor: how long one is valid, whatever the clock does."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from appliance.box.door import Door
from appliance.box.fallback import Fallbacks
from appliance.cli.phones import invitation
from appliance.console.fallback import OF_THE_PAGE
from appliance.console.guard import Guard
from appliance.console.join_codes import VALID_S, JoinCodes
from appliance.console.phones import Phones


def test_a_code_of_a_machine_that_was_off_meanwhile_is_not_valid(tmp_path: Path) -> None:
    """Its monotonic clock begins anew; a folder on the disk outlives it."""
    codes = JoinCodes(tmp_path)
    codes.set_names(["left-wrist"])
    code = codes.new_code("left-wrist", 5000.0)
    for now in (10.0, 4900.0, 5001.0 + VALID_S):
        assert not codes.use("left-wrist", code, now), now
    assert codes.use("left-wrist", code, 5000.0 + VALID_S)


def test_a_clock_that_is_set_after_power_on_voids_no_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    guard = cast(Guard, SimpleNamespace(device=lambda request: None, remembers=lambda device: False))
    phones = Phones(guard, Door(lambda crowd: None), ["left-wrist"], tmp_path, Fallbacks(OF_THE_PAGE))
    said = next(invitation(JoinCodes(tmp_path), "https://box", "left-wrist", False))
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + 86400.0)

    async def main() -> None:
        app = web.Application()
        app.add_routes(phones.routes())
        async with TestClient(TestServer(app)) as client:
            joining = {"name": "left-wrist", "where": "hand", "code": said.rpartition("=")[2]}
            async with client.post("/api/phones/join", json=joining) as answer:
                assert answer.status == 200, await answer.text()

    asyncio.run(main())
    phones.close()
