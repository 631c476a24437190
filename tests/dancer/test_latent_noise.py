"""The noise of a latent: variance 1, slow, the same for the same seed and tick, and no jump at a new seed."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.dancer.latent_noise import CROSSFADE_TICKS, FASTEST_HZ, SLOWEST_HZ, LatentNoise

LATENTS = 24
HOUR = 180_000  # ticks
FASTEST = 2 * np.pi * FASTEST_HZ * 0.02  # how much of its amplitude a sinusoid changes by in a tick


def course(noise: LatentNoise, first: int, last: int, step: int = 1) -> np.ndarray:
    """(ticks, P, Z)."""
    return np.array([noise.at(tick).copy() for tick in range(first, last, step)])


def test_each_latent_has_mean_0_and_variance_1_over_time() -> None:
    values = course(LatentNoise(7, 2, LATENTS), 0, HOUR, 5)
    assert np.abs(values.mean(axis=0)).max() < 0.02
    np.testing.assert_allclose(values.var(axis=0), 1.0, atol=0.03)


def test_latents_and_puppets_are_independent() -> None:
    values = course(LatentNoise(7, 2, LATENTS), 0, HOUR, 5).reshape(HOUR // 5, -1)
    correlations = np.corrcoef(values.T) - np.eye(2 * LATENTS)
    assert np.abs(correlations).mean() < 0.02 and np.abs(correlations).max() < 0.6


@pytest.mark.parametrize("first", [0, 10**6, 2**32 - 250, 10**10])
def test_it_is_slow_also_after_months(first: int) -> None:
    """Of the power of ten minutes next to nothing is outside the frequencies that it may have."""
    values = course(LatentNoise(3, 1, LATENTS), first, first + 30_000)[:, 0]
    assert np.abs(np.diff(values, axis=0)).max() < 3.5 * FASTEST
    hertz = np.fft.rfftfreq(len(values), 0.02)
    power = (np.abs(np.fft.rfft(values * np.hanning(len(values))[:, None], axis=0)) ** 2).sum(axis=1)
    inside = (hertz > 0.9 * SLOWEST_HZ) & (hertz < 1.1 * FASTEST_HZ)
    assert power[inside].sum() > 0.999 * power.sum()


def test_seed_and_tick_say_all() -> None:
    """Also where ticks were skipped, or came out of order."""
    noise, other = LatentNoise(11, 2, LATENTS), LatentNoise(11, 2, LATENTS)
    values = course(noise, 0, 300)
    for tick in (299, 5, 120):
        assert other.at(tick).tobytes() == values[tick].tobytes()


def test_it_is_the_same_on_every_machine_and_with_every_numpy() -> None:
    """What a seed meant on one evening it means on all later ones; single precision's last bit may differ."""
    golden = [[-0.962649, 1.437509, -1.016624]]
    np.testing.assert_allclose(LatentNoise(1, 1, 3).at(12_345), golden, atol=1e-5)


def test_another_seed_is_another_noise_and_a_puppet_has_the_seed_plus_its_number() -> None:
    values = course(LatentNoise(4, 1, LATENTS), 0, 5000, 10)
    others = course(LatentNoise(5, 1, LATENTS), 0, 5000, 10)
    assert np.abs(values - others).mean() > 0.8
    both = course(LatentNoise(4, 2, LATENTS), 0, 5000, 10)
    np.testing.assert_array_equal(both[:, 0], values[:, 0])
    np.testing.assert_array_equal(both[:, 1], others[:, 0])


def test_a_stage_that_begins_later_goes_on() -> None:
    first, second = LatentNoise(4, 1, LATENTS), LatentNoise(4, 1, LATENTS)
    second.begins_at = 1000
    np.testing.assert_array_equal(course(first, 1000, 1010), course(second, 0, 10))


def test_a_new_seed_crosses_over_without_a_jump_and_with_the_same_variance() -> None:
    rng, within, fastest = np.random.default_rng(0), list[np.ndarray](), 0.0
    for seed in rng.integers(0, 2**31, 60).tolist():
        noise = LatentNoise(seed, 1, LATENTS)
        begin = course(noise, 0, 200)
        noise.change(seed + 1)
        fade = course(noise, 200, 200 + CROSSFADE_TICKS)
        end = course(noise, 200 + CROSSFADE_TICKS, 500)
        target = course(LatentNoise(seed + 1, 1, LATENTS), 200 + CROSSFADE_TICKS, 500)
        np.testing.assert_array_equal(end, target)
        fastest = max(fastest, np.abs(np.diff(np.concatenate([begin, fade, end]), axis=0)).max())
        within.append(fade)
    assert fastest < 0.15  # of a standard deviation in a tick
    assert np.var(np.array(within)[:, 40:60]) == pytest.approx(1.0, abs=0.1)


def test_before_the_first_tick_a_new_seed_is_there_at_once() -> None:
    noise = LatentNoise(1, 1, LATENTS)
    noise.change(2)
    assert noise.seed == 2
    np.testing.assert_array_equal(noise.at(0), LatentNoise(2, 1, LATENTS).at(0))


def test_seeds_that_come_during_a_crossfade_wait_and_the_newest_counts() -> None:
    noise = LatentNoise(1, 1, LATENTS)
    values = [course(noise, 0, 10)]
    for seed, tick in ((2, 10), (3, 20), (4, 30)):
        noise.change(seed)
        values.append(course(noise, tick, tick + 10))
    assert noise.seed == 4
    values.append(course(noise, 40, 300))
    assert np.abs(np.diff(np.concatenate(values), axis=0)).max() < 0.15
    np.testing.assert_allclose(values[-1][108 - 40], LatentNoise(2, 1, LATENTS).at(108), atol=0.08)
    np.testing.assert_array_equal(values[-1][-1], LatentNoise(4, 1, LATENTS).at(299))


def test_the_seed_in_force_again_changes_nothing() -> None:
    noise, other = LatentNoise(1, 1, LATENTS), LatentNoise(1, 1, LATENTS)
    np.testing.assert_array_equal(course(noise, 0, 10), course(other, 0, 10))
    noise.change(1)
    np.testing.assert_array_equal(course(noise, 10, 200), course(other, 10, 200))


@pytest.mark.parametrize("ticks", [0, 50, CROSSFADE_TICKS, CROSSFADE_TICKS + 50, 3 * CROSSFADE_TICKS])
def test_it_goes_on_from_a_state_in_the_middle_of_crossfades(ticks: int) -> None:
    noise, other = LatentNoise(1, 2, LATENTS), LatentNoise(0, 2, LATENTS)
    noise.begins_at = 77
    course(noise, 0, 10)
    noise.change(2)
    course(noise, 10, 11)
    noise.change(3)
    course(noise, 11, 11 + ticks)
    restore(other, packed(noise))
    assert (other.seed, other.begins_at) == (3, 77)
    np.testing.assert_array_equal(course(noise, 11 + ticks, 500), course(other, 11 + ticks, 500))


def test_a_tick_makes_nothing_for_the_collector() -> None:
    noise = LatentNoise(1, 4, 32)
    noise.at(0)
    noise.change(2)
    gc.collect()
    gc.disable()
    try:
        before = gc.get_count()[0]
        for tick in range(1, 300):
            noise.at(tick)
        assert gc.get_count()[0] - before < 10
    finally:
        gc.enable()
