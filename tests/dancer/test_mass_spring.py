"""The mass-spring system against physics: periods, energy, momentum, and what it bears at its bounds."""

from __future__ import annotations

import math
from random import Random

import numpy as np
import pytest

from appliance.dancer.mass_spring import FASTEST_M_S, MassSpring

TICK_S = 0.02
DOWN = np.array([0.0, -9.81, 0.0])
STILL = np.zeros(3)


def system(parents: list[int], anchored: bool = True, **parameters: float) -> MassSpring:
    """Bones of half a metre that point down, at rest."""
    made = MassSpring(parents, anchored)
    given = {"mass": 1.0, "stiffness": 0.0, "directional": 0.0, "damping": 0.0} | parameters
    made.set_parameters(*(np.full(len(parents), value) for value in given.values()))
    made.rest[1:] = [0.0, -0.5, 0.0]
    positions = np.zeros((len(parents), 3))
    for node, parent in enumerate(parents[1:], 1):
        positions[node] = positions[parent] + made.rest[node]
    made.begin(positions)
    return made


def course(one: MassSpring, seconds: float, gravity: np.ndarray = STILL) -> np.ndarray:
    """Positions (ticks, N, 3) of the masses while the anchor stands."""
    anchor, flow = one.positions[0].copy(), np.zeros_like(one.positions)
    found = []
    for _ in range(round(seconds / TICK_S)):
        one.step(anchor, flow, gravity)
        found.append(one.positions.copy())
    return np.array(found)


def period_s(course: np.ndarray) -> float:
    """Of a swing: between its first and last upward crossing of the middle."""
    swing = course - course.mean()
    places = np.flatnonzero((swing[:-1] < 0) & (swing[1:] >= 0))
    crossings = places + swing[places] / (swing[places] - swing[places + 1])
    return TICK_S * float(crossings[-1] - crossings[0]) / (len(crossings) - 1)


def test_a_mass_on_a_spring_swings_with_the_period_of_the_textbook() -> None:
    one = system([-1, 0], mass=2.0, stiffness=200.0)
    one.positions[1, 1] -= 0.05
    assert period_s(course(one, 20.0)[:, 1, 1]) == pytest.approx(2 * math.pi * math.sqrt(2 / 200), rel=0.01)


def test_a_mass_drawn_to_its_direction_swings_with_the_period_of_that_spring() -> None:
    one = system([-1, 0], mass=2.0, directional=80.0)
    one.positions[1, 0] += 0.05
    assert period_s(course(one, 20.0)[:, 1, 0]) == pytest.approx(2 * math.pi * math.sqrt(2 / 80), rel=0.01)


def test_a_pendulum_swings_with_the_period_of_the_textbook() -> None:
    one = system([-1, 0], mass=1.0, stiffness=20000.0)
    one.positions[1] = 0.5 * np.array([math.sin(0.1), -math.cos(0.1), 0.0])
    length = 0.5 + 9.81 / 20000
    found = period_s(course(one, 30.0, DOWN)[:, 1, 0])
    assert found == pytest.approx(2 * math.pi * math.sqrt(length / 9.81) * (1 + 0.1**2 / 16), rel=0.01)


def test_without_damping_energy_stays_and_with_damping_it_decays_at_its_rate() -> None:
    for damping in (0.0, 0.5, 2.0):
        one = system([-1, 0], stiffness=100.0, damping=damping)
        one.positions[1, 1] -= 0.1
        before = one.energy()
        course(one, 2.0)
        # a weakly damped oscillator loses energy at the rate of its damping
        assert one.energy() == pytest.approx(before * math.exp(-damping * 2.0), rel=0.1)


def test_a_whole_body_keeps_its_energy_within_two_percent_when_nothing_damps_it() -> None:
    one = system([-1, 0, 1, 1, 2, 3], stiffness=2000.0, directional=50.0)
    one.velocities[1:] = np.random.default_rng(3).normal(size=(5, 3))
    before = one.energy(DOWN)
    for _ in range(20):
        course(one, 1.0, DOWN)
        assert one.energy(DOWN) == pytest.approx(before, rel=0.02)


def test_a_free_body_keeps_its_momentum() -> None:
    one = system([-1, 0, 1, 1], anchored=False, stiffness=500.0, directional=80.0)
    one.set_parameters(np.array([1.0, 2.0, 3.0, 4.0]), one.stiffness, one.directional, one.damping)
    one.velocities[:] = np.random.default_rng(7).normal(size=(4, 3))
    before = one.mass @ one.velocities
    course(one, 5.0)
    assert np.allclose(one.mass @ one.velocities, before, atol=1e-9)


def test_a_flow_carries_masses_along() -> None:
    one = system([-1, 0], anchored=False, damping=2.0)
    flow = np.tile([1.0, 0.0, 0.5], (2, 1))
    for _ in range(50):
        one.step(STILL, flow, STILL)
    assert np.allclose(one.velocities, flow * (1 - math.exp(-2.0)), rtol=1e-6)


@pytest.mark.parametrize("anchored", [True, False])
def test_nothing_bursts_at_the_bounds_of_its_parameters(anchored: bool, rng: Random) -> None:
    for _ in range(12):
        parents = [-1, *(rng.randrange(node) for node in range(1, 18))]
        one = system(parents, anchored)
        either = {
            "mass": (0.05, 50.0),
            "stiffness": (0.0, 1e6),
            "directional": (0.0, 1e5),
            "damping": (0, 60.0),
        }
        one.set_parameters(*(np.array([rng.choice(two) for _ in parents]) for two in either.values()))
        noise = np.random.default_rng(rng.randrange(1 << 30))
        for _ in range(100):
            one.rest[1:] = noise.normal(size=(17, 3))
            one.velocities += noise.normal(size=(18, 3)) * 20
            one.step(noise.normal(size=3), noise.normal(size=(18, 3)) * 30, DOWN)
        assert np.isfinite(one.positions).all()
        flow = np.zeros((18, 3))
        for _ in range(100):
            one.step(one.positions[0].copy(), flow, STILL)
        worst = 18 * 50 * 3 * FASTEST_M_S**2 / 2 + (one.stiffness + one.directional).sum() * 100
        assert one.energy() < worst


def test_light_masses_on_the_stiffest_springs_come_to_rest() -> None:
    """Some shook for ever: through a bone's own start, and from the bound of the stretch and back."""
    noise = np.random.default_rng(5)
    for parents, stretch_m, speed_m_s in [*[([-1, 0], 0.0, 20.0)] * 10, ([-1, 0, 1], 3.0, 400.0)]:
        one = system(parents, len(parents) == 2, mass=0.05, stiffness=1e6, damping=0.5)
        one.rest[1:] = [0.0, -0.05, 0.0]
        one.begin(np.cumsum(one.rest, axis=0))
        one.positions[1:, 0] += stretch_m
        one.velocities[1:] = noise.normal(size=3) * speed_m_s
        course(one, 20.0)
        assert one.energy() < 0.01
