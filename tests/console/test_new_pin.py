"""A new PIN shuts out devices, phones that are sensors, and their passes and codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.console.page import Answer, Page, page_alone
from tests.system.processes import run_bunraku, wait_until

pytestmark = pytest.mark.realtime
PHONES = {"foreign": [{"name": "left-wrist", "from": "phone"}, {"name": "right-wrist", "from": "phone"}]}


def test_a_new_pin_voids_devices_passes_codes_and_the_phones_that_are_sensors(tmp_path: Path) -> None:
    with page_alone(tmp_path, sensors=PHONES) as (page, _):
        page.unlock()
        used, waiting = (_code(page, name) for name in ("left-wrist", "right-wrist"))
        by_pin = _join(page, "right-wrist")
        assert by_pin.status == 200, by_pin
        page.cookie = ""
        by_code = _join(page, "left-wrist", code=used)
        assert by_code.status == 200, by_code
        sessions = by_code.value["session"], by_pin.value["session"]
        assert [_is_sensor(page, one) for one in sessions] == [True, True]
        done = run_bunraku("console", "pin", "--new", "--box", page.box_file)
        assert done.returncode == 0 and done.stdout.strip() != page.pin, done
        for session in sessions:
            wait_until(lambda session=session: not _is_sensor(page, session), "it is still a sensor")
        again = {"pass": by_code.value["pass"], "take_over": True}
        assert _join(page, "left-wrist", **again).status == 401
        assert _join(page, "right-wrist", code=waiting, take_over=True).status == 403


def _code(page: Page, name: str) -> str:
    answer = page.post("/api/phones/code", {"name": name})
    assert answer.status == 200, answer
    return str(answer.value["address"].rpartition("=")[2])


def _join(page: Page, name: str, **more: object) -> Answer:
    return page.post("/api/phones/join", {"name": name, "where": "hand", **more})


def _is_sensor(page: Page, session: str) -> bool:
    return page.post("/api/phones/reading", {"session": session, "t": 1}).status == 200
