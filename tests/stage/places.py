"""What a stage that was there before left in its runtime folder: its place, and what is declared."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from appliance.box.checkpoint import Checkpoint, CheckpointWriter, Standing
from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState

PLACE = Checkpoint("A test", (Standing("walk", 2.0, (0.0, 5.0), coding=3, interaction=2),), boot="another")


def put(runtime: Path, place: Checkpoint) -> None:
    with closing(CheckpointWriter(runtime)) as writer:
        writer.write(place)


def declare(runtime: Path, show_state: ShowState) -> None:
    with closing(ShowStateWriter(runtime)) as writer:
        writer.write(show_state)
