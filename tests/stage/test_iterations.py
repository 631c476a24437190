"""Iterations: within what fits, at once or step by step."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.stage.iterations import Iterations

TIMES = st.tuples(st.integers(0, 64), st.integers(0, 64))


@pytest.mark.parametrize(
    ("asked", "danced"),
    [
        ((5, 4), (5, 4)),
        ((12, 11), (8, 7)),
        ((12, 2), (8, 1)),
        ((60, 1), (8, 1)),
        ((12, 0), (8, 0)),
        ((3, 3), (3, 3)),
        ((0, 0), (1, 0)),
    ],
)
def test_without_a_fade_they_change_at_once_within_what_fits(
    asked: tuple[int, int], danced: tuple[int, int]
) -> None:
    iterations = Iterations(3, 2, most=8)
    message = iterations.ask(*asked)
    assert (iterations.coding, iterations.interaction) == danced
    assert (f"with {danced[0]} and {danced[1]}: " in message) == (asked != danced)
    assert ("at most 8 fit" in message) == (asked[0] > 8)


def test_a_fade_goes_in_steps_and_takes_its_time() -> None:
    iterations = Iterations(10, 9, most=20)
    iterations.ask(4, 3, 2.0)
    course = []
    for _ in range(101):
        course.append((iterations.coding, iterations.interaction))
        iterations.advance()
    assert course[0] == (10, 9) and course[50] == (7, 6) and course[-1] == (4, 3)
    assert all(before[0] - after[0] in (0, 1) for before, after in pairwise(course))
    assert all(coding - interaction == 1 for coding, interaction in course)


def test_a_change_during_a_fade_begins_where_it_has_come_to() -> None:
    iterations = Iterations(10, 9, most=20)
    iterations.ask(4, 3, 2.0)
    for _ in range(50):
        iterations.advance()
    iterations.ask(10, 9, 1.0)
    assert (iterations.coding, iterations.interaction) == (7, 6)
    for _ in range(200):
        iterations.advance()
    assert (iterations.coding, iterations.interaction) == (10, 9)


@settings(deadline=None)
@given(begin=TIMES, asked=TIMES, most=st.integers(1, 64), fade_s=st.floats(0, 3))
def test_they_are_never_more_than_fit_nor_interactions_more_than_codings(
    begin: tuple[int, int], asked: tuple[int, int], most: int, fade_s: float
) -> None:
    iterations = Iterations(1, 0, most)
    iterations.ask(*begin)
    iterations.ask(*asked, fade_s)
    for _ in range(160):
        iterations.advance()
        assert 1 <= iterations.coding <= most
        assert 0 <= iterations.interaction <= iterations.coding
