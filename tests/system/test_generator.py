"""The real box, two puppets, motion made ahead: varied, kept, its processes killed, and all danced again."""

from __future__ import annotations

import json
import os
import signal
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from appliance.box.checkpoint import FILE as PLACE
from appliance.outputs.frame_reader import FrameReader
from tests.show_control.doubles import Asker
from tests.sources import write_show_with_sources
from tests.standing import read_checkpoint
from tests.system.box import JOURNAL, Box, cut_power, playing
from tests.system.processes import children_running, run_bunraku, wait_until

pytestmark = pytest.mark.realtime

CUES = [
    {"name": "memory", "phrase": "anna", "fade_s": 0.2},
    {"name": "wild", "phrase": "vary", "motion": {"vary": {"sigma": 2.0}}, "fade_s": 0.5},
]


@pytest.fixture
def show(tmp_path: Path) -> Path:
    puppets = [{"name": "one"}, {"name": "other", "x": 1.6, "phrase": "vary"}]
    return write_show_with_sources(tmp_path / "show", {"kept": ["anna"]}, cues=CUES, puppets=puppets)


def await_made(box: Box, reader: FrameReader, puppet: int = 0, **wanted: Any) -> dict[str, Any]:
    """The recipe of what a puppet dances, once it is as wanted."""

    def danced() -> dict[str, Any] | None:
        reader.newest(time.monotonic())
        puppets = (reader.health() or {}).get("puppets")
        recipe: dict[str, Any] = json.loads(puppets[puppet]["made"] or "{}") if puppets else {}
        return recipe if recipe and all(recipe.get(name) == value for name, value in wanted.items()) else None

    return wait_until(danced, lambda: f"{wanted}\n{box.output}")


def test_varied_kept_killed_and_danced_again(show: Path, tmp_path: Path) -> None:
    settings = JOURNAL | {"state": str(tmp_path / "state")}
    with (
        playing(show, tmp_path, settings=settings) as box,
        closing(Asker(box.control)) as desk,
        closing(FrameReader(box.runtime)) as reader,
    ):
        box.frames(1)
        assert desk.order("/phrase", "vary", 0.2)[2] == 1
        first = await_made(box, reader, source="vary", sigma=1.0)
        await_made(box, reader, source="vary", seed=first["seed"] + 1)  # the next return is danced anew
        answer = desk.order("/motion/keep", "anna")
        assert answer[2] == 1 and "/phrase anna" in answer[3]
        kept = await_made(box, reader, source="vary")
        assert desk.order("/cue", "wild")[2] == 1
        await_made(box, reader, sigma=2.0)
        assert desk.order("/motion/again")[2] == 1
        wild = await_made(box, reader, sigma=2.0)
        wait_until(
            lambda: await_made(box, reader, sigma=2.0)["seed"] >= 1001, lambda: f"{wild}\n{box.output}"
        )

        (generator,) = children_running(box.process.pid, "generate")
        os.kill(generator, signal.SIGKILL)
        box.frames(50)  # the dance goes on
        box.await_output("The generator was killed")
        last = await_made(box, reader, sigma=2.0)
        await_made(box, reader, sigma=2.0, seed=last["seed"] + 1)  # it is back, and goes on where it was
        assert any("generator-died" in answer for answer in desk.ask_all("/fallbacks"))

        assert desk.order("/phrase", "anna", 0.2)[2] == 1
        called = await_made(box, reader, source="kept", name="anna")
        assert called["of"]["source"] == "vary" and called["of"]["sigma"] == 1.0 and kept
        assert desk.order("/motion/path", 0.2, 0.8)[2] == 1
        assert desk.order("/phrase", "path", 0.2)[2] == 1
        await_made(box, reader, source="path", points=[0.2, 0.8])
        assert desk.order("/phrase", "granular", 0.2)[2] == 1
        await_made(box, reader, source="granular")
        assert desk.order("/motion/improvise/temperature", 0.5)[2] == 1
        assert desk.order("/phrase", "improvise", 0.2)[2] == 1
        going_on = await_made(box, reader, source="improvise", temperature=0.5)
        await_made(box, reader, source="improvise", after=going_on["number"], seed=going_on["seed"] + 1)
        other = await_made(box, reader, 1, source="vary")
        box.kill_and_restart()
        box.frames(1)
        reader.newest(time.monotonic())
        assert json.loads((reader.health() or {})["puppets"][0]["made"])["source"] == "improvise", (
            "at once, not after a phrase"
        )
        await_made(box, reader, source="improvise", seed=going_on["seed"] + 3)
        assert await_made(box, reader, 1, source="vary")["seed"] >= other["seed"]
        wait_until(lambda: (tmp_path / "state/kept/anna.material").exists(), "nothing was kept on the disk")
        assert box.end() == 0
    assert "Traceback" not in box.output
    done = run_bunraku("replay", tmp_path / "run.journal")
    assert done.returncode == 0 and "were not:" not in done.stdout, done.stdout + done.stderr

    (another := tmp_path / "another").mkdir()
    with (
        playing(show, another, settings=settings) as box,
        closing(Asker(box.control)) as desk,
        closing(FrameReader(box.runtime)) as reader,
    ):
        box.frames(1)
        assert desk.order("/cue", "memory")[2] == 1
        await_made(box, reader, source="kept", name="anna", of=called["of"])
        assert desk.order("/phrase", "improvise", 0.2)[2] == 1
        assert desk.order("/motion/improvise/temperature", 0.25, 3.0)[2] == 1
        place = tmp_path / "state" / PLACE
        wait_until(
            lambda: (kept := read_checkpoint(place)) and any(0.25 in values for _, values in kept.motion),
            lambda: f"no values are kept: {read_checkpoint(place)}",
        )
        cut_power(box, place)
        box.start()
        await_made(box, reader, source="improvise", temperature=0.25)
        assert "After a power cut the show goes on" in box.output
        assert box.end() == 0
