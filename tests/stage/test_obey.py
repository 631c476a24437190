"""Commands change the dance between two ticks, within what fits the budget."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from appliance.pose import quaternion
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import load_show
from appliance.stage.cast import Cast, Iterations, assemble
from appliance.stage.control import Command
from appliance.stage.obey import obey
from tests.stage.bundles import write_show


@pytest.fixture
def cast(tmp_path: Path) -> Iterator[Cast]:
    show = load_show(write_show(tmp_path / "show", [{"osc": True, "joint": "lShldr"}]))
    cast = assemble(show, BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[])))
    yield cast
    cast.close()


@pytest.mark.parametrize(
    ("asked", "danced"),
    [((5, 4), (5, 4)), ((12, 11), (8, 7)), ((12, 2), (8, 0)), ((3, 3), (3, 3)), ((0, 0), (1, 0))],
)
def test_iterations_change_within_what_fits(
    cast: Cast, asked: tuple[int, int], danced: tuple[int, int]
) -> None:
    iterations = Iterations(3, 2, most=8)
    complaint = obey(Command("iterations", tuple(map(float, asked))), cast, iterations, 1.0)
    assert (iterations.coding, iterations.interaction) == danced
    assert bool(complaint) == (asked != danced)


def test_playback_stops_starts_jumps_and_plays_excerpts(cast: Cast) -> None:
    iterations = Iterations(3, 2, 8)
    obey(Command("stop"), cast, iterations, 0.5)
    assert cast.motion.rate == 0.0
    obey(Command("start"), cast, iterations, 0.5)
    assert cast.motion.rate == 0.5
    obey(Command("rate", (-2.0,)), cast, iterations, 0.5)
    assert cast.motion.rate == -2.0
    assert obey(Command("jump", (1.5,)), cast, iterations, 0.5) == ""
    cast.motion.advance()
    assert cast.motion.jumped
    assert "from 2 s to 2.04 s" in obey(Command("excerpt", (2.0, 2.04)), cast, iterations, 0.5)


def test_a_joint_is_held_and_released_by_osc(cast: Cast) -> None:
    iterations = Iterations(3, 2, 8)
    assert obey(Command("hold", (1.0, 0.0, 0.0, np.pi / 2), "lShldr"), cast, iterations, 1.0) == ""
    for tick in range(100):
        cast.hands.pull(10.0 + 0.02 * tick)
    place = cast.hand_places[0]
    assert quaternion.angle_between(cast.hands.targets[place], np.array([0.5**0.5, 0.5**0.5, 0, 0])) < 1e-3
    assert cast.hands.weights[place] == 1.0
    assert obey(Command("release", (), 2), cast, iterations, 1.0) == ""  # the same joint by its number
    for tick in range(100):
        cast.hands.pull(12.0 + 0.02 * tick)
    assert cast.hands.weights[place] == 0.0


def test_a_joint_that_no_hand_holds_by_osc_is_refused_in_words(cast: Cast) -> None:
    iterations = Iterations(3, 2, 8)
    assert "No hand of this show holds 'Chest'" in obey(
        Command("hold", (1.0, 0.0, 0.0, 1.0), "Chest"), cast, iterations, 1.0
    )
    assert "no joint 99" in obey(Command("release", (), 99), cast, iterations, 1.0)
    assert "no rotation" in obey(Command("hold", (0.0, 0.0, 0.0, 1.0), "lShldr"), cast, iterations, 1.0)
