"""What the lights tell of themselves, and the walk that is ordered while the show stands dark."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from appliance.box.live_rig import LARGEST, MOST_BEAMS, NOTHING, LiveRigReader
from appliance.box.orders import Order, OrderInbox, OrderSender
from appliance.levers.show_state import ShowState
from appliance.levers.table import GOING
from appliance.lights.live import EVERY_S, STEP_S, LiveRig, OrderedWalk
from appliance.lights.patch import Patch
from tests.lights.rigs import lights

RIG = [
    {"name": "par", "profile": "led-par", "mode": "RGBW", "address": 1, "place": [-1, 3, 0]},
    {"name": "head", "profile": "moving-wash", "address": 21, "place": [2, 4, 0]},
]
STANDS = ShowState().to(GOING, 0.0)


@pytest.fixture
def patch() -> Patch:
    return Patch(lights(RIG).fixtures, None)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[OrderSender]:
    with contextlib.closing(OrderSender(tmp_path)) as sender:
        yield sender


@pytest.fixture
def walk(patch: Patch, tmp_path: Path) -> Iterator[OrderedWalk]:
    with contextlib.closing(OrderInbox(tmp_path, "lights")) as inbox:
        yield OrderedWalk(inbox, patch, 40.0)


def asked(
    desk: OrderSender, walk: OrderedWalk, state: ShowState, name: str, text: str = ""
) -> tuple[bool, str]:
    assert desk.send("lights", Order(name, text=text, ask=1)) == "sent"
    walk.levels(state, 0.0)
    answer = desk.take()
    assert answer is not None
    return answer.done, answer.message


def test_a_reader_sees_where_each_lamp_points_and_how_bright_it_is(patch: Patch, tmp_path: Path) -> None:
    reader, live = LiveRigReader(tmp_path), LiveRig(tmp_path)
    assert reader.newest() == NOTHING
    values = patch.dimmed(patch.defaults, 1.0)
    values[patch.select(["par"], "dimmer")] = 0.5
    live.publish(patch, values, "", 10.0)
    reported = json.loads(reader.newest())
    name, place, way, _, level, degrees = reported["beams"][0]
    assert (name, place, level, reported["walk"]) == ("par", [-1.0, 3.0, 0.0], 0.5, "")
    assert np.linalg.norm(way) == pytest.approx(1.0, abs=0.01) and 0 < degrees < 90
    assert [one[0] for one in reported["beams"]] == ["par", "head"]
    live.publish(patch, values, "soon", 10.0 + EVERY_S / 2)
    assert json.loads(reader.newest())["walk"] == "", "five times a second"
    for second in (20.0, 30.0):
        live.publish(patch, values, f"{second}", second)
    assert json.loads(reader.newest())["walk"] == "20.0", "and nothing while nobody does"
    live.close()
    assert reader.newest() == NOTHING
    reader.close()


def test_a_rig_of_any_size_fits(tmp_path: Path) -> None:
    fixtures = [
        {
            "name": f"a rather long name {place}",
            "profile": "rgb",
            "universe": 1 + place // 100,
            "address": 1 + 3 * (place % 100),
        }
        for place in range(MOST_BEAMS + 50)
    ]
    patch = Patch(lights(fixtures).fixtures, None)
    reader, live = LiveRigReader(tmp_path), LiveRig(tmp_path)
    assert reader.newest() == NOTHING
    live.publish(patch, patch.defaults, "x" * 200, 1.0)
    assert len(json.loads(reader.newest())["beams"]) == MOST_BEAMS and len(reader.newest()) < LARGEST
    live.close()


def test_a_show_that_is_seen_is_not_walked(desk: OrderSender, walk: OrderedWalk) -> None:
    done, message = asked(desk, walk, ShowState(), "walk")
    assert not done and "Stop it first" in message and walk.values is None
    for state in (replace(STANDS, panic=True), replace(STANDS, blackout=True)):
        assert not asked(desk, walk, state, "walk")[0]


def test_one_lamp_is_walked_and_go_ends_it(desk: OrderSender, walk: OrderedWalk, patch: Patch) -> None:
    done, message = asked(desk, walk, STANDS, "walk", "par")
    assert done and "steps" in message
    seen = {walk.description: None}
    for tick in range(round(STEP_S * 40 * 8)):
        if walk.levels(STANDS, tick / 40) is None:
            break
        seen[walk.description] = None
    assert [message.partition(",")[0] for message in seen if message] == [
        f"par: {one}" for one in ("dimmer", "red", "green", "blue", "white", "strobe")
    ]
    assert walk.levels(STANDS, 100.0) is None, "it ends by itself"
    asked(desk, walk, STANDS, "walk")
    assert walk.levels(STANDS, 100.1) is not None
    assert walk.levels(ShowState(), 100.2) is None
    assert walk.levels(STANDS, 100.3) is None, "it does not begin again"


def test_words_for_what_cannot_be_walked(desk: OrderSender, walk: OrderedWalk) -> None:
    assert asked(desk, walk, STANDS, "walk", "pra") == (
        False,
        "The rig has no fixture 'pra'. Did you mean 'par'?",
    )
    assert not asked(desk, walk, STANDS, "burn")[0]
    asked(desk, walk, STANDS, "walk")
    assert asked(desk, walk, STANDS, "walk/stop")[0] and walk.values is None
