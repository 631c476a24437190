"""The plug is pulled at any moment: it always dances again, nothing is half written, the phrase goes on."""

from __future__ import annotations

import json
import random
import time

import pytest

from appliance.box.checkpoint import Checkpoint
from tests.boot.box import KEYS, Box
from tests.boot.figures import Figures

CUTS, MOST_CUTS = 5, 20  # MOST_CUTS with --long; each fifth falls into a start
AGE_LIMIT_S = 1.0
MOST_S = 10.0  # however busy this machine is: what is older than this was not the place of that evening

pytestmark = pytest.mark.boot


def test_it_dances_again_after_power_cuts(
    box: Box, figures: Figures, rng: random.Random, long_run: bool, pytestconfig: pytest.Config
) -> None:
    cuts = pytestconfig.getoption("--cuts") or (MOST_CUTS if long_run else CUTS)
    box.power_on()
    box.await_frames()
    for cut in range(cuts):
        left = _cut_somewhere(box, rng, in_the_start=cut % 5 == 4)
        box.power_on()
        first = box.await_frames()[0]
        figures.note("power-on after a power cut to first frame", first.at - box.machine.powered_at)
        _nothing_is_half_written(box)
        if left is not None:
            age_s = _age_s(left, box.place())
            figures.note("age of the place after a power cut", age_s, limit=AGE_LIMIT_S)
            assert -1.0 < age_s < MOST_S, (left, box.place())
    figures.note("power cuts survived", cuts, unit=f"of {cuts}")
    box.machine.cut_power()
    box.disk.repaired()
    assert box.disk.sound()


def _cut_somewhere(box: Box, rng: random.Random, in_the_start: bool) -> Checkpoint | None:
    """Cut while it dances, with writes on the way; or while it starts, before or after its first frame.

    Where the dance was; None in a start.
    """
    if in_the_start:
        box.machine.cut_power()
        box.power_on()
        time.sleep(rng.uniform(0.0, 3.0))
        box.machine.cut_power()
        return None
    box.hall.audience.watch(rng.uniform(0.1, 2.5))
    (box.machine.path("/data/bunraku") / "unsynced").write_bytes(bytes(4096))
    left = box.place()
    box.machine.cut_power()
    return left


def _age_s(left: Checkpoint, now: Checkpoint) -> float:
    """How long before the cut the place was noted at which the dance went on."""
    began_s = now.puppets[0].position_s - (now.tick + 1) / 50.0
    start_s, end_s = now.puppets[0].excerpt
    age_s = left.puppets[0].position_s - began_s
    return age_s if age_s > -1.0 else age_s + end_s - start_s


def _nothing_is_half_written(box: Box) -> None:
    data = box.machine.path("/data")
    assert (data / KEYS).read_bytes() == box.hall.key_file
    chosen = json.loads((data / "bunraku" / "chosen.json").read_bytes())
    assert chosen["box"].startswith("/data/bunraku/boxes/"), chosen
    assert not list(data.rglob("*.part")), "an unfinished file was left"
