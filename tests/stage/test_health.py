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
    line = health.line(101.0, 10, 9, 0.012, locked=True)
    assert " ".join(line.split()) == (
        "50.0 Hz tick 1.5/1.5 ms (p50/p99) late 0 sensor 12 ms ago, in phase iterations 10/9"
    )


def test_trouble_is_named_and_counted() -> None:
    health = danced([1.0] * 40 + [12.0] * 2)
    health.late, health.skipped, health.not_finite = 3, 2, 1
    line = health.line(101.0, 10, 9, 0.5, locked=False)
    assert "42.0 Hz" in line
    assert "late 3" in line
    assert "skipped 2" in line
    assert "over budget 2" in line
    assert "network not finite 1" in line
    assert "in phase" not in line
    assert health.worst_ms == 12.0


def test_each_line_covers_its_own_second() -> None:
    health = danced([9.0] * 50)
    health.line(101.0, 10, 9, None, locked=False)
    for _ in range(25):
        health.tick(1.0, budget_ms=10.0)
    line = health.line(102.0, 10, 9, None, locked=False)
    assert "25.0 Hz" in line
    assert "1.0/1.0 ms" in line
    assert "no sensor" in line


def test_a_sensor_that_was_never_heard() -> None:
    assert "not heard yet" in danced([1.0]).line(101.0, 10, 9, float("inf"), locked=False)


def test_a_second_without_ticks_has_a_line_too() -> None:
    assert "0.0 Hz" in danced([]).line(101.0, 10, 9, None, locked=False)
