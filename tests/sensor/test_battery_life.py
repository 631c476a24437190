"""How long a battery lasts: known after a while, and rather too short than too long."""

from __future__ import annotations

import random

from appliance.sensor.battery_life import UNKNOWN_S, BatteryLife

HOUR_S = 3600.0


def test_what_is_left_is_known_after_a_while_and_no_longer_than_it_lasts() -> None:
    life, rng, lasts_s = BatteryLife(), random.Random(1), 3 * HOUR_S
    reported = []
    for now in range(round(lasts_s)):
        percent = round(100 * (1 - now / lasts_s) + rng.uniform(-0.7, 0.7))
        life.hear(max(0, percent), float(now))
        if life.left_s != UNKNOWN_S:
            reported.append((life.left_s, lasts_s - now))
    assert 0.05 * lasts_s < lasts_s - len(reported) < 0.2 * lasts_s
    assert all(left <= truly + 300.0 for left, truly in reported)
    left, truly = reported[len(reported) // 2]
    assert left > 0.6 * truly


def test_it_says_nothing_after_a_charge_or_another_battery() -> None:
    life = BatteryLife()
    for now in range(0, 7200, 10):
        life.hear(90 - now // 240, float(now))
    assert life.left_s > 0.0
    life.hear(100, 7300.0)
    assert life.left_s == UNKNOWN_S


def test_hours_in_which_it_is_off_do_not_count() -> None:
    life = BatteryLife()
    for now in range(0, 3600, 10):
        life.hear(90 - now // 240, float(now))
    before = life.left_s
    life.pause()
    life.hear(90 - 3590 // 240, 10 * HOUR_S)
    assert life.left_s == before
