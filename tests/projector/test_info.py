"""The small letters and the figures."""

from __future__ import annotations

import pytest

from appliance.projector.info import Meter, letters


def test_letters_are_drawn_as_they_are_written() -> None:
    drawn = ["".join(".#"[int(value > 0)] for value in row) for row in letters(("a1",))]
    assert drawn[1:6] == [
        "..#...#..",
        ".#.#.##..",
        ".###..#..",
        ".#.#..#..",
        ".#.#.###.",
    ]


def test_no_letter_looks_like_another() -> None:
    known = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.,:-%/()_+ "
    images = {letters((one,)).tobytes() for one in known}
    assert len(images) == len(known)


def test_nothing_to_say_and_unknown_letters_are_empty() -> None:
    assert not letters(()).any()
    assert not letters(("ä☃",)).any()


def test_frame_ages_and_rate() -> None:
    meter = Meter()
    for k in range(1001):
        meter.note_swap(10 + k / 50, 10 + k / 50 - (0.02 if k else 0.3))
    figures = meter.figures()
    assert figures.rate == pytest.approx(50)
    assert (figures.age_p50_ms, figures.pictures, figures.dances) == (pytest.approx(20), 1001, 1001)
    assert figures.age_p99_ms == pytest.approx(20)
    assert "50.0 pictures/s" in figures.sentence()


def test_the_rate_is_that_of_the_last_seconds() -> None:
    meter = Meter()
    meter.note_swap(0.0, None)
    for k in range(60):
        meter.note_swap(5 + k / 10, None)  # the first looks took a while
    assert meter.figures().rate == pytest.approx(10)


def test_pictures_without_a_dance_have_no_age() -> None:
    meter = Meter()
    assert meter.figures().rate == 0
    meter.note_swap(1.0, None)
    meter.note_swap(1.1, None)
    assert meter.figures().age_p50_ms is None
    assert "no dance" in meter.figures().sentence()
