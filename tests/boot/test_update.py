"""A new release between two cities: a sound one takes over, a broken one leaves the old one dancing."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.boot.box import STAGE, Box, standing
from tests.boot.disk import DataDisk
from tests.boot.figures import Figures
from tests.boot.hall import Hall
from tests.boot.pauses import lives, longest_pause_s
from tests.boot.trial import changed_release
from tests.deploy.made_package import made_package

_CANNOT_DANCE = "raise ImportError('this release cannot dance')\n"
_CANNOT_START = (
    "import os\nif 'NOTIFY_SOCKET' in os.environ:\n    raise ImportError('this release cannot start')\n"
)

pytestmark = pytest.mark.boot


@pytest.fixture(scope="module")
def stick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `bunraku` of a stick that stays plugged in; what lies on it changes from test to test."""
    return tmp_path_factory.mktemp("stick")


@pytest.fixture(scope="module")
def touring(
    image: Path, around: Hall, proven: DataDisk, stick: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Box]:
    """A box that dances while one release after the other is installed on it."""
    with standing(image, around, proven, tmp_path_factory.mktemp("touring")) as box:
        box.power_on(binds=((box.boot, "/boot/bunraku"), (stick, "/media/bunraku/bunraku")))
        box.await_frames(50)
        yield box


def _install(box: Box, stick: Path, version: str, last_lines: str) -> str:
    """Lay this release on the stick, and install it while the box dances; what is said."""
    shutil.rmtree(stick / "release", ignore_errors=True)
    changed_release(made_package(), stick / "release", version, "appliance/stage/run.py", last_lines)
    box.hall.audience.forget()
    box.await_frames(50)
    return box.machine.run(
        "sh", "-c", "bunraku release install --until-power-off 2>&1; echo status $?", patience_s=240.0
    )


def test_a_release_that_fails_its_preflight_never_dances(touring: Box, stick: Path) -> None:
    box = touring
    said = _install(box, stick, "9.9.1", _CANNOT_DANCE)
    assert "status 1" in said and "this release cannot dance" in said, said
    seen = box.await_frames(50, time.time())
    assert lives(box.hall.audience.frames) == 1 and lives(seen) == 1, "the dance was interrupted"
    assert box.machine.show(STAGE, "NRestarts") == "0"
    assert "9.9.1" not in box.machine.run("bunraku", "release", "list")


def test_a_release_that_does_not_start_gives_way_to_the_old_one(
    touring: Box, stick: Path, figures: Figures
) -> None:
    box = touring
    said = _install(box, stick, "9.9.2", _CANNOT_START)
    assert "status 1" in said and "which dances" in said, said
    assert box.await_frames(50, time.time())
    figures.note("update that does not start: time without frames", longest_pause_s(box.hall.audience.frames))
    current = box.machine.run("readlink", "/opt/bunraku/current")
    assert "9.9.2" not in current, said


def test_a_sound_release_takes_over_while_it_dances(touring: Box, stick: Path, figures: Figures) -> None:
    box = touring
    began = time.time()
    said = _install(box, stick, "9.9.3", "")
    assert "status 0" in said, said
    figures.note("installing a release while it dances", time.time() - began, limit=60.0)
    assert box.await_frames(50, time.time())
    figures.note("update: time without frames", longest_pause_s(box.hall.audience.frames))
    assert "9.9.3" in box.machine.run("readlink", "/opt/bunraku/current"), said
