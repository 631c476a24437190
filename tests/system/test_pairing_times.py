"""How long a sensor takes to join the show: medians over seeds, in virtual time, with 20 ms ticks."""

from __future__ import annotations

from statistics import median

import pytest

from hw_sim import motions
from tests.system.lockstep import EPOCH_S, Lockstep, lockstep

SEEDS = range(1, 16)
TICK_S = 0.02


def _run_until_accepted(stage: Lockstep) -> float:
    """The time at which the tick got the next reading."""
    before = len(stage.accepted)
    assert stage.run(20.0, until=lambda: len(stage.accepted) > before)
    return stage.accepted[before].at


@pytest.fixture(scope="module")
def times_s() -> dict[str, list[float]]:
    """For each seed: to the tick from the network, from the switch, and from the box's restart."""
    times: dict[str, list[float]] = {"network": [], "switch": [], "restart": []}
    for seed in SEEDS:
        with lockstep(["left-wrist"], seed, lambda number: motions.dance(3), TICK_S) as stage:
            (sensor,) = stage.sensors
            stage.box_on()
            stage.run(0.001 * seed)
            sensor.wearable.power(True)
            accepted_at = _run_until_accepted(stage)
            times["switch"].append(accepted_at - EPOCH_S)
            times["network"].append(accepted_at - sensor.wearable.status.joined_at_us * 1e-6)
            stage.run(3.0 + 0.07 * seed)
            stage.box_off()
            stage.box_on()
            restarted_at = stage.now
            times["restart"].append(_run_until_accepted(stage) - restarted_at)
    return times


def _say(what: str, times_s: list[float]) -> None:
    print(f"{what}: median {median(times_s):.3f} s, {min(times_s):.3f} to {max(times_s):.3f} s, virtual time")


def test_from_the_network_to_the_first_reading_used(times_s: dict[str, list[float]]) -> None:
    _say("network up to first reading used", times_s["network"])
    _say("power switch to first reading used", times_s["switch"])
    assert median(times_s["network"]) <= 1.0


def test_from_the_box_restarted_to_readings_used_again(times_s: dict[str, list[float]]) -> None:
    _say("box restarted to readings used again", times_s["restart"])
    assert median(times_s["restart"]) <= 1.5
