"""The box in the hall: what the tests of the boot say about it, in their own words."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from appliance.box.checkpoint import Checkpoint, CheckpointReader
from tests.boot.disk import DataDisk
from tests.boot.hall import Hall, box_file
from tests.boot.machine import PATIENCE_S, Machine, PowerOn
from tests.boot.pauses import FPS, Seen, pause_after

STAGE = "bunraku-stage"
_WRITTEN_AT = 1_700_000_000  # else each box has a new box file, which has to be checked
KEYS = "bunraku/keys/sensors.keys"


@dataclass
class Box:
    """A machine with a data disk, a boot partition's folder with the venue's box file, and a hall."""

    machine: Machine
    hall: Hall
    disk: DataDisk
    boot: Path
    how: PowerOn = field(default_factory=PowerOn)

    def power_on(self, **changes: object) -> None:
        """Switch it on as it stands; `changes` are fields of PowerOn."""
        self.disk.repaired()
        usual = PowerOn(disk=self.disk, binds=((self.boot, "/boot/bunraku"),))
        self.how = replace(usual, **changes)  # type: ignore[arg-type]
        self.hall.audience.forget()
        self.machine.power_on(self.how)

    def await_frames(self, count: int = 1, after: float = 0.0, patience_s: float = PATIENCE_S) -> list[Seen]:
        """So many frames that came in after a time (seconds since 1970)."""
        return self.await_seen(lambda seen: len(seen) >= count, after, patience_s)

    def await_seen(
        self, enough: Callable[[list[Seen]], object], after: float = 0.0, patience_s: float = PATIENCE_S
    ) -> list[Seen]:
        """The frames after a time, once they are enough."""
        until = time.monotonic() + patience_s
        audience = self.hall.audience
        while True:
            audience.watch(0.05)
            seen = [frame for frame in audience.frames if frame.at > after]
            if enough(seen):
                return seen
            assert time.monotonic() < until, f"{len(seen)} frames came.\n{self.machine.log()}"

    def await_sensor(self) -> list[Seen]:
        """Until a sensor's reading is in a frame."""
        return self.await_seen(lambda seen: seen and seen[-1].sequence >= 0, time.time())

    def pause_from(self, at: float, then_s: float = 0.5) -> tuple[Seen, Seen]:
        """The frames around the pause that something at `at` made, once the dance went on for `then_s`."""
        self.await_seen(lambda _: pause_after(self.hall.audience.frames, at))
        self.hall.audience.watch(then_s)
        found = pause_after(self.hall.audience.frames, at)
        assert found is not None
        return found

    def danced_s(self, since: float, tick: int) -> float:
        """How far the phrase went on from a time (seconds since 1970) until a tick of the stage of then.

        A late frame is the last pose once more: the phrase stands still meanwhile.
        """
        audience = self.hall.audience
        audience.watch()
        return (
            sum(not frame.late for frame in audience.frames if frame.at >= since and frame.tick <= tick) / FPS
        )

    def place(self) -> Checkpoint:
        """Where the dance is, as the stage has it in memory."""
        reader = CheckpointReader(self.machine.path("/run/bunraku"))
        with contextlib.closing(reader):
            return self.machine.await_that(reader.read, "there is no place in memory")

    def await_unit(self, unit: str) -> None:
        """Until it runs."""
        self.machine.await_that(
            lambda: self.machine.show(unit, "ActiveState") == "active", f"{unit} does not run"
        )

    def is_proven(self) -> bool:
        """Whether what dances is kept as something that dances for good."""
        kept = self.machine.path("/data/bunraku/chosen.json")
        return kept.exists() and bool(json.loads(kept.read_bytes())["pairs"][0]["good"])


@contextlib.contextmanager
def standing(image: Path, around: Hall, disk: DataDisk, folder: Path) -> Iterator[Box]:
    """A box in a hall with a copy of this data disk, switched off; off again at the end."""
    (folder / "root").symlink_to(image)
    boot = folder / "boot"
    boot.mkdir()
    (boot / "box.yaml").write_text(box_file())
    os.utime(boot / "box.yaml", (_WRITTEN_AT, _WRITTEN_AT))
    own = disk.copied(folder / "data.ext4")
    box = Box(Machine(folder, around.box_network), around, own, boot)
    try:
        yield box
    finally:
        if box.machine.process is not None:
            box.machine.cut_power()
        shutil.rmtree(folder, ignore_errors=True)
