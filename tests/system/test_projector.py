"""The real projector beside the real box, started before, with and after it; the frames always go on."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from appliance.projector.projector_error import NO_DISPLAY, NO_PLACE
from appliance.show.bundle import default_show_path
from tests.bundles import with_surface, write_show
from tests.show_control.doubles import Asker
from tests.system.box import Box, playing
from tests.system.processes import BUNRAKU, Process, run, run_bunraku, wait_until

SIZE = "128x72"


class Projection(Process):
    """`bunraku project` without a display; its pictures go into a folder."""

    def __init__(self, box_file: Path, folder: Path) -> None:
        self.pictures = Path(tempfile.mkdtemp(dir=folder))
        shown = ("--offscreen", SIZE, "--frames", str(self.pictures))
        super().__init__(self.pictures / "words.txt", [*BUNRAKU, "project", "--box", box_file, *shown])

    def newest(self) -> np.ndarray | None:
        """What is on the wall: the newest complete picture."""
        found = sorted(self.pictures.glob("*.png"))[:-1]
        for path in found[:-1]:
            path.unlink()
        return np.asarray(Image.open(found[-1]).convert("RGB")) if found else None

    def await_picture(self, is_wanted: Callable[[np.ndarray], bool]) -> None:
        """Wait until such a picture is on the wall."""

        def is_there() -> bool:
            assert self.process.poll() is None, self.output
            picture = self.newest()
            return picture is not None and is_wanted(picture)

        wait_until(is_there, lambda: self.output)

    def await_black(self) -> None:
        self.await_picture(lambda picture: not picture.any())

    def await_dance(self) -> None:
        self.await_picture(lambda picture: picture.max() > 100)


@pytest.fixture
def box(tmp_path: Path) -> Iterator[Box]:
    with playing(with_surface(write_show(tmp_path / "show", hands=[])), tmp_path) as box:
        yield box


def test_started_first_it_waits_in_the_dark_and_outlives_two_stages(tmp_path: Path) -> None:
    box_file = tmp_path / "box.yaml"
    box_file.write_text("runtime: runtime\n")  # as in the box file that the box gets
    with Projection(box_file, tmp_path) as projection:
        projection.await_black()
        with playing(with_surface(write_show(tmp_path / "show", hands=[])), tmp_path) as box:
            projection.await_dance()
            projection.await_output("No graphics card draws here")
            box.end(signal.SIGKILL)
            projection.await_black()
        (tmp_path / "another").mkdir()
        same_place = {"runtime": str(tmp_path / "runtime")}
        with playing(default_show_path(), tmp_path / "another", settings=same_place) as box:
            projection.await_dance()
            assert projection.end() == 0
            box.frames(5)
    assert re.search(r"Shown: [\d.]+ pictures/s, frame age at the swap \d+ ms p50", projection.output)
    assert projection.output.count("No graphics card draws here") == 1  # once for two stages


def test_a_hung_and_a_killed_projector_do_not_touch_the_stage(box: Box, tmp_path: Path) -> None:
    with Projection(box.box_file, tmp_path) as projection:
        projection.await_dance()
        projection.process.send_signal(signal.SIGSTOP)
        hung = box.frames(100)
        assert [frame[0] for frame in hung] == sorted({frame[0] for frame in hung})
        projection.process.send_signal(signal.SIGCONT)
        projection.await_dance()
        assert projection.end(signal.SIGKILL) == -signal.SIGKILL
        box.frames(25)
    with Projection(box.box_file, tmp_path) as projection:
        projection.await_dance()
        assert projection.end(signal.SIGINT) == 0
    box.frames(5)
    assert box.process.poll() is None


def test_panic_and_alignment_by_osc(box: Box, tmp_path: Path) -> None:
    with Projection(box.box_file, tmp_path) as projection, contextlib.closing(Asker(box.control)) as asker:
        projection.await_dance()
        assert asker.ask("/panic", 1)[2] == 1
        projection.await_black()
        assert asker.ask("/go")[2] == 1
        projection.await_dance()

        assert asker.order("/projector/grid", 1)[2:] == [1, "The grid is on the wall."]
        corners = (0.5, 0.5, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0)
        assert asker.order("/projector/corners", *corners)[2] == 1
        projection.await_picture(lambda seen: seen[40:].max() > 100 and not seen[:36].any())
        done, message = asker.order("/projector/corner", 1, 1.0, 1.0)[2:]
        assert not done and "fold" in message
        projection.end()
    with Projection(box.box_file, tmp_path) as projection:
        projection.await_picture(lambda seen: seen[40:].max() > 100 and not seen[:36].any())


def test_without_a_display_it_says_so(tmp_path: Path) -> None:
    if Path("/dev/dri").exists():
        pytest.skip("this machine has a display of its own")
    without = {"DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"}
    environment = {name: value for name, value in os.environ.items() if name not in without}
    done = run([*BUNRAKU, "project"], env=environment)
    assert done.returncode == NO_DISPLAY
    assert re.fullmatch(r"bunraku: There is no display .* Plug the projector in .*\n", done.stderr)


def test_no_room_for_pictures(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = run_bunraku("project", "--offscreen", SIZE, "--frames", tmp_path / "file")
    assert done.returncode == NO_PLACE
    assert "pictures cannot be written there" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--offscreen", "big"), "is no size"),
        (("--offscreen", "0x10"), "from 1 to"),
        (("--window", "--fullscreen"), "Give one of"),
    ],
)
def test_options_that_make_no_sense(arguments: tuple[str, ...], message: str) -> None:
    done = run_bunraku("project", *arguments)
    assert done.returncode == 2 and message in done.stderr.replace("\n", " ")
