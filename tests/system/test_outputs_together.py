"""All outputs of one box at once, for some seconds: no frame misses a receiver, lamps follow the dance."""

from __future__ import annotations

from typing import Any

import pytest

from tests.system import venue
from tests.system.outputs_run import faults, measure, table

SECONDS, LONG_SECONDS = 8.0, 60.0
PICTURE = "128x72"  # so that software rendering leaves time for the others

pytestmark = pytest.mark.skipif(venue.why_not() is not None, reason=str(venue.why_not()))


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory, long_run: bool) -> dict[str, Any]:
    return measure(LONG_SECONDS if long_run else SECONDS, tmp_path_factory.mktemp("venue"), PICTURE)


def test_nothing_is_missing_and_everything_follows(figures: dict[str, Any]) -> None:
    assert faults(figures, judge_growth=False) == [], "\n".join(table(figures))


def test_every_receiver_got_the_same_dance(figures: dict[str, Any]) -> None:
    receivers = figures["receivers"]
    assert set(receivers) == {"ai-toolbox", "vmc", "oscdump", "PosiStageNet"}
    most = max(one["frames"] for one in receivers.values())
    for one in receivers.values():
        # A receiver with a full socket has lost at least one datagram of each frame that is missing.
        assert most - one["lost"] <= one["frames"], receivers
    assert min(one["frames"] for one in receivers.values()) > 5 * SECONDS


def test_every_process_was_watched_and_leaks_no_handles(figures: dict[str, Any]) -> None:
    watched = {"stage", "control", "lights", "projector", "sensor", "oscdump"}
    assert watched <= figures["handles"].keys()
    for name in watched:
        start, end = figures["handles"][name]
        assert end <= start + 2, f"{name}: {start} handles at first, {end} in the end"


def test_the_projector_showed_the_dance(figures: dict[str, Any]) -> None:
    assert "frame age" in figures["projector"]


def test_what_goes_wrong_is_found(figures: dict[str, Any]) -> None:
    assert figures["lamps"]["1"]["looks"] > 0
    worse = {
        **figures,
        "malformed": 2,
        "stage": ["Danced 900 ticks: late 0, longest tick 2.0 ms, skipped 2."],
        "receivers": {**figures["receivers"], "vmc": {"frames": 900, "missing": 4, "late": 0, "lost": 1}},
        "lamps": {**figures["lamps"], "1": {"looks": 9, "followed": 8, "levels": 5}},
        "memory_mb": {**figures["memory_mb"], "lights": (50.0, 90.0)},
        "statuses": {**figures["statuses"], "stage": -9},
    }
    said = "\n".join(faults(worse))
    for message in ("vmc: 4 of 900", "lamp 1: followed in 8 of 9", "stage ended", "2 datagrams", "50 to 90"):
        assert message in said
