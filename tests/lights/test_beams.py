"""Beams in colour, level and width; and which of them meet the audience's eyes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.lights import beams as kinds_of
from appliance.lights.beams import HEAD_DEGREES, LAMP, LAMP_DEGREES, ZOOM_DEGREES, Beam, beams_of
from appliance.lights.patch import Patch
from appliance.lights.phrase_run import passes
from appliance.lights.plan import draw_plan
from appliance.lights.rig_sheet import dazzling, meets_eyes
from appliance.pose import quaternion
from appliance.pose.body import Body
from appliance.pose.recording import Recording
from tests.lights.rigs import SKELETON, lights

WASH = {"name": "wash", "profile": "moving-wash", "address": 1, "place": [0, 4, 0]}
SPOT = {"name": "spot", "profile": "moving-spot", "address": 21, "place": [0, 0.3, -2], "pose": "standing"}
PAR = {"name": "par", "profile": "led-par", "mode": "RGBW", "address": 41, "place": [1, 3, 0]}
BARE = {"name": "bare", "profile": "rgb", "address": 61, "place": [2, 3, 0], "turn": [0, 90, 0]}
LEVEL = {"reads": "steady", "drives": "dimmer", "value": 0.4}
ORANGE = {"reads": "steady", "drives": "colour", "colours": [[1, 0.5, 0]]}
WIDE = {"reads": "steady", "drives": "zoom"}
AIM = {"reads": "place", "joint": "hand", "drives": "aim"}


def dance(height: float = 1.0, frames: int = 40) -> Recording:
    """Still for a moment: the hand `height` metres above the hip, which is at 0.5 m."""
    poses = np.tile(quaternion.IDENTITY, (frames, 2, 1))
    skeleton = SKELETON.__class__(SKELETON.names, SKELETON.parents, np.array([[0, 0, 0], [0, height, 0]]))
    return Recording(skeleton, poses, np.tile([0.0, 0.5, 0.0], (frames, 1)), 50.0)


def lit(fixtures: list[dict[str, Any]], *rules: dict[str, Any]) -> dict[str, Beam]:
    config = lights(fixtures, *rules)
    patch, phrase = Patch(config.fixtures, None), dance()
    *_, last = passes(config, patch, phrase, "", 0, len(phrase), 5)
    return {beam.fixture.name: beam for beam in beams_of(patch, last.values)}


@pytest.mark.parametrize("fixture", [WASH, SPOT, PAR, BARE])
def test_a_beam_has_the_colour_and_level_that_rules_give_it(fixture: dict[str, Any]) -> None:
    [beam] = lit([fixture], LEVEL, ORANGE).values()
    np.testing.assert_allclose(beam.colour, [1, 0.5, 0], atol=1e-6)
    assert beam.level == pytest.approx(0.4, abs=1e-6)


def test_a_beam_is_as_wide_as_its_zoom() -> None:
    assert lit([WASH], WIDE)["wash"].degrees == ZOOM_DEGREES[1]
    assert ZOOM_DEGREES[0] < lit([WASH], LEVEL)["wash"].degrees < ZOOM_DEGREES[1]
    assert lit([PAR], LEVEL)["par"].degrees == LAMP_DEGREES != HEAD_DEGREES


def test_heads_point_where_they_aim_and_others_along_their_axis() -> None:
    beams = lit([WASH, PAR, BARE], AIM)
    np.testing.assert_allclose(beams["wash"].direction, [0, -1, 0], atol=1e-2)
    np.testing.assert_allclose(beams["par"].direction, [0, -1, 0], atol=1e-6)
    np.testing.assert_allclose(beams["bare"].direction, [0, 0, -1], atol=1e-6)
    kinds = {name: beam.kind for name, beam in {**beams, **lit([SPOT])}.items()}
    assert kinds == {"wash": kinds_of.WASH, "par": LAMP, "bare": LAMP, "spot": kinds_of.SPOT}


@pytest.mark.parametrize(
    ("place", "direction", "meets"),
    [
        ((0, 1.5, 0), (0, 0, 1), True),  # level, at eye height
        ((0, 1.5, 0), (0, 0, -1), False),  # upstage
        ((0, 4, 0), (0, -1, 0.2), False),  # to the floor of the stage
        ((0, 4, 2), (0, -1, 1), True),  # over the edge, down on the first row
        ((0, 6, 0), (0, -0.1, 1), True),  # over the first row, on the upper ones
        ((0, 0.3, -2), (0, 1, 1), False),  # above all heads
        ((0, 0.1, 0), (0, 0.1, 1), True),  # from the floor, slowly upwards
        ((0, 0.3, 30), (0, 0, -1), False),  # from behind the audience
        ((0, 2.5, 10), (0, 0, 1), True),  # hung in the hall, into the backs' faces
    ],
)
def test_a_beam_meets_eyes_where_people_sit(place: Any, direction: Any, meets: bool) -> None:
    way = np.array([direction]) / np.linalg.norm(direction)
    assert meets_eyes(np.array([place], float), way, 2.5).tolist() == [meets]


def test_a_fixture_that_dazzles_is_named_with_its_mapping_and_a_dark_one_is_not() -> None:
    config = lights([WASH, SPOT], AIM, LEVEL, dark=[AIM, {**LEVEL, "value": 0.0}])
    low = dance(height=0.5)
    [sentence] = dazzling(config, Patch(config.fixtures, None), low)
    assert sentence.startswith("'spot' shines into the audience's eyes in 100 % of the phrase")
    assert "mapping 'first', first at 0.0 s" in sentence
    assert dazzling(config, Patch(config.fixtures, None), dance(height=2.0)) == []


def test_the_picture_changes_with_colour_level_and_width(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pictures = set()
    for rules in ([LEVEL], [LEVEL, ORANGE], [ORANGE], [LEVEL, ORANGE, WIDE]):
        beams = list(lit([WASH, PAR], AIM, *rules).values())
        phrase = dance()
        dancer = Body(SKELETON).cones(np.zeros((2, 3)), np.tile(quaternion.IDENTITY, (2, 1)))
        path = draw_plan(tmp_path / "rig.png", beams, dancer, phrase.roots, "t", "s")
        pictures.add(path.read_bytes())
    assert len(pictures) == 4
