"""Requests about learning that come twice, too late, or with odd names."""

from __future__ import annotations

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from appliance.console.learn import Learn
from appliance.console.learning import FOLDER, RECORDINGS, Learning, Wanted
from appliance.console.stage_view import StageView
from appliance.pose.bvh import write_bvh
from tests.bundles import swaying_phrase


def post(state: Path, path: str, **sent: Any) -> tuple[int, str]:
    """Status and text of the answer to a page of an installed box."""

    async def main() -> tuple[int, str]:
        stage = cast(StageView, SimpleNamespace(show_directory=None))
        app = web.Application()
        app.add_routes(Learn(state, None, {}, True, stage).routes())
        async with TestClient(TestServer(app)) as client, client.post(path, **sent) as answer:
            return answer.status, await answer.text()

    return asyncio.run(main())


def test_a_second_touch_on_end_does_not_undo_what_was_learned(tmp_path: Path) -> None:
    """Another phone still shows the button while the learner has just reached its end."""
    learning = Learning(tmp_path / FOLDER)
    assert post(tmp_path, "/api/learn/end")[0] == 200, "nothing was ever learned here"
    learning.want(Wanted("solo"))
    assert post(tmp_path, "/api/learn/end")[0] == 200
    assert learning.wanted() is None and learning.reported() == {"state": "ended"}
    learning.report(state="learned")
    assert post(tmp_path, "/api/learn/end")[0] == 200
    assert learning.reported() == {"state": "learned"} and learning.playable() == learning.show


def test_a_rehearsal_that_is_still_written_is_not_offered(tmp_path: Path) -> None:
    for name in ("mine", ".rehearsal-2026-11-28-040500.part"):
        (tmp_path / RECORDINGS / name).mkdir(parents=True)
        write_bvh(tmp_path / RECORDINGS / name / "sway.bvh", swaying_phrase())
    learn = Learn(tmp_path, None, {}, True, cast(StageView, None))
    assert [one["name"] for one in learn._listed()] == ["box/mine"]
    assert learn._folder("box/mine") is not None
    assert learn._folder("box/.rehearsal-2026-11-28-040500.part") is None


def test_a_name_that_no_disk_takes_is_refused_with_the_reason(tmp_path: Path) -> None:
    name = "\u821e" * 96 + ".bvh"  # 288 bytes
    status, text = post(tmp_path, "/api/learn/recording", params={"name": name}, data=b"HIERARCHY")
    assert (status, text) == (503, "It cannot be kept (File name too long).")
