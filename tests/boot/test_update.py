"""A new release between two cities: a sound one takes over, a broken one leaves the old one dancing."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.boot.box import STAGE, Box
from tests.boot.figures import Figures
from tests.boot.pauses import lives, longest_pause_s
from tests.boot.root import release
from tests.boot.trial import changed_release

_CANNOT_DANCE = "raise ImportError('this release cannot dance')\n"
_CANNOT_START = (
    "import os\nif 'NOTIFY_SOCKET' in os.environ:\n    raise ImportError('this release cannot start')\n"
)

pytestmark = pytest.mark.boot


def _install(box: Box, image: Path, tmp_path: Path, version: str, last_lines: str) -> str:
    """Switch the box on with this release on a stick, and install it while it dances; what is said."""
    made = changed_release(
        release(image), tmp_path / "release", version, "appliance/stage/run.py", last_lines
    )
    box.power_on(binds=((box.boot, "/boot/bunraku"), (made, "/media/bunraku/bunraku/release")))
    box.await_frames(50)
    return box.machine.run(
        *(
            "sh",
            "-c",
            "bunraku-install --until-power-off 2>&1; echo status $?",
        ),
        patience_s=240.0,
    )


def test_a_release_that_fails_its_preflight_never_dances(image: Path, box: Box, tmp_path: Path) -> None:
    said = _install(box, image, tmp_path, "9.9.1", _CANNOT_DANCE)
    assert "status 1" in said and "this release cannot dance" in said, said
    seen = box.await_frames(50, time.time())
    assert lives(box.hall.audience.frames) == 1 and lives(seen) == 1, "the dance was interrupted"
    assert box.machine.show(STAGE, "NRestarts") == "0"
    assert "9.9.1" not in box.machine.run("bash", "/opt/bunraku/current/install.sh", "--list")


def test_a_release_that_does_not_start_gives_way_to_the_old_one(
    image: Path, box: Box, tmp_path: Path, figures: Figures
) -> None:
    said = _install(box, image, tmp_path, "9.9.2", _CANNOT_START)
    assert "status 1" in said and "which dances" in said, said
    assert box.await_frames(50, time.time())
    figures.note("update that does not start: time without frames", longest_pause_s(box.hall.audience.frames))
    current = box.machine.run("readlink", "/opt/bunraku/current")
    assert "9.9.2" not in current, said


def test_a_sound_release_takes_over_while_it_dances(
    image: Path, box: Box, tmp_path: Path, figures: Figures
) -> None:
    began = time.time()
    said = _install(box, image, tmp_path, "9.9.3", "")
    assert "status 0" in said, said
    figures.note("installing a release while it dances (with its power-on)", time.time() - began, limit=60.0)
    assert box.await_frames(50, time.time())
    figures.note("update: time without frames", longest_pause_s(box.hall.audience.frames))
    assert "9.9.3" in box.machine.run("readlink", "/opt/bunraku/current"), said
