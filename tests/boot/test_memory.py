"""Memory runs out: the process that took it is killed; a stage that is killed dances again."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.boot import rights
from tests.boot.box import STAGE, Box, standing
from tests.boot.disk import DataDisk
from tests.boot.figures import Figures
from tests.boot.hall import Hall
from tests.boot.pauses import longest_pause_s

LIMIT_BYTES = 900 << 20
_HOG = "taken = []\nwhile True: taken.append(bytearray(b'x') * (4 << 20))"

pytestmark = pytest.mark.boot


@pytest.fixture(scope="module")
def limited(
    image: Path, around: Hall, proven: DataDisk, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Box]:
    """A box that may use LIMIT_BYTES."""
    why_not = rights.no_memory_limits()
    if why_not is not None:
        pytest.skip(why_not)
    with standing(image, around, proven, tmp_path_factory.mktemp("limited")) as box:
        box.power_on(memory=LIMIT_BYTES)
        yield box


@pytest.fixture
def short_of_memory(limited: Box) -> Box:
    """It has danced for a while."""
    limited.await_frames(100, time.time())
    return limited


def _take_all_memory(box: Box) -> float:
    """A program of the box that takes more and more, until it is killed; when it began."""
    box.machine.run("systemctl", "reset-failed", "hog", check=False)
    began = time.time()
    box.machine.run("systemd-run", "--unit=hog", "--property=Restart=no", "/usr/bin/python3", "-c", _HOG)
    box.machine.await_that(
        lambda: box.machine.show("hog", "ActiveState") in ("failed", "inactive"), "the hog lives on"
    )
    return began


def test_a_program_that_takes_all_memory(short_of_memory: Box, figures: Figures) -> None:
    box = short_of_memory
    began = _take_all_memory(box)
    box.hall.audience.watch(1.0)
    seen = [frame for frame in box.hall.audience.frames if frame.at > began - 0.5]
    figures.note("longest time without frames while memory is short", longest_pause_s(seen))
    assert box.await_frames(50, time.time())
    assert box.machine.show(STAGE, "ActiveState") == "active"


def test_a_stage_that_is_killed_for_lack_of_memory_goes_on_at_its_place(
    short_of_memory: Box, figures: Figures
) -> None:
    box = short_of_memory
    left, left_at, process = box.place(), time.time(), box.machine.main_pid(STAGE)
    Path(f"/proc/{process}/oom_score_adj").write_text("1000")
    began = _take_all_memory(box)
    before, after = box.pause_from(began)
    figures.note("stage killed for lack of memory: time without frames", after.at - before.at)
    assert box.machine.main_pid(STAGE) != process
    now = box.place()
    came_to_its_end = left.puppets[0].position_s + time.time() - left_at > now.puppets[0].excerpt[1] - 0.1
    assert now.puppets[0].phrase == left.puppets[0].phrase and (
        now.puppets[0].position_s > left.puppets[0].position_s or came_to_its_end
    )
