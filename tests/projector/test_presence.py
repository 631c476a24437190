"""The picture fades out half a second after the last fresh frame, and is back within half a second."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.projector.loop import FADE_S, STALE_S, Presence

RATE = 60


def levels(presence: Presence, times: np.ndarray, newest: float | None = None) -> list[float]:
    """`newest` None: a fresh frame each time."""
    return [presence.step(now if newest is None else newest, now) for now in times]


def test_it_starts_in_the_dark_and_stays_there_without_frames() -> None:
    presence = Presence()
    assert [presence.step(None, now) for now in np.arange(0, 3, 1 / RATE)] == [0.0] * (3 * RATE)


def test_it_comes_within_half_a_second() -> None:
    found = levels(Presence(), np.arange(0, 1, 1 / RATE))
    assert found[0] == 0.0 and 0.0 < found[15] < 1.0
    assert found[31] == 1.0


def test_it_fades_half_a_second_after_the_last_frame_over_half_a_second() -> None:
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    times = np.arange(1, 2.5, 1 / RATE)
    found = dict(zip(times - 1, levels(presence, times, newest=1.0), strict=True))
    assert all(level == 1.0 for since, level in found.items() if since < 0.5)
    assert all(0.3 < level < 0.7 for since, level in found.items() if 0.72 < since < 0.78)
    assert all(level == 0.0 for since, level in found.items() if since > 1.04)


def test_a_short_gap_is_not_seen() -> None:
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    assert levels(presence, np.arange(1, 1.45, 1 / RATE), newest=1.0)[-1] == 1.0


def test_a_slow_display_fades_as_fast() -> None:
    presence = Presence()
    assert levels(presence, np.arange(0, 0.7, 0.2)) == pytest.approx([0.0, 0.4, 0.8, 1.0])


@pytest.mark.parametrize("held_up_s", [0.5, 1.0, 5.0])
def test_a_pause_of_the_whole_machine_is_invisible(held_up_s: float) -> None:
    """The projector wakes some pictures before the stage does."""
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    times = 1.0 + held_up_s + np.arange(0, 0.2, 1 / RATE)
    assert set(levels(presence, times, newest=1.0)) == {1.0} and presence.sees_stage


def test_a_stage_that_died_during_a_pause_fades_as_usual() -> None:
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    found = levels(presence, np.arange(6, 7.1, 1 / RATE), newest=1.0)
    assert np.diff(found).min() > -0.05
    assert found[0] == 1.0 and found[-1] == 0.0 and not presence.sees_stage


def test_a_pause_during_the_fade_to_black_makes_no_jump() -> None:
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    before = levels(presence, np.arange(1, 1.6, 1 / RATE), newest=1.0)[-1]
    assert 0.7 < before < 0.9
    assert before - presence.step(1.0, 6.0) == pytest.approx(0.5)


@pytest.mark.parametrize("rate", [1.0, 2.0, 3.0])
def test_few_pictures_a_second_fade_out_in_the_same_time(rate: float) -> None:
    presence = Presence(rate)
    times = np.arange(0, 6, 1 / rate)
    levels(presence, times)
    found = levels(presence, times + 6.0, newest=6.0)
    black_after_s = times[found.index(0.0)]
    assert STALE_S <= black_after_s <= STALE_S + FADE_S + 1 / rate


@pytest.mark.parametrize("period_s", [0.3, 0.5, 1.0])
def test_a_machine_that_does_not_keep_up_fades_out_in_the_same_time(period_s: float) -> None:
    presence = Presence()
    times = np.arange(0, 6, period_s)
    levels(presence, times)
    found = levels(presence, 6.0 + times, newest=6.0)
    black_after_s = times[found.index(0.0)]
    assert STALE_S <= black_after_s <= STALE_S + FADE_S + period_s / 2


def test_another_show_begins_in_the_dark() -> None:
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    presence.hide()
    assert presence.step(1.0, 1.0 + 1 / RATE) < 0.1
