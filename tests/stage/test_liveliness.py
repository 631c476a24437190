"""How alive puppets answer: what commands and cues change, without a jump; restarts; what chance repeats."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.box.clock import Slot
from appliance.box.orders import Order
from appliance.box.snapshot import packed, restore
from appliance.dancer.latent_noise import LatentNoise
from appliance.show.show import Show, load_show
from appliance.stage.carry_out import obey
from appliance.stage.liveliness import LEAST_FADE_S
from appliance.stage.reconcile import Reconciler
from appliance.stage.resume import Resumption
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from tests.bundles import write_show
from tests.stage.declared import Commanded
from tests.stage.shows import BOX, NOW


def danced(parts: StageParts, ticks: int, begin: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Liveliness (ticks,) and noise (ticks, Z) of the first puppet."""
    levels, noises = [], []
    for tick in range(begin, begin + ticks):
        parts.liveliness.dance(tick)
        levels.append(parts.led.liveliness)
        noises.append(parts.led.noise.copy())
        parts.liveliness.advance()
    return np.array(levels), np.array(noises)


def test_the_show_says_how_it_begins(tmp_path: Path) -> None:
    dancer = {"coding_iterations": 2, "liveliness": 0.5, "seed": 5}
    parts = assemble(load_show(write_show(tmp_path / "show", dancer=dancer)), BOX)
    levels, noises = danced(parts, 3)
    assert levels.tolist() == [0.5] * 3
    expected = [LatentNoise(5, 1, 1).at(tick)[0] for tick in range(3)]
    np.testing.assert_allclose(noises, expected, rtol=1e-6)
    parts.close()


def test_without_a_word_about_it_every_evening_is_the_same_and_as_alive_as_the_dancer(
    tmp_path: Path,
) -> None:
    show = load_show(write_show(tmp_path / "show"))
    evenings = []
    for _ in range(2):
        parts = assemble(show, BOX)
        evenings.append(danced(parts, 50))
        parts.close()
    assert (evenings[0][0] == 1.0).all()
    np.testing.assert_array_equal(evenings[0][1], evenings[1][1])
    assert evenings[0][1].any()


def test_a_show_may_have_another_dance_each_evening(tmp_path: Path) -> None:
    show = load_show(write_show(tmp_path / "show", dancer={"coding_iterations": 2, "seed": None}))
    seeds = set()
    for _ in range(4):
        parts = assemble(show, BOX)
        seeds.add(parts.liveliness.seed)
        parts.close()
    assert len(seeds) == 4


def test_puppets_share_the_liveliness_and_each_has_its_own_noise(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show", puppets=[{"name": "a"}, {"name": "b", "x": 1.0}])
    parts = assemble(load_show(show), BOX)
    parts.liveliness.dance(30)
    for number, one in enumerate(parts.puppets):
        assert one.liveliness == 1.0
        np.testing.assert_allclose(one.noise, LatentNoise(number, 1, 1).at(30)[0], rtol=1e-6)
    parts.close()


def test_a_tick_gives_both_to_the_network(tmp_path: Path) -> None:
    """Into the rows of the batch that it runs on."""
    show = write_show(tmp_path / "show", puppets=[{"name": "a"}, {"name": "b", "x": 1.0}])
    parts = assemble(load_show(show), BOX)
    tick = Tick(parts, SensorFit(parts, SensorMemory(None)), 1.0)
    for number in range(20):
        slot = Slot(number, 10 + 0.02 * number, 10 + 0.02 * number, 0)
        tick.run(slot)
        tick.after(slot)
        if number == 9:
            parts.liveliness.ask(0.0, 1.0)
    for number, one in enumerate(parts.puppets):
        assert one.puppet.liveliness == pytest.approx(1.0 - 9 / 50)
        np.testing.assert_array_equal(one.puppet.noise, LatentNoise(number, 1, 1).at(19)[0])
    parts.close()


@pytest.mark.parametrize(("fade", "ticks"), [((), 25), ((0.0,), 25), ((2.0,), 100)])
def test_a_command_changes_it_evenly_and_never_at_once(
    parts: StageParts, command: Commanded, fade: tuple[float, ...], ticks: int
) -> None:
    danced(parts, 10)
    assert command("/liveliness", 0.0, *fade) == ""
    levels, _ = danced(parts, ticks + 10, 10)
    steps = np.diff(levels)
    assert levels[0] == 1.0 and levels[ticks] == 0.0
    np.testing.assert_allclose(steps[:ticks], -1.0 / ticks)
    assert not steps[ticks:].any()
    assert LEAST_FADE_S * 50 == 25


def test_a_change_in_the_middle_of_a_fade_begins_where_it_has_come_to(
    parts: StageParts, command: Commanded
) -> None:
    danced(parts, 1)
    command("/liveliness", 0.0, 2.0)
    danced(parts, 50, 1)
    command("/liveliness", 1.0, 1.0)
    levels, _ = danced(parts, 60, 51)
    assert levels[0] == pytest.approx(0.5)
    assert np.diff(levels).max() < 0.011 and levels[-1] == 1.0


def test_a_new_seed_is_another_noise_without_a_jump(parts: StageParts, command: Commanded) -> None:
    _, before = danced(parts, 10)
    assert command("/seed", 99) == ""
    _, after = danced(parts, 200, 10)
    assert np.abs(np.diff(np.concatenate([before, after]), axis=0)).max() < 0.15
    last = LatentNoise(99, 1, 1).at(209)[0]
    np.testing.assert_allclose(after[-1], last, rtol=1e-5)


def test_a_cue_changes_both(parts: StageParts, reconciler: Reconciler, command: Commanded) -> None:
    danced(parts, 1)
    command("/cue", text="calm")
    assert (parts.liveliness.asked, parts.liveliness.seed) == (0.25, 2**31 - 1)
    levels, _ = danced(parts, 60, 1)
    assert levels[49] > 0.25 and levels[50] == 0.25  # over the cue's second
    command("/cue", text="start")
    assert (parts.liveliness.asked, parts.liveliness.seed) == (0.25, 2**31 - 1)  # what it leaves out stays


def test_it_goes_on_from_a_keyframe_in_the_middle_of_its_fades(show: Show, parts: StageParts) -> None:
    danced(parts, 20)
    for order in (Order("liveliness", (0.3, 4.0)), Order("seed", (7.0,))):
        obey(order, parts)
    danced(parts, 30, 20)
    again = assemble(show, BOX)
    restore(again, packed(parts))
    for one, other in zip(danced(parts, 300, 50), danced(again, 300, 50), strict=True):
        np.testing.assert_array_equal(one, other)
    again.close()


def resumed(before: Reconciler, after: Reconciler, runtime: Path, tick: int) -> None:
    with closing(Resumption("A test", runtime, None, "always")) as noting:
        noting.write_checkpoint(before, tick)
    with closing(Resumption("A test", runtime, None, "always")) as resuming:
        assert "goes on" in resuming.go_on(after, NOW)


def test_a_restarted_stage_goes_on_in_the_same_noise(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    """Twice: each stage counts its ticks from 0."""
    first, second, third = dance_of(), dance_of(), dance_of()
    for order in (Order("seed", (8.0,)), Order("liveliness", (0.75,))):
        obey(order, first.parts)
    levels, noises = danced(first.parts, 300)
    resumed(first, second, runtime, 99)
    levels_after, noises_after = danced(second.parts, 50)
    resumed(second, third, runtime, 49)
    levels_last, noises_last = danced(third.parts, 150)
    assert third.parts.liveliness.seed == 8
    np.testing.assert_array_equal(np.concatenate([levels_after, levels_last]), levels[100:])
    np.testing.assert_array_equal(np.concatenate([noises_after, noises_last]), noises[100:])


def test_what_it_was_on_its_way_to_is_there_at_once_after_a_restart(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    first, second = dance_of(), dance_of()
    danced(first.parts, 10)
    for order in (Order("seed", (8.0,)), Order("liveliness", (0.5, 10.0))):
        obey(order, first.parts)
    danced(first.parts, 10, 10)
    resumed(first, second, runtime, 19)
    levels, noises = danced(second.parts, 1)
    assert levels[0] == 0.5
    np.testing.assert_allclose(noises[0], LatentNoise(8, 1, 1).at(20)[0], rtol=1e-6)
