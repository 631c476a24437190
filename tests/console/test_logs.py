"""The log on the page: records with their priorities, of `bunraku play` and of systemd's journal."""

from __future__ import annotations

import asyncio
import json
import logging
from pathlib import Path
from typing import Any

import pytest

from appliance.box.log import SAID, process_log
from appliance.console import logs
from appliance.console.logs import Logs


def test_what_play_logs_has_its_priorities_each_record_in_one_line(tmp_path: Path) -> None:
    with process_log() as writer:
        writer.keep_in(tmp_path / SAID)
        logger = logging.getLogger("appliance.test")
        logger.info("50.0 Hz  tick 1 ms")
        logger.info("50.0 Hz  tick 2 ms")
        logger.warning("A sensor is silent.\n9 6 is no record of its own.")
    found = asyncio.run(Logs(tmp_path, is_installed=False).lines())
    assert [(one["priority"], one["message"]) for one in found] == [
        (6, "50.0 Hz  tick 2 ms"),
        (4, "A sensor is silent. 9 6 is no record of its own."),
    ]


def test_entries_of_the_journal_have_theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = {"_SYSTEMD_UNIT": "bunraku-stage.service", "__REALTIME_TIMESTAMP": "1000000", "MESSAGE": "x"}

    async def printed(*_: str, **__: Any) -> tuple[int, bytes, bytes]:
        lines = [entry | {"PRIORITY": "4"}, entry, entry | {"PRIORITY": "no"}, entry | {"MESSAGE": [1]}]
        return 0, "\n".join(map(json.dumps, lines)).encode(), b""

    monkeypatch.setattr(logs, "output_of", printed)
    found = asyncio.run(Logs(tmp_path, is_installed=True).lines())
    assert [one["priority"] for one in found] == [4, 6, 6]
    assert found[0] == {"time": 1.0, "unit": "bunraku-stage", "priority": 4, "message": "x"}
