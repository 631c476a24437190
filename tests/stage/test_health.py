"""The line once a second says what a technician must know."""

from __future__ import annotations

from appliance.stage.health import Health


def danced(costs_ms: list[float]) -> Health:
    health = Health()
    health.begin(100.0)
    for cost_ms in costs_ms:
        health.tick(cost_ms, budget_ms=10.0)
    return health


def test_a_good_second() -> None:
    health = danced([1.5] * 49 + [3.0])
    assert not health.is_due(100.98)
    assert health.is_due(101.0)
    health.look(101.0)
    line = health.line(10, 9, 0.012, locked=True)
    assert " ".join(line.split()) == (
        "50.0 Hz tick 1.5/1.5 ms (p50/p99) late 0 sensor 12 ms ago, in phase iterations 10/9"
    )


def test_trouble_is_named_and_counted() -> None:
    health = danced([1.0] * 40 + [12.0] * 2)
    health.late, health.skipped, health.not_finite = 3, 2, 1
    health.look(101.0)
    line = health.line(10, 9, 0.5, locked=False)
    assert "42.0 Hz" in line
    assert "late 3" in line
    assert "skipped 2" in line
    assert "over budget 2" in line
    assert "network not finite 1" in line
    assert "in phase" not in line
    assert health.worst_ms == 12.0


def test_each_line_covers_its_own_second() -> None:
    health = danced([9.0] * 50)
    health.look(101.0)
    for _ in range(25):
        health.tick(1.0, budget_ms=10.0)
    health.look(102.0)
    line = health.line(10, 9, None, locked=False)
    assert "25.0 Hz" in line
    assert "1.0/1.0 ms" in line
    assert "no sensor" in line


def test_a_sensor_that_was_never_heard() -> None:
    health = danced([1.0])
    health.look(101.0)
    assert "not heard yet" in health.line(10, 9, float("inf"), locked=False)


def test_a_second_without_ticks_has_a_line_too() -> None:
    health = danced([])
    health.look(101.0)
    assert "0.0 Hz" in health.line(10, 9, None, locked=False)


def test_the_snapshot_has_the_last_second_and_the_counters_of_the_run() -> None:
    health = danced([2.0] * 50)
    health.late = 3
    health.look(101.0)
    for _ in range(10):
        health.tick(12.0, budget_ms=10.0)
    assert health.snapshot(101.25) == {
        "rate_hz": 50.0,
        "late": 3,
        "skipped": 0,
        "over_budget": 10,
        "not_finite": 0,
        "ticks": 60,
        "tick_p50_ms": 2.0,
        "tick_p99_ms": 2.0,
        "uptime_s": 1.25,
    }
