"""The test card: what a technician looks for is there, and it never covers a panic."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import segno

from appliance.box.orders import Order
from appliance.projector.alignment import Alignment
from appliance.projector.controls import Controls
from appliance.projector.keyboards import Key
from appliance.projector.keys import press
from appliance.projector.picture.test_card import GREYS, NEAR, OVERSCAN, Image
from appliance.projector.picture.test_card import test_card as drawn

SIZES = [(1280, 720), (1920, 1080), (1024, 768), (800, 1280)]
ADDRESS = "https://192.168.7.12:8443"
LINES = ("bunraku-box", f"page {ADDRESS}", "pin 482913", "1280x720 kmsdrm")


def runs(values: np.ndarray) -> list[int]:
    """Each value of a row, once for each run of equal ones."""
    return [int(values[0]), *(int(b) for a, b in pairwise(values) if a != b)]


def card(size: tuple[int, int]) -> Image:
    return drawn(size, LINES, ADDRESS)


@pytest.mark.parametrize("size", SIZES)
def test_the_outermost_pixels_and_the_overscan_are_marked(size: tuple[int, int]) -> None:
    image = card(size).astype(int)
    assert image.shape == (size[1], size[0], 3)
    for edge in (image[0], image[-1], image[:, 0], image[:, -1]):
        assert (edge == 255).all()
    row = image[round(0.5 * size[1] + 7.5 * min(size[1] / 36, size[0] / 64)), : size[0] // 8, 0]
    for share in OVERSCAN:
        assert row[round(share * size[0])] > 100


@pytest.mark.parametrize("size", SIZES)
def test_the_circle_is_as_wide_as_it_is_high(size: tuple[int, int]) -> None:
    width, height = size
    image, radius = card(size)[..., 0], 16 * min(height / 36, width / 64)
    if 2 * radius < width:
        left = image[height // 2 - 2, : width // 2]
        found = np.flatnonzero(left == 255)
        assert np.abs(found - (width / 2 - radius)).min() < 3
    assert image[round(height / 2 - radius) : round(height / 2 - radius) + 3, width // 2].max() == 255


def test_greys_rise_from_black_to_white_in_even_steps() -> None:
    image = card((1280, 720))
    row = runs(image[178, 371:909, 0])
    assert len(row) == GREYS and (row[0], row[-1]) == (0, 255)
    assert np.ptp(np.diff(row)) <= 1
    assert runs(image[545, 371:909, 0]) == list(NEAR)
    assert runs(image[582, 371:909, 0]) == [255 - level for level in reversed(NEAR)]


@pytest.mark.parametrize("size", [(640, 360), (1280, 720)])
def test_name_and_pin_are_larger_than_the_other_words(size: tuple[int, int]) -> None:
    """8 m from a picture 2 m high the PIN is 0.7 degrees tall: eight times what an eye needs."""
    unit = size[1] // 36
    words = card(size)[11 * unit : 25 * unit, 28 * unit : 45 * unit, 0] > 200
    rows = np.flatnonzero(np.diff(np.concatenate([[False], words.any(axis=1), [False]]).astype(int)))
    name, page, pin, mode = rows[1::2] - rows[::2]
    assert min(name, pin) > 1.4 * max(page, mode) and min(name, pin) >= 1.8 * unit


@pytest.mark.parametrize("more", [0, 4])
def test_each_step_next_to_black_and_white_has_its_number(more: int) -> None:
    """Many words leave them free."""
    image = drawn((1280, 720), (*LINES, *["network bunraku-4f2a"] * more), ADDRESS)[..., 0]
    for top, bottom in ((505, 522), (607, 624)):
        columns = (image[top:bottom, 371:909] > 100).any(axis=0)
        across = 538 / len(NEAR)
        for number in range(len(NEAR)):
            middle = round((number + 0.5) * across)
            assert 6 < np.count_nonzero(columns[middle - 20 : middle + 20]) < 40


def test_lines_of_one_pixel_tell_the_focus() -> None:
    image = card((1280, 720))[..., 0]
    fine = image[420:440, 80:340]
    assert (np.abs(np.diff(fine.astype(int), axis=1)).max(axis=0) == 255).sum() > 40


def test_a_phone_reads_the_address() -> None:
    """The modules of the code, black and white, are in the picture as large squares."""
    image = card((1280, 720))[..., 0]
    modules = np.array([list(row) for row in segno.make(ADDRESS, error="m", micro=False).matrix], bool)
    times = round(10 * 20 / (len(modules) + 8))
    wanted = np.kron(np.where(np.pad(modules, 4), 0, 255), np.ones((times, times))).astype(np.uint8)
    tall, wide = wanted.shape
    top = (720 - tall) // 2
    places = [x for x in range(1280 - wide) if np.array_equal(image[top : top + tall, x : x + wide], wanted)]
    assert len(places) == 1
    assert not np.array_equal(image, drawn((1280, 720), LINES, "https://192.168.7.13:8443")[..., 0])


def test_orders_and_the_key_show_and_hide_it() -> None:
    controls = Controls(Alignment(), lambda _: None)
    assert controls.carry_out(Order("test_card", (1,)))[0] and controls.report()["test_card"]
    assert press(Key("T"), controls, (1280, 720)) and not controls.shows_test_card


@pytest.mark.parametrize("overlap", [0.1, 0.25, 0.5])
@pytest.mark.parametrize("part", ["left", "right", "top", "bottom"])
def test_the_overlap_is_marked_and_the_words_are_beside_it(part: str, overlap: float) -> None:
    """Even greys reach across it: where blending is wrong, they show a band."""
    whole = 1280 * (2 - overlap), 720 * (2 - overlap)
    size = (round(whole[0]), 720) if part in ("left", "right") else (1280, round(whole[1]))
    image = drawn(size, LINES, ADDRESS, (part, overlap)).astype(int)
    if part in ("top", "bottom"):
        image = image.swapaxes(0, 1)
    orange = np.flatnonzero((image == (255, 128, 0)).all(axis=2).mean(axis=0) > 0.95)
    shared = (1280 if part in ("left", "right") else 720) * overlap
    assert np.ptp(orange) == pytest.approx(shared, abs=3)
    assert orange.mean() == pytest.approx(image.shape[1] / 2, abs=2)
    middle = image[image.shape[0] // 2, orange[0] - 8 : orange[-1] + 8, 0]
    assert set(middle.tolist()) == {112, 255}, "a grey and the two lines"
    plain = drawn(size, (), "", (part, overlap)).astype(int)
    if part in ("top", "bottom"):
        plain = plain.swapaxes(0, 1)
    written = np.flatnonzero((image != plain).any(axis=(0, 2)))
    own = written < orange[0] if part in ("left", "top") else written > orange[-1]
    assert len(written) > 50 and own.all()
