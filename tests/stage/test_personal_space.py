"""Personal space: puppets give way to each other without a jolt, and go back to their own ways."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.recorder.journal_reader import read_journal
from tests.bundles import write_show
from tests.recorder.night import Night
from tests.stage.test_replay import danced

PAIR: list[dict[str, Any]] = [{"name": "a", "x": 0.0}, {"name": "b", "x": 0.2, "turned": 90}]


def night_of(folder: Path, **keys: Any) -> Night:
    puppets = json.loads(json.dumps([one | keys for one in PAIR]))
    return Night(write_show(folder / "show", puppets=puppets), folder / "run")


def ways(night: Night, ticks: int) -> np.ndarray[Any, Any]:
    """Roots (T, 2, 2) on the stage, metres."""
    found = []
    for _ in range(ticks):
        night.dance(1)
        found.append([one.frame.root[[0, 2]].copy() for one in night.parts.puppets])
    return np.array(found)


@pytest.mark.parametrize("space", [0.2, 0.4])
def test_puppets_that_start_inside_each_other_come_apart_without_a_jolt(tmp_path: Path, space: float) -> None:
    roots = ways(night_of(tmp_path, space=space), 400)
    apart = np.linalg.norm(roots[:, 0] - roots[:, 1], axis=-1)
    assert apart[0] < 0.25 and apart[-200:].min() > 2 * space
    speeds = np.diff(roots, axis=0) * 50
    assert np.linalg.norm(speeds, axis=-1).max() < 1.2 and np.abs(np.diff(speeds, axis=0)).max() < 0.1
    moved = roots[-1] - roots[0]
    assert moved[0, 0] < -0.05 and moved[1, 0] > 0.05, "both give way, each to its own side"


def test_without_space_they_dance_through_each_other(tmp_path: Path) -> None:
    night = night_of(tmp_path, space=0.0)
    assert night.parts.space is None
    roots = ways(night, 200)
    assert np.linalg.norm(roots[:, 0] - roots[:, 1], axis=-1).min() < 0.25


def test_the_one_that_has_no_space_is_not_kept_away(tmp_path: Path) -> None:
    puppets = [PAIR[0] | {"space": 0.5}, PAIR[1] | {"space": 0.0}]
    night = Night(write_show(tmp_path / "show", puppets=puppets), tmp_path / "run")
    assert night.parts.space is None


def test_a_journal_of_puppets_that_give_way_dances_again_bit_for_bit(tmp_path: Path) -> None:
    night = night_of(tmp_path, space=0.4)
    night.dance(700)
    run = read_journal(night.saved(tmp_path / "kept")).runs[0]
    for from_s in (0.0, 11.0):
        assert danced(run, tmp_path / "show", from_s)[1].first is None
