"""Strings that drive joints back: what they do, that they give no energy; and fades of springs."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from appliance.dancer.mass_spring import SUBSTEP_S, MassSpring
from appliance.dancer.slow_strings import HIGHEST_HZ, TIED_HZ, SlowStrings
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.show.springs import RegionConfig, SpringsConfig
from appliance.show.string_pitches import string_pitches
from appliance.sound.instrument import Instrument
from tests.bundles import FIGURE, MOVING
from tests.dancer.test_springs import REST, SETTINGS, Dance

ONE = Skeleton(("hip", "knee"), (-1, 0), np.array([[0.0, 0.0, 0.0], [0.0, -0.5, 0.0]]))
NONE = np.zeros((2, 3))
GAINS = (0.01, 0.1, 0.3, 0.6, 1.0)


def undamped() -> RegionConfig:
    return RegionConfig(directional_stiffness=60.0, damping=0.0)


def test_a_string_swings_whole_octaves_below_its_pitch_and_rings_longer_the_lower_it_is() -> None:
    string = SlowStrings(ONE, [0, 1], StringsConfig(base_hz=110.0, decay_s=2.0), 0.002)
    string.modes[1, 0] = 1.0
    course = []
    for _ in range(1000):
        string.follow(NONE)
        course.append(string.modes[1, 0].real)
    crossings = np.flatnonzero(np.diff(np.sign(course)))
    swings = (len(crossings) - 1) / 2 / ((crossings[-1] - crossings[0]) * 0.002)
    assert swings == pytest.approx(110.0 / 16, rel=0.01) and swings < HIGHEST_HZ
    assert 20 * np.log10(np.abs(string.modes[1, 0])) == pytest.approx(-60.0 / 4, abs=0.5)


def test_a_mass_on_a_string_without_pitch_swings_as_often_as_a_string_of_gain_one_is_tied() -> None:
    body = MassSpring([-1, 0])
    body.set_parameters(*(np.full(2, value) for value in (1.0, 0.0, 0.0, 0.0)))
    string = SlowStrings(ONE, [0, 1], StringsConfig(decay_s=30.0), SUBSTEP_S)
    string.tune(1.0, body.mass, body.carried)
    string._turn[1] = 1.0  # a string that is slack: it neither swings nor loses anything
    body.rest[1] = 0.0, -0.5, 0.0
    body.begin(body.rest.copy())
    body.velocities[1, 0] = 0.05
    course = []
    for _ in range(200):
        body.step(NONE[0], NONE, NONE[0], string)
        course.append(body.positions[1, 0])
    crossings = np.flatnonzero(np.diff(np.sign(course)))
    swings = (len(crossings) - 1) / 2 / ((crossings[-1] - crossings[0]) * 0.02)
    assert swings == pytest.approx(TIED_HZ, rel=0.02)


@functools.cache
def energies(gain: float) -> np.ndarray:
    """Of a body that is kicked, without damping or air, tick by tick."""
    dance = Dance("calm", joint="Hips")
    bare = SpringsConfig(
        name="bare",
        **dict.fromkeys(("trunk", "head", "arms", "legs"), undamped()),
        air=0.0,
        follow=0.0,
        feedback=gain,
    )
    dance.springs.settings = SETTINGS | {"bare": bare}
    dance.springs.call("bare")
    dance.tick(2)
    dance.springs.kick((1.0, 0.5, -1.0))
    course = []
    for _ in range(1500):
        dance.tick()
        course.append(dance.springs.energy())
    return np.array(course)


@pytest.mark.parametrize("gain", GAINS)
def test_body_and_strings_together_never_gain_energy(gain: float) -> None:
    """What is lost is lost by the strings; without them nothing is."""
    with_strings, without = energies(gain), energies(0.0)
    assert with_strings.max() < 1.03 * with_strings[0]  # the step's own error
    assert with_strings[-500:].mean() < without[-500:].mean()


def strung_chain(
    masses: tuple[float, float], stiffness: float, directional: float, base_hz: float, anchored: bool = True
) -> tuple[MassSpring, SlowStrings]:
    """Six masses of two kinds by turns, bones that hang down, strings at gain 1 that hardly die away."""
    parents = [-1, 0, 1, 2, 3, 4]
    offsets = np.zeros((6, 3))
    offsets[1:, 1] = -0.3
    body = MassSpring(parents, anchored)
    body.set_parameters(np.resize(masses, 6), *(np.full(6, one) for one in (stiffness, directional, 0.0)))
    body.rest[:] = offsets
    body.begin(np.cumsum(offsets, axis=0))
    body.velocities[1:] = np.random.default_rng(1).normal(size=(5, 3)) / 2
    chain, config = (
        Skeleton(tuple("abcdef"), tuple(parents), offsets),
        StringsConfig(base_hz=base_hz, decay_s=30),
    )
    strings = SlowStrings(chain, list(range(6)), config, SUBSTEP_S)
    strings.tune(1.0, body.mass, body.carried / 4)
    return body, strings


@pytest.mark.parametrize("base_hz", [30.0, 150.0])
@pytest.mark.parametrize(
    ("masses", "stiffness", "directional"),
    [
        ((1, 1), 5e3, 60),
        ((50, 0.05), 1e6, 1e5),
        ((0.05, 50), 1e6, 1e5),
        ((50, 50), 0, 0),
        ((50, 0.05), 0, 60),
    ],
)
def test_strings_that_hardly_die_away_drive_nothing_up(
    masses: tuple[float, float], stiffness: float, directional: float, base_hz: float
) -> None:
    body, strings = strung_chain(masses, stiffness, directional, base_hz)
    course = []
    for _ in range(1000):
        body.step(np.zeros(3), np.zeros((6, 3)), np.zeros(3), strings)
        course.append(body.energy() + strings.energy())
    assert max(course) < 1.1 * course[0]  # the step's own error, for springs as stiff as it carries
    assert np.mean(course[-100:]) < course[0]


def test_a_free_body_on_strings_keeps_its_momentum() -> None:
    body, strings = strung_chain((1.0, 3.0), 500.0, 80.0, 110.0, anchored=False)
    before = body.mass @ body.velocities
    for _ in range(250):
        body.step(np.zeros(3), np.zeros((6, 3)), np.zeros(3), strings)
    assert strings.energy() > 0.0
    assert np.allclose(body.mass @ body.velocities, before, atol=1e-9)


def test_without_feedback_nothing_is_different_bit_for_bit() -> None:
    """Also where strings were on before: what is off leaves nothing behind."""
    one, other = Dance("windy"), Dance("windy")
    other.springs._strings.modes[:] = 1.0  # would pull, if anything did
    other.springs._strings.pull = None  # type: ignore[method-assign,assignment]
    assert np.array_equal(one.tick(100), other.tick(100))


def test_a_kick_sounds_and_the_strings_bring_it_back() -> None:
    """After the kick the body stands almost still again, and swings anew; and that is heard."""
    heard = {}
    for gain in (0.0, 1.0):
        dance = Dance("calm")
        dance.springs.turn("feedback", (gain,))
        instrument = Instrument(FIGURE, StringsConfig(), SoundConfig())
        instrument.level = 1.0
        dance.tick(20)
        dance.springs.kick((0.0, 0.0, 2.0))
        loud, pose = [], REST.copy()
        for _ in range(150):
            targets = dance.tick()[0]
            pose[[FIGURE.index(name) for name in MOVING]] = targets
            positions, _ = FIGURE.forward_kinematics(pose.astype(float), dance.root.astype(float))
            instrument.dance(positions, dance.now)
            loud.append(np.sqrt(np.mean(instrument.render(960) ** 2)))
        heard[gain] = np.array(loud)
    assert heard[0.0].max() > 1e-3
    late = slice(100, 150)  # two seconds after the kick
    assert heard[1.0][late].mean() > 1.5 * heard[0.0][late].mean()


def test_only_bones_with_a_string_have_a_slow_one_too() -> None:
    bones, hertz = string_pitches(FIGURE, 110.0)
    strings = SlowStrings(FIGURE, list(range(len(FIGURE))), StringsConfig(), SUBSTEP_S)
    strung = np.flatnonzero(strings.hertz)
    assert strung.tolist() == sorted(bones[:, 1].tolist())
    assert np.allclose(np.log2(hertz / strings.hertz[bones[:, 1]]) % 1.0, 0.0)
    assert strings.hertz.max() <= HIGHEST_HZ


def test_settings_go_from_one_to_the_next_evenly_and_arrive_exactly() -> None:
    dance = Dance("calm", joint="Hips")
    dance.tick(20)
    dance.springs.call("windy", 2.0)
    course = [dance.springs._is.directional[1]]
    targets = []
    for _ in range(110):
        targets.append(dance.tick()[0])
        course.append(dance.springs._is.directional[1])
    roots = np.sqrt(course)
    assert (course[0], course[-1], course[100]) == (60.0, 5.0, 5.0)
    assert np.abs(np.diff(roots)).max() < 1.6 * (roots[0] - roots[-1]) / 100
    assert dance.springs.wind.tolist() == [0.0, 0.0, 6.0]
    turned = quaternion.angle_between(np.array(targets[1:]), np.array(targets[:-1]))
    assert turned.max() < 0.2
    dance.springs.call("calm", 2.0)
    dance.tick(30)
    middle = dance.springs._is.directional[1]
    dance.springs.turn("stiffness", (2.0,), 0.5)  # a knob during a fade leaves the fade as it is
    dance.tick(30)
    assert 2 * middle < dance.springs._is.directional[1] < 120.0
    dance.tick(50)
    assert dance.springs._is.directional[1] == 60.0 * 2.0
