"""A release installed on a box whose root forgets dances after each power-on, or what came before does."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.boot.box import STAGE, Box, standing
from tests.boot.disk import DataDisk
from tests.boot.figures import Figures
from tests.boot.hall import Hall
from tests.boot.trial import changed_release
from tests.deploy.made_package import made_package

RELEASES = "/data/bunraku-releases"
_STAGE = "appliance/stage/run.py"
_FAILS_WHEN_TOLD = (
    "import os\nif os.path.exists('/boot/bunraku/fail'):\n    raise ImportError('it fails today')\n"
)
_WATCH = "watch-release"

pytestmark = pytest.mark.boot


@pytest.fixture(scope="module")
def on_the_stick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Release 9.9.4: one of its units is another one, and its stage can be told to fail."""
    folder = tmp_path_factory.mktemp("stick") / "release"
    unit = "[Service]\nTasksMax=47\n"
    return changed_release(made_package(), folder, "9.9.4", _STAGE, _FAILS_WHEN_TOLD, unit)


@pytest.fixture(scope="module")
def with_release(
    image: Path, around: Hall, proven: DataDisk, on_the_stick: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[DataDisk]:
    """The data disk of a box on which it was installed while it danced, and whose plug was pulled then."""
    folder = tmp_path_factory.mktemp("installing")
    with standing(image, around, proven, folder) as box:
        box.disk.grown(1024)
        box.power_on(binds=((box.boot, "/boot/bunraku"), (on_the_stick, "/media/bunraku/bunraku/release")))
        box.await_frames(50)
        said = _bash(box, "bunraku release install 2>&1; echo status $?", 240.0)
        assert "status 0" in said, said
        box.machine.cut_power()
        yield box.disk


@pytest.fixture
def installed(image: Path, around: Hall, with_release: DataDisk, tmp_path: Path) -> Iterator[Box]:
    """A box with such a disk, switched off."""
    with standing(image, around, with_release, tmp_path) as made:
        yield made


def test_it_dances_after_a_power_cut_and_goes_back_for_good(installed: Box, figures: Figures) -> None:
    box = installed
    box.power_on()
    first = box.await_frames()[0]
    figures.note(
        "power-on to first frame with a release on the data partition", first.at - box.machine.powered_at
    )
    assert "9.9.4" in box.machine.run("readlink", "/opt/bunraku/current")
    assert box.machine.show("bunraku-console", "TasksMax") == "47", "systemd has read this release's units"
    box.machine.await_that(lambda: _watch_is_over(box), "the watch does not end: it dances")
    assert box.machine.show(_WATCH, "Result") == "success"
    assert not box.machine.path(f"{RELEASES}/tries").exists()
    assert box.machine.run("systemctl", "--failed", "--plain", "--no-legend") == ""
    assert box.machine.show(STAGE, "NRestarts") == "0"
    _the_services_cannot_touch_it(box)
    # What has just ended may hold the lock for a moment.
    said = _bash(box, "until bunraku release back; do sleep 1; done; bunraku release list", 60.0)
    assert said.splitlines()[-1] == "  9.9.4", said
    box.machine.cut_power()
    box.power_on()
    box.await_frames(50)
    assert "9.9.4" not in box.machine.run("readlink", "/opt/bunraku/current")
    assert box.machine.show("bunraku-console", "TasksMax") == "48"
    assert box.machine.show("bunraku-release", "ActiveState") == "inactive", "nothing on the way to the dance"


def test_one_whose_stage_does_not_start_any_more_gives_way(installed: Box, figures: Figures) -> None:
    box = installed
    (box.boot / "fail").touch()
    box.power_on()
    first = box.await_frames(1, patience_s=180.0)[0]
    figures.note(
        "a release that fails at power-on: until what came before dances", first.at - box.machine.powered_at
    )
    box.machine.await_that(lambda: _watch_is_over(box), "the watch does not end: it does not dance")
    assert "9.9.4  put aside: its stage did not dance" in _bash(box, "bunraku release list")
    box.machine.cut_power()
    box.power_on()
    box.await_frames(50)
    assert box.machine.show(STAGE, "NRestarts") == "0", "it is not tried again"
    assert box.machine.show("bunraku-console", "TasksMax") == "48"


def test_a_damaged_one_never_dances(installed: Box) -> None:
    box = installed
    box.disk.changed("truncate --size=-1 bunraku-releases/9.9.4/lib/python3*/site-packages/" + _STAGE)
    box.power_on()
    box.await_frames(50)
    assert "9.9.4" not in box.machine.run("readlink", "/opt/bunraku/current")
    assert "9.9.4  put aside: files of it are missing or damaged" in _bash(box, "bunraku release list")


def test_without_a_data_partition_what_came_with_the_box_dances(
    installed: Box, on_the_stick: Path, figures: Figures
) -> None:
    box = installed
    box.power_on(disk=None, binds=((box.boot, "/boot/bunraku"), (on_the_stick, "/media/release")))
    first = box.await_frames()[0]
    figures.note("power-on to first frame, no data partition", first.at - box.machine.powered_at)
    killed = box.machine.kill(STAGE)
    _, after = box.pause_from(killed)
    figures.note("SIGKILL to next frame, no data partition", after.at - killed, limit=1.0)
    box.await_frames(50, after.at)
    assert "9.9.4" not in box.machine.run("readlink", "/opt/bunraku/current")
    said = _bash(box, "bunraku release install /media/release 2>&1; echo status $?")
    assert "status 1" in said and "where releases are kept, is not there" in said, said


def _the_services_cannot_touch_it(box: Box) -> None:
    """Even as root a service would find it read only; and none is root."""
    for unit in ("stage", "keeper", "control", "lights", "projector", "console"):
        box.await_unit(f"bunraku-{unit}")  # before that its mounts may not be made
        pid = box.machine.show(f"bunraku-{unit}", "MainPID")
        tried = _bash(
            box,
            f"nsenter -t {pid} --mount sh -c 'touch {RELEASES}/x {RELEASES}/9.9.4/x /data/x' 2>&1; true",
        )
        assert tried.count("Read-only file system") == 3, (unit, tried)


def _watch_is_over(box: Box) -> bool:
    return box.machine.show(_WATCH, "ActiveState") in ("inactive", "failed")


def _bash(box: Box, message: str, patience_s: float = 60.0) -> str:
    return box.machine.run("bash", "-c", message, patience_s=patience_s)
