"""The data partition is full or read-only: the audience notices nothing.

test_installed_for_good.py has a box whose data partition is not there.
"""

from __future__ import annotations

import time

import pytest

from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures
from tests.boot.pauses import lives, missing_ticks, share

pytestmark = pytest.mark.boot


def _fill(box: Box) -> None:
    """Not a byte is free, not even for root; so it is after a power cut."""
    box.machine.run("sh", "-c", "cat /dev/zero >/data/filler; sync --file-system /data", check=False)
    _is_full(box)


def _is_full(box: Box) -> None:
    assert "100%" in box.machine.run("df", "/data")


def _dances_again_after_a_kill(box: Box, figures: Figures, name: str) -> None:
    killed = box.machine.kill(STAGE)
    _, after = box.pause_from(killed)
    figures.note(f"SIGKILL to next frame, {name}", after.at - killed, limit=1.0)


def test_a_full_data_partition(box: Box, figures: Figures) -> None:
    box.power_on()
    box.await_frames(50)
    began = time.time()
    _fill(box)
    box.hall.audience.watch(2.5)
    ended = time.time()
    seen = [frame for frame in box.hall.audience.frames if frame.at > began]
    assert lives(seen) == 1 and share(seen, began, ended) > 0.1
    figures.note(
        "ticks missing while the data partition fills up", missing_ticks(seen), limit=0, unit="ticks"
    )
    _dances_again_after_a_kill(box, figures, "data partition full")
    box.machine.cut_power()
    box.power_on()
    first = box.await_frames()[0]
    figures.note("power-on to first frame, data partition full", first.at - box.machine.powered_at)
    _is_full(box)
    box.machine.await_that(
        lambda: (
            "the journal stops growing"
            in box.machine.run("journalctl", "--priority=warning", "--unit=bunraku-keeper", check=False)
        ),
        "the keeper does not say that it is full",
    )
    box.machine.path("/data/filler").unlink()
    newest = time.time()
    journal = box.machine.path("/data/bunraku/journal")
    box.machine.await_that(
        lambda: any(path.stat().st_mtime > newest for path in journal.rglob("*") if path.is_file()),
        "the journal does not go on when there is room again",
    )


def test_a_read_only_data_partition(box: Box, figures: Figures) -> None:
    box.power_on(disk_options="ro")
    first = box.await_frames()[0]
    figures.note("power-on to first frame, data partition read-only", first.at - box.machine.powered_at)
    box.hall.dance_with_sensor()
    box.await_sensor()
    box.hall.switch_sensor_off()
    _dances_again_after_a_kill(box, figures, "data partition read-only")
