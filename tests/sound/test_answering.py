"""Sound that answers the dance: struck where moves start and feet land, as loud as it, in its harmony."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.instrument import Instrument
from appliance.sound.onsets import Onsets
from appliance.sound.strings import STEP, Strings
from tests.bundles import FIGURE

RATE, BLOCK = 48000, 256
SOUND = SoundConfig(block=BLOCK)


def heard(
    instrument: Instrument, positions: np.ndarray, fps: float = 50.0, cues: tuple[int, ...] = (0,)
) -> np.ndarray:
    """The first loudspeaker's samples while a dance (N, J, 3) is danced; cues: in equal parts of it."""
    instrument.level = 1.0
    blocks, place, out = round(len(positions) / fps * RATE / BLOCK), -1, []
    for block in range(blocks):
        instrument.cue = cues[block * len(cues) // blocks]
        if int(block * BLOCK / RATE * fps) != place:
            place = int(block * BLOCK / RATE * fps)
            instrument.dance(positions[place], place / fps)
        out.append(instrument.render(BLOCK)[:, 0])
    return np.concatenate(out)


def swinging(seconds: float, moves: bool) -> np.ndarray:
    """A figure whose arm swings."""
    at_s = np.arange(round(seconds * 50)) / 50
    rest, _ = FIGURE.forward_kinematics(np.tile([1.0, 0, 0, 0], (len(FIGURE), 1)), np.array([0.0, 1.0, 0.0]))
    positions = np.repeat(rest[None], len(at_s), axis=0)
    if moves:
        positions[:, 2:, 1] += 0.25 * np.sin(2 * np.pi * 1.5 * at_s)[:, None]
    return positions


def loudness(sound: np.ndarray, window_s: float = 0.01) -> np.ndarray:
    size = round(window_s * RATE)
    return np.sqrt((sound[: len(sound) // size * size].reshape(-1, size) ** 2).mean(axis=1))


def test_loudness_follows_a_stop_and_a_start_within_a_tenth_of_a_second() -> None:
    """Strings that decay in three seconds alone take half a second for either."""
    dance = np.concatenate([swinging(2.0, True), swinging(1.0, False), swinging(2.0, True)])
    made = Instrument(FIGURE, StringsConfig(attacks=0.0), SOUND)
    loud = loudness(heard(made, dance))
    dancing = np.median(loud[100:195])
    assert np.median(loud[212:230]) < 0.5 * dancing
    assert np.median(loud[290:300]) < 0.3 * dancing
    assert np.median(loud[312:330]) > 0.4 * dancing


def test_a_start_is_struck_once_and_even_motion_is_not() -> None:
    bones = np.array([[0, 1]])
    onsets, strikes = Onsets(FIGURE, bones), []
    for tick in range(100):
        speed = np.array([0.0 if tick < 50 else 2.0])
        strikes.append(float(onsets.strikes(speed, np.ones((len(FIGURE), 3)), tick * 0.02, 0.02)[0]))
    assert strikes[50] > 0.5
    assert sum(one > 0 for one in strikes) == 1


def test_a_foot_that_lands_is_struck_as_hard_as_it_fell() -> None:
    skeleton = FIGURE
    foot, above = skeleton.index("lFoot"), skeleton.parents[skeleton.index("lFoot")]
    bones = np.array([[above, foot]])
    found = {}
    for fall_m_s in (0.6, 1.8):
        onsets, strikes = Onsets(skeleton, bones), []
        positions = np.zeros((len(skeleton), 3))
        for tick in range(60):
            positions[foot, 1] = max(0.1, 0.1 + fall_m_s * (30 - tick) * 0.02)
            strikes.append(float(onsets.strikes(np.zeros(1), positions, tick * 0.02, 0.02)[0]))
        assert sum(one > 0 for one in strikes) == 1
        found[fall_m_s] = max(strikes)
    assert found[1.8] > 2 * found[0.6] > 0


def test_a_foot_that_stops_in_the_air_is_not_struck() -> None:
    skeleton = FIGURE
    foot = skeleton.index("lFoot")
    onsets = Onsets(skeleton, np.array([[skeleton.parents[foot], foot]]))
    positions = np.zeros((len(skeleton), 3))
    heights = np.concatenate(
        [np.full(20, 0.1), np.linspace(0.1, 1.0, 20), np.linspace(1.0, 0.6, 15), np.full(9, 0.6)]
    )
    for tick, height in enumerate(heights):
        positions[foot, 1] = height
        assert not onsets.strikes(np.zeros(1), positions, tick * 0.02, 0.02).any()


def test_each_cue_has_its_harmony_and_the_one_before_rings_out_without_a_click() -> None:
    config = StringsConfig(attacks=0.0, partials=2)
    first, second = (
        Strings(FIGURE, config, RATE, scale=config.harmonies[place]).hertz.tolist() for place in (0, 1)
    )
    assert first != second
    made = Instrument(FIGURE, config, SOUND)
    sound = heard(made, swinging(3.0, True), cues=(0, 0, 1))
    assert made.strings.hertz.tolist() == second
    steps = np.abs(np.diff(sound))
    change = round(2.0 * RATE)
    assert steps[change - BLOCK : change + BLOCK].max() <= 1.1 * steps[RATE:].max()


def test_a_figure_on_the_floor_has_another_harmony_until_it_is_up_again() -> None:
    made = Instrument(FIGURE, StringsConfig(), SOUND)
    up = swinging(0.5, False)
    seen = []
    for height in (0.0, -0.5, -0.35, -0.2):
        heard(made, up + np.array([0.0, height, 0.0]))
        seen.append(made.strings)
    assert seen[0] is seen[3] and seen[1] is seen[2] and seen[0] is not seen[1]


@pytest.mark.parametrize("preset", ["strings", "voices", "percussion"])
def test_presets_sound_and_stay_below_the_ceiling(preset: str) -> None:
    made = Instrument(FIGURE, StringsConfig(preset=preset), SOUND)
    sound = heard(made, swinging(2.0, True))
    assert 0.01 < np.abs(sound).max() <= 1.0


def test_percussion_dies_away_and_its_partials_are_those_of_a_bar() -> None:
    rings = {}
    for preset in ("strings", "percussion"):
        strings = Strings(FIGURE, StringsConfig(preset=preset), RATE)
        strings.strike(np.ones(len(strings.bones)))
        sound = strings.render(
            np.zeros((RATE // STEP, len(strings.bones))), np.ones((len(strings.bones), 1))
        )[:, 0]
        rings[preset] = np.abs(sound[-RATE // 10 :]).max() / np.abs(sound).max()
    assert rings["percussion"] < 0.2 * rings["strings"]
    lone = Strings(FIGURE, StringsConfig(preset="percussion", coupling=0.0, partials=2), RATE)
    lowest = lone.frequencies.reshape(2, -1).min(axis=1)
    assert lowest[1] / lowest[0] == pytest.approx(2.756, rel=1e-6)
