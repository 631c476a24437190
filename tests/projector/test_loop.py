"""The projector beside a stage: before it, with it, after it, with another one; and the show state."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from appliance.body.mesh_file import MESH_FILE
from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import GOING, LOOK, MASTER
from appliance.outputs.frame_reader import FrameReader
from appliance.projector.alignment import Alignment
from appliance.projector.context import offscreen
from appliance.projector.controls import Controls
from appliance.projector.loop import Projector
from appliance.projector.picture.image_file import read_image
from appliance.show.look import STYLES
from appliance.show.projector import ProjectorConfig
from tests.bundles import write_show
from tests.logged import said
from tests.projector.stage_double import SIZE, StageDouble, TellingPainter, pixels

PERIOD_S = 1 / 60
TICK_S = 0.02


@pytest.fixture(scope="module")
def gl() -> Iterator[moderngl.Context]:
    with offscreen(SIZE) as context:
        yield context


class Evening:
    """A projector, and time under the test's control."""

    def __init__(
        self, gl: moderngl.Context, folder: Path, show: Path, config: ProjectorConfig | None = None
    ) -> None:
        TellingPainter.made = TellingPainter.released = 0
        self._gl, self.folder, self.show = gl, folder, show
        self.said = said
        self.controls = Controls(Alignment(), lambda _: None)
        self.show_state = ShowState()
        self._declared = ShowStateWriter(folder)
        self._reader, self._show_state = FrameReader(folder), ShowStateReader(folder)
        self.projector = Projector(
            *(gl, config or ProjectorConfig(), self._reader, self._show_state, self.controls),
            TellingPainter,
        )
        self.now = self._ticked = 1000.0
        self.stage: StageDouble | None = None
        self.left_stage: float | None = None

    def begin(self, joints: int = 3, show: Path | None = None) -> None:
        self.stage = StageDouble(self.folder, show or self.show, joints)

    def lose_stage(self) -> None:
        """The stage's process ends."""
        assert self.stage is not None
        self.stage.close()
        self.stage = None

    def picture(self, size: tuple[int, int] = SIZE, lines: tuple[str, ...] = ()) -> np.ndarray:
        """One display frame later; the stage, if there is one, has ticked meanwhile."""
        self.now += PERIOD_S
        while self._ticked + TICK_S <= self.now:
            self._ticked += TICK_S
            if self.stage is not None:
                self.stage.write(self._ticked)
        self.left_stage = self.projector.draw(self.now, self._gl.screen, size, lines)
        return pixels(self._gl.screen, size)

    def colour(self, seconds: float = PERIOD_S) -> tuple[int, int, int]:
        """What fills the display after this time."""
        for _ in range(max(1, round(seconds / PERIOD_S))):
            found = self.picture()
        assert np.ptp(found, axis=(0, 1)).max() <= 1
        red, green, blue = found.reshape(-1, 3).max(axis=0)
        return int(red), int(green), int(blue)

    def declare(self, show_state: ShowState) -> None:
        self.show_state = show_state
        self._declared.write(show_state)

    def close(self) -> None:
        if self.stage is not None:
            self.stage.close()
        self.projector.release()
        self._declared.close()
        self._show_state.close()
        self._reader.close()


@pytest.fixture
def evening(gl: moderngl.Context, tmp_path: Path) -> Iterator[Evening]:
    (tmp_path / "run").mkdir()
    evening = Evening(gl, tmp_path / "run", write_show(tmp_path / "show"))
    yield evening
    evening.close()


def test_black_before_the_stage_then_the_dance_by_itself(evening: Evening) -> None:
    assert evening.colour(1.0) == (0, 0, 0)
    assert evening.left_stage is None
    evening.begin()
    assert evening.colour(0.2)[0] < 200
    assert evening.colour(0.6)[:2] == (255, 76)
    assert evening.left_stage == pytest.approx(evening.now - TICK_S, abs=0.002)
    assert TellingPainter.made == 1


def test_fades_to_black_when_the_stage_hangs_and_comes_back(evening: Evening) -> None:
    evening.begin()
    assert evening.colour(1.0)[0] == 255
    stage, evening.stage = evening.stage, None
    assert evening.colour(0.45)[0] == 255
    assert 60 < evening.colour(0.3)[0] < 200
    assert evening.colour(0.35) == (0, 0, 0)
    assert evening.left_stage is None
    evening.stage = stage
    assert evening.colour(0.6)[0] == 255
    assert TellingPainter.made == 1


def test_a_pause_of_the_whole_machine_shows_no_black(evening: Evening) -> None:
    """The projector wakes a few pictures before the stage does."""
    evening.begin()
    assert evening.colour(1.0)[0] == 255
    stage, evening.stage = evening.stage, None
    evening.now += 2.0
    assert {evening.colour()[0] for _ in range(6)} == {255}
    assert evening.projector.sees_stage
    evening.stage = stage
    assert {evening.colour()[0] for _ in range(30)} == {255}


def test_a_stage_that_is_restarted_soon_is_hardly_seen(evening: Evening) -> None:
    evening.begin()
    evening.colour(1.0)
    evening.lose_stage()
    assert evening.colour(0.3)[0] == 255
    evening.begin()
    assert {evening.colour()[0] for _ in range(30)} == {255}
    assert (TellingPainter.made, TellingPainter.released) == (1, 0)


def test_a_new_stage_that_has_not_begun_to_dance_takes_no_picture_away(evening: Evening) -> None:
    evening.begin()
    evening.colour(1.0)
    evening.lose_stage()
    evening.colour(0.1)
    coming = StageDouble(evening.folder, evening.show, joints=5)
    assert evening.colour(0.3)[:2] == (255, 76)
    assert evening.colour(1.0) == (0, 0, 0)
    evening.stage = coming
    assert evening.colour(0.8)[:2] == (255, 128)


def test_another_show_with_another_skeleton_begins_in_the_dark(evening: Evening, tmp_path: Path) -> None:
    evening.begin(joints=3)
    assert evening.colour(1.0)[1] == 76
    evening.begin(joints=7, show=write_show(tmp_path / "another"))
    seen = [evening.colour() for _ in range(45)]
    assert (0, 0, 0) in seen[:10]
    assert seen[-1][:2] == (255, 178)
    assert (TellingPainter.made, TellingPainter.released) == (2, 1)


def test_looks_that_were_changed_are_taken_by_the_next_stage(evening: Evening) -> None:
    evening.begin()
    evening.colour(0.5)
    with (evening.show / "show.yaml").open("a") as file:
        file.write("looks: [{name: cold, style: lines}]\n")
    evening.begin()
    evening.colour(0.5)
    assert TellingPainter.made == 2 and not evening.said


def test_a_body_that_was_changed_is_taken_by_the_next_stage(evening: Evening) -> None:
    (evening.show / MESH_FILE).write_bytes(b"one body")
    for made in (1, 1, 2):
        if made == 2:
            os.utime(evening.show / MESH_FILE, ns=(1, 1))
        evening.begin()
        evening.colour(0.5)
        assert TellingPainter.made == made


def test_large_images_are_read_once_and_their_reading_is_no_hung_display(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    Image.new("RGB", (2, 2)).save(evening.show / "set.png")
    with (evening.show / "show.yaml").open("a") as file:
        file.write("looks: [{name: set, image: set.png}]\n")
    prepares: list[bool] = []

    def noted(path: str) -> object:
        prepares.append(evening.projector.is_preparing)
        return read_image(path)

    monkeypatch.setattr("appliance.projector.loop.read_image", noted)
    for _ in range(2):
        evening.begin()
        evening.colour(0.5)
    assert prepares == [True] and not evening.projector.is_preparing


def test_a_show_broken_since_the_start_is_reported_and_shown_in_built_in_looks(evening: Evening) -> None:
    with (evening.show / "show.yaml").open("a") as file:
        file.write("looks: [{name: cold, style: lnes}]\n")
    evening.begin()
    assert evening.colour(1.0)[0] == 255
    (sentence,) = evening.said
    assert "Did you mean 'lines'?" in sentence and "built-in looks" in sentence


def test_panic_is_black_in_the_very_next_picture(evening: Evening) -> None:
    evening.begin()
    evening.controls.set_grid(True)
    for _ in range(60):
        assert evening.picture().any() or evening.now < 1000.5
    evening.declare(replace(evening.show_state, panic=True))
    assert not evening.picture(lines=("60 pictures/s",)).any()
    assert evening.left_stage is None
    evening.declare(replace(evening.show_state, panic=False))
    assert evening.picture().any()


def test_panic_that_comes_while_a_picture_is_drawn_is_in_that_picture(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    evening.begin()
    assert evening.colour(1.0)[0] == 255
    draw = TellingPainter.draw

    def panics(*arguments: object) -> None:
        draw(*arguments)  # type: ignore[arg-type]
        evening.declare(replace(evening.show_state, panic=True))

    monkeypatch.setattr(TellingPainter, "draw", panics)
    assert evening.colour() == (0, 0, 0)


def test_blackout_and_master_and_stop(evening: Evening) -> None:
    evening.begin()
    evening.colour(1.0)
    evening.declare(replace(evening.show_state, blackout=True))
    assert evening.colour() == (0, 0, 0)
    evening.declare(ShowState().to(MASTER, 0.5, evening.now, 1.0))
    assert 180 < evening.colour(0.5)[0] < 200
    assert abs(evening.colour(0.7)[0] - 128) <= 1
    evening.declare(ShowState().to(GOING, 0.0, evening.now, 2.0))
    assert 120 < evening.colour(1.0)[0] < 135
    assert evening.colour(1.1) == (0, 0, 0)


def test_looks_fade_as_the_declared_says(evening: Evening) -> None:
    evening.begin()
    evening.colour(1.0)
    evening.declare(ShowState().to(LOOK, "lines", evening.now, 1.0))
    assert 120 < evening.colour(0.5)[2] < 135
    assert evening.colour(0.6)[2] == 255


def test_each_look_is_drawn_unseen_before_the_first_is_seen(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a driver puts off until the first use of a shader would halt the dance in mid-show."""
    drawn: list[tuple[str, int]] = []
    draw = TellingPainter.draw

    def noted(painter: TellingPainter, *arguments: object) -> None:
        drawn.append((str(arguments[1]), len(seen)))
        draw(painter, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(TellingPainter, "draw", noted)
    seen: list[tuple[int, int, int]] = []
    evening.begin()
    while not seen or seen[-1] == (0, 0, 0):
        seen.append(evening.colour())
    first = drawn[0][1]
    unseen = [look for look, picture in drawn if picture == first]
    assert unseen[: 2 * len(STYLES)] == [*STYLES, *STYLES]  # onto a texture, and onto the display
    assert len(unseen) > 2 * len(STYLES), "and some once more, to measure how finely there is time to draw"
    assert set(seen[: first + 1]) == {(0, 0, 0)}


def test_preparing_a_show_is_distinguished_from_a_hung_display(
    evening: Evening, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = TellingPainter.draw
    prepares: list[bool] = []

    def noted(painter: TellingPainter, *arguments: object) -> None:
        prepares.append(evening.projector.is_preparing)
        draw(painter, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(TellingPainter, "draw", noted)
    evening.begin()
    evening.colour(1.0)
    assert prepares[: len(STYLES)] == [True] * len(STYLES)
    assert not prepares[-1]


def test_the_window_may_change_its_size(evening: Evening) -> None:
    evening.begin()
    evening.colour(1.0)
    assert (evening.picture((40, 20))[..., 0] == 255).all()
    assert (evening.picture()[..., 0] == 255).all()


def test_text_appears_on_demand_alone(evening: Evening) -> None:
    assert not evening.picture().any()
    assert evening.picture(lines=("60 pictures/s",)).any()


def test_the_test_card_needs_no_stage_and_gives_way_to_panic(evening: Evening) -> None:
    evening.controls.set_test_card(True)
    shown = evening.picture(lines=("box", "page http://10.0.0.1:80"))
    assert shown[0].min() >= 254 and np.ptp(shown) >= 254
    evening.begin()
    assert (evening.picture(lines=("box", "page http://10.0.0.1:80")) == shown).all()
    evening.declare(replace(evening.show_state, panic=True))
    assert evening.picture().max() == 0
