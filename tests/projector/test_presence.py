"""The picture fades out half a second after the last fresh frame, and is back within half a second."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.projector.presence import Presence

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


def test_another_show_begins_in_the_dark() -> None:
    presence = Presence()
    levels(presence, np.arange(0, 1, 1 / RATE))
    presence.hide()
    assert presence.step(1.0, 1.0 + 1 / RATE) < 0.1
