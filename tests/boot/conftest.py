"""What all boot tests share: the root, the hall around the box, the box itself, the figures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.boot import figures_report, rights
from tests.boot.box import KEYS, Box, standing
from tests.boot.device import Device
from tests.boot.disk import DataDisk
from tests.boot.figures import Figures
from tests.boot.hall import Hall, hall
from tests.boot.root import root_image

# The order on the dancing box: looks at what was just switched on, then harm, then another box file.
TURNS = ("test_power_on", "test_ports", "test_page", "test_companions", "test_restarts", "test_page_changes")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The tests of the dancing box run last, in their turns: it stays on until the last of them has ended."""
    places = [place for place, item in enumerate(items) if item.path.parent == Path(__file__).parent]
    for place, item in zip(places, sorted((items[place] for place in places), key=_turn), strict=True):
        items[place] = item


def _turn(item: pytest.Item) -> int:
    return TURNS.index(item.path.stem) if "dancing" in getattr(item, "fixturenames", ()) else -1


@pytest.fixture(scope="session")
def figures(pytestconfig: pytest.Config) -> Figures:
    """Where measured times go."""
    report = pytestconfig.pluginmanager.get_plugin(figures_report.NAME)
    assert isinstance(report, figures_report.FiguresReport)
    return report.figures


@pytest.fixture(scope="session")
def image() -> Path:
    """The box's root."""
    why_not = rights.why_not()
    if why_not is not None:
        pytest.skip(f"no box can boot here: {why_not}")
    return root_image()


@pytest.fixture(scope="session")
def around(image: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    """The hall, its cable and its audience."""
    with hall(tmp_path_factory.mktemp("hall")) as made:
        yield made


@pytest.fixture(scope="session")
def proven(
    image: Path, around: Hall, figures: Figures, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[DataDisk]:
    """The data disk of a box that has danced an evening with the venue's box file, and was switched off."""
    folder = tmp_path_factory.mktemp("evening")
    fresh = DataDisk.made(folder / "data.ext4", {KEYS: around.key_file})
    with standing(image, around, fresh, tmp_path_factory.mktemp("first")) as box:
        box.power_on()
        first = box.await_frames()[0]
        figures.note("first power-on with a new box file to first frame", first.at - box.machine.powered_at)
        box.machine.await_that(box.is_proven, "the venue's box file is not taken for good")
        box.machine.power_off()
        fresh.repaired()
        yield box.disk.copied(folder / "proven.ext4")


@pytest.fixture
def box(image: Path, around: Hall, proven: DataDisk, tmp_path: Path) -> Iterator[Box]:
    """A box after a good evening, switched off; it is off again afterwards."""
    with standing(image, around, proven, tmp_path) as made:
        yield made


@pytest.fixture(scope="package")
def shared(
    image: Path, around: Hall, proven: DataDisk, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Box]:
    """The box of `dancing`, from the first test that has it to the last."""
    with standing(image, around, proven, tmp_path_factory.mktemp("box")) as made:
        made.power_on()
        made.await_frames()
        around.dance_with_sensor()
        made.await_sensor()
        yield made
        around.switch_sensor_off()


@pytest.fixture
def dancing(shared: Box) -> Box:
    """A box that dances with a sensor, one for all tests that leave it dancing; each finds it so."""
    shared.hall.audience.forget()
    shared.await_frames()
    return shared


@pytest.fixture(scope="package")
def device(shared: Box) -> Device:
    """One for all tests of the dancing box: it gives the PIN once."""
    return Device(shared)
