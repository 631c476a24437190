"""Cards over the dance: words, images and plain colours, their fades, and what is wrong with their files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from matplotlib import get_data_path
from PIL import Image, ImageOps

from appliance.levers.show_state import ShowState
from appliance.levers.table import CARD, MASTER
from appliance.projector.context import offscreen
from appliance.projector.corners import homography
from appliance.projector.picture.cards import Cards, content_of
from appliance.projector.picture.image_file import MOST_PIXELS, read_image
from appliance.projector.picture.lettering import (
    MOST_HIGH,
    fonts_of_machine,
    lettered,
    letters_without_font,
)
from appliance.projector.picture.wall import Wall
from appliance.show.card import BLANK, CardConfig, cards_by_name
from appliance.show.config_error import ConfigError
from appliance.show.projector import MaskConfig, ProjectorConfig
from appliance.show.show import load_show
from tests.bundles import write_show
from tests.logged import said
from tests.projector.stage_double import pixels
from tests.projector.test_loop import Evening

SIZE = (160, 90)
RED = (230, 60, 40)
Show = Callable[..., np.ndarray]


@pytest.fixture(scope="module")
def gl() -> Iterator[moderngl.Context]:
    with offscreen(SIZE) as context:
        yield context


@pytest.fixture
def show(gl: moderngl.Context, tmp_path: Path) -> Show:
    """What cards make of a picture of one grey."""
    Image.new("RGBA", (30, 20), (*RED, 255)).save(tmp_path / "logo.png")

    def shown(cards: list[CardConfig], state: ShowState, now: float = 10.0, level: float = 1.0) -> np.ndarray:
        made = Cards(gl, cards_by_name(cards), tmp_path)
        gl.screen.clear(0.4 * level, 0.4 * level, 0.4 * level, 1.0)
        whole = np.array([[2.0, 0.0, -1.0], [0.0, 2.0, -1.0], [0.0, 0.0, 1.0]])
        made.draw(Wall(gl.screen, SIZE, SIZE, whole, level), state, now)
        made.release()
        return pixels(gl.screen, SIZE).astype(int)

    return shown


def test_without_a_card_the_picture_is_as_it_was(show: Show) -> None:
    assert np.array_equal(show([], ShowState()), np.full((90, 160, 3), 102))
    assert np.array_equal(show([], ShowState().to(CARD, "no such card")), np.full((90, 160, 3), 102))


def test_blank_is_black_and_fades_in_and_out(show: Show) -> None:
    fading = ShowState().to(CARD, BLANK, 10.0, 4.0)
    assert [show([], fading, now).mean() for now in (10.0, 11.0, 12.0, 14.0)] == pytest.approx(
        [102, 76.5, 51, 0], abs=1
    )
    off = fading.to(CARD, "", 20.0, 2.0)
    assert show([], off, 21.0).mean() == pytest.approx(51, abs=1)


def test_a_logo_keeps_its_shape_at_its_place_and_follows_the_level(show: Show) -> None:
    logo = CardConfig(name="logo", image="logo.png", image_size=0.4, place=(0.25, 0.75))
    rows, columns = np.nonzero((np.abs(show([logo], ShowState().to(CARD, "logo")) - RED) < 3).all(axis=2))
    assert abs(np.ptp(rows) + 1 - 36) <= 2 and abs(np.ptp(columns) + 1 - 54) <= 2
    assert (rows.mean(), columns.mean()) == pytest.approx((0.75 * 90, 0.25 * 160), abs=1)
    dim = show([logo], ShowState().to(CARD, "logo"), level=0.5)
    assert np.abs(dim[67, 40] - np.array(RED) / 2).max() <= 1
    assert np.abs(dim[5, 5] - 51).max() <= 1


def test_two_cards_of_one_ground_fade_without_the_dance_shining_through(show: Show) -> None:
    cards = [
        CardConfig(name="one", background="#ffffff", text="one", colour="#000000"),
        CardConfig(name="two", background="#ffffff"),
    ]
    fading = ShowState().to(CARD, "one").to(CARD, "two", 10.0, 2.0)
    assert (show(cards, fading, 11.0)[:10] == 255).all()
    assert show(cards, fading, 11.0).min() > show(cards, ShowState().to(CARD, "one")).min()


def test_words_too_wide_are_shrunk_into_the_picture(show: Show) -> None:
    long = CardConfig(name="long", text="W" * 60, size=0.3, background="#000000")
    light = show([long], ShowState().to(CARD, "long")).max(axis=(0, 2))
    assert light.max() > 100 and not light[:3].any() and not light[-3:].any()


def test_lines_too_many_are_shrunk_into_the_picture(show: Show) -> None:
    """A roll of credits; and no more lines make an image larger than a graphics chip takes."""
    roll = CardConfig(name="roll", text="W\n" * 40, size=0.08, background="#000000")
    light = show([roll], ShowState().to(CARD, "roll")).max(axis=(1, 2))
    assert light.max() > 50 and not light[:1].any() and not light[-1:].any()
    largest = lettered("W\n" * 500, 540, RED)
    assert largest.shape[0] <= MOST_HIGH and largest[..., 3].any()


def test_an_image_too_wide_is_shrunk(tmp_path: Path) -> None:
    Image.new("RGB", (9000, 500)).save(tmp_path / "wide.png")
    assert read_image(tmp_path / "wide.png").shape == (228, 4096, 4)
    whole = content_of(CardConfig(name="w", image="wide.png", image_size=1.0), tmp_path)
    assert whole is not None and whole.shape[:2] == (228, 4096)


@pytest.mark.parametrize("orientation", range(10))
def test_a_photograph_stands_as_its_camera_was_held(orientation: int, tmp_path: Path) -> None:
    """A telephone stores the rows of its sensor, and how it was held."""
    stored, noted = Image.new("RGB", (48, 32), RED), Image.Exif()
    stored.paste((0, 0, 255), (0, 16, 16, 32))
    noted[0x0112] = orientation
    stored.save(tmp_path / "photo.jpg", exif=noted)
    with Image.open(tmp_path / "photo.jpg") as file:
        upright = np.asarray(ImageOps.exif_transpose(file))
    np.testing.assert_array_equal(read_image(tmp_path / "photo.jpg")[..., :3], upright)


@pytest.mark.skipif(not fonts_of_machine(), reason="no font is installed here")
def test_letters_of_several_scripts_are_drawn_as_themselves() -> None:
    """Arabic letters join: a word is narrower than its letters side by side."""
    text = "Καλή Добрый дом"
    assert letters_without_font(text) == ""
    assert letters_without_font("a\U0010fffd") == "\U0010fffd"
    alone = [lettered(letter, 60, (255, 255, 255)).shape[1] - 60 for letter in "دمية"]
    together = lettered("دمية", 60, (255, 255, 255)).shape[1] - 60
    if letters_without_font("دمية") == "":
        assert together < 0.95 * sum(alone)
    two = lettered("a\nb", 40, RED)
    assert two.shape[0] > 1.5 * lettered("a", 40, RED).shape[0]
    assert (two[..., :3] == RED).all() and two[..., 3].max() == 255


def test_a_font_that_was_saved_anew_is_taken_with_the_next_cards(show: Show, tmp_path: Path) -> None:
    card = CardConfig(name="x", text="Hamlet", font="own.ttf", size=0.4)
    state, seen = ShowState().to(CARD, "x"), []
    for name in ("DejaVuSerif", "DejaVuSansMono-Bold"):
        (tmp_path / "own.ttf").write_bytes(Path(get_data_path(), f"fonts/ttf/{name}.ttf").read_bytes())
        seen.append(show([card], state))
    assert np.abs(seen[1] - seen[0]).max() > 100


def test_a_card_follows_the_corners(gl: moderngl.Context, tmp_path: Path) -> None:
    made = Cards(gl, cards_by_name([CardConfig(name="w", background="#ffffff")]), tmp_path)
    corners = ((0.25, 0.2), (0.75, 0.2), (0.75, 0.8), (0.25, 0.8))
    y_up = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]])
    clip = np.array([[2.0, 0.0, -1.0], [0.0, -2.0, 1.0], [0.0, 0.0, 1.0]]) @ homography(corners) @ y_up
    gl.screen.clear()
    made.draw(Wall(gl.screen, SIZE, SIZE, clip), ShowState().to(CARD, "w"), 1.0)
    made.release()
    lit = pixels(gl.screen, SIZE)[..., 0] > 127
    assert lit[18:72, 40:120].all() and lit.sum() == 54 * 80


def test_a_broken_file_leaves_the_rest_of_the_card(gl: moderngl.Context, tmp_path: Path) -> None:
    (tmp_path / "logo.png").write_bytes(b"\x89PNG\r\n\x1a\nno more")
    Cards(gl, {"t": CardConfig(name="t", image="logo.png", background="#ffffff")}, tmp_path).release()
    assert len(said) == 1 and "The card 't' cannot be drawn whole" in said[0]
    (tmp_path / "own.ttf").write_bytes(b"no font")
    card = CardConfig(name="t", text="Hamlet", image="logo.png", font="own.ttf")
    words = content_of(card, tmp_path)
    assert words is not None and words[..., 3].any()
    assert len(said) == 3 and "cannot be drawn whole" in said[1] and "in another one" in said[2]
    Image.new("1", (MOST_PIXELS // 100 + 1, 100)).save(tmp_path / "huge.png")
    with pytest.raises(OSError, match="more than 64 million pixels"):
        read_image(tmp_path / "huge.png")


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"cards": [{"name": "none"}]}, "'none' takes a card off"),
        ({"cards": [{"name": "a"}, {"name": "a"}]}, "Two cards are called 'a'"),
        ({"cards": [{"name": "a", "image": "phrase.bvh"}]}, "neither a PNG nor a JPEG"),
        ({"looks": [{"name": "a", "image": "gone.png"}]}, "There is no file 'gone.png'"),
        ({"cards": [{"name": "title"}], "cues": [{"name": "c", "card": "titel"}]}, "Did you mean 'title'?"),
    ],
)
def test_what_a_show_says_wrong_about_cards_is_refused(
    section: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=message.replace("?", r"\?")):
        load_show(write_show(tmp_path, **section))
    cues = [{"name": "c", "card": "none", "camera": {"angle_deg": 90}}, {"name": "d", "card": "blank"}]
    assert load_show(write_show(tmp_path, cues=cues)).config.names["card"] == ("blank",)


def test_cards_lie_over_the_look_and_under_masters_and_masks(gl: moderngl.Context, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    white = [{"name": "white", "background": "#ffffff"}]
    door = MaskConfig(points=[(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.0, 1.0)], soft=0.0)
    show = write_show(tmp_path / "show", cards=white)
    evening = Evening(gl, tmp_path / "run", show, ProjectorConfig(masks=[door]))
    evening.begin()
    for _ in range(90):
        evening.picture(SIZE)
    evening.declare(ShowState().to(CARD, "white").to(MASTER, 0.5, evening.now, 0.0))
    for direct in (True, False):  # onto the display, and through a texture
        seen = evening.picture(SIZE, lines=() if direct else ("x",))[SIZE[1] // 2 :]
        assert not seen[:, : SIZE[0] // 2].any()
        assert np.abs(seen[:, SIZE[0] // 2 :].astype(int) - 128).max() <= 2
    evening.declare(evening.show_state.to(CARD, ""))
    assert evening.picture(SIZE)[-1, -1, 1] < 60
    evening.close()
