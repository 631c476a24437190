"""Strings by their spectrum: partials where they should be, decay, coupling, and no clicks."""

from __future__ import annotations

import numpy as np
import pytest

from appliance.pose.skeleton import Skeleton
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.instrument import CEILING, Instrument
from appliance.sound.strings import STEP, Strings, around
from tests.bundles import FIGURE

RATE = 48000
ONE = Skeleton(("hip", "knee"), (-1, 0), np.array([[0.0, 0.0, 0.0], [0.0, -0.5, 0.0]]))
ALONE = np.ones((1, 1))


def pluck(strings: Strings, which: np.ndarray) -> None:
    """Push strings (B,) once."""
    strings._state += 1j * (which @ strings._from_strings)


def plucked(config: StringsConfig, seconds: float) -> np.ndarray:
    """One string, plucked once, (samples,)."""
    strings = Strings(ONE, config, RATE)
    pluck(strings, np.ones(1))
    return strings.render(np.zeros((round(seconds * RATE / STEP), 1)), ALONE)[:, 0]


def peaks(sound: np.ndarray, count: int) -> list[float]:
    """Hertz of the strongest partials, from low to high."""
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound))))
    inner = spectrum[1:-1]
    tops = np.flatnonzero((inner > spectrum[:-2]) & (inner > spectrum[2:])) + 1
    best = tops[np.argsort(-spectrum[tops])[:count]]
    return sorted(float(place) * RATE / len(sound) for place in best)


def test_a_figure_of_one_joint_has_no_string_and_is_silent() -> None:
    skeleton = Skeleton(("hip",), (-1,), np.zeros((1, 3)))
    instrument = Instrument(skeleton, StringsConfig(), SoundConfig())
    instrument.level = 1.0
    for number in range(4):
        instrument.dance(np.array([[0.0, 1.0 + number, 0.0]]), 0.02 * number)
        assert not instrument.render(4 * STEP).any()


def test_partials_are_where_they_should_be() -> None:
    sound = plucked(StringsConfig(base_hz=110.0, partials=4, decay_s=5.0), 2.0)
    assert peaks(sound, 4) == pytest.approx([110.0, 220.0, 330.0, 440.0], abs=0.6)


def test_each_partial_is_weaker_by_the_brightness() -> None:
    sound = plucked(StringsConfig(base_hz=110.0, partials=2, brightness=0.5, decay_s=30.0), 1.0)
    spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound))))
    assert spectrum[220] / spectrum[110] == pytest.approx(0.5, rel=0.05)


def test_a_string_falls_by_sixty_decibels_in_its_decay() -> None:
    sound = plucked(StringsConfig(base_hz=200.0, partials=1, decay_s=1.0), 1.2)
    loud, quiet = np.abs(sound[:480]).max(), np.abs(sound[RATE : RATE + 480]).max()
    assert 20 * np.log10(loud / quiet) == pytest.approx(60.0, abs=1.0)


def test_pushes_do_not_make_the_sound_jump() -> None:
    sound = plucked(StringsConfig(base_hz=110.0, partials=3), 0.1)
    assert abs(sound[0]) < 1e-9
    strings = Strings(ONE, StringsConfig(base_hz=110.0, partials=3), RATE)
    bowed = strings.render(np.ones((1500, 1)), ALONE)[:, 0]
    steps = np.abs(np.diff(bowed))
    at_pushes = steps[STEP - 1 :: STEP]
    assert np.percentile(at_pushes, 99) < 1.1 * np.percentile(steps, 99)


def test_strings_of_bones_that_meet_sound_along_and_without_coupling_they_do_not() -> None:
    for coupling in (0.0, 0.1):
        strings = Strings(FIGURE, StringsConfig(coupling=coupling, partials=1, decay_s=30.0), RATE)
        first = np.eye(len(strings.bones))[0]
        pluck(strings, first)
        others = np.diag(1.0 - first)[:, 1:]
        heard = strings.render(np.zeros((600, len(first))), others)
        assert (np.abs(heard).max() > 1e-3) == (coupling > 0)


def test_no_partial_is_above_what_the_rate_carries() -> None:
    sound = plucked(StringsConfig(base_hz=1000.0, partials=12), 0.2)
    assert np.isfinite(sound).all()
    strings = Strings(FIGURE, StringsConfig(base_hz=1000.0, partials=12), 22050)
    drive = np.ones((200, len(strings.bones)))
    loud = strings.render(drive, np.ones((len(strings.bones), 1)))[:, 0]
    spectrum = np.abs(np.fft.rfft(loud * np.hanning(len(loud)))) ** 2
    assert spectrum[int(0.46 * len(loud)) :].sum() < 1e-3 * spectrum.sum()


@pytest.mark.parametrize("channels", [2, 8])
def test_each_string_is_as_loud_wherever_it_stands(channels: int) -> None:
    gains = around(np.linspace(0, 2 * np.pi, 50), channels)
    assert gains.shape == (50, channels)
    assert np.sum(gains**2, axis=1) == pytest.approx(1.0, abs=1e-6)


def moving(instrument: Instrument, seconds: float, level: float = 1.0, block: int = 256) -> np.ndarray:
    """What a body that turns quickly plays, (samples, channels)."""
    instrument.level = level
    rng = np.random.default_rng(1)
    positions, heard = rng.normal(size=(len(FIGURE), 3)), []
    for number in range(round(seconds * RATE / block)):
        if number % 4 == 0:
            positions += rng.normal(size=positions.shape) * 0.05
            instrument.dance(positions, number * block / RATE)
        heard.append(instrument.render(block))
    return np.concatenate(heard)


def test_the_limiter_keeps_the_loudest_strings_below_the_ceiling() -> None:
    loud = StringsConfig(volume=1.0, partials=12, brightness=1.0, decay_s=30.0)
    sound = moving(Instrument(FIGURE, loud, SoundConfig(channels=8)), 3.0)
    assert 0.3 < np.abs(sound).max() <= 1.0
    assert np.mean(np.abs(sound) > CEILING + 0.02) < 1e-3


def test_panic_is_silent_within_twenty_milliseconds_and_without_a_click() -> None:
    instrument = Instrument(FIGURE, StringsConfig(), SoundConfig())
    before = moving(instrument, 1.0)
    instrument.level = 0.0
    instrument.rest()
    after = np.concatenate([instrument.render(256) for _ in range(100)])
    assert not after[round(0.02 * RATE) :].any() and not after[256:].any()
    steps = np.abs(np.diff(np.concatenate([before, after]), axis=0))
    assert steps[len(before) - 1 :].max() <= 1.1 * steps[: len(before) - 1].max()
    instrument.level = 1.0
    assert np.abs(instrument.render(256)).max() < 0.01, "the strings were stopped"


def test_a_body_that_stands_is_silent_and_the_same_dance_sounds_the_same() -> None:
    still = Instrument(FIGURE, StringsConfig(), SoundConfig())
    still.level = 1.0
    for number in range(50):
        still.dance(np.ones((len(FIGURE), 3)), 0.02 * number)
        assert not still.render(256).any()
    one, other = (moving(Instrument(FIGURE, StringsConfig(), SoundConfig()), 0.5) for _ in range(2))
    assert np.array_equal(one, other) and one.any()


def test_a_change_of_loudness_does_not_click() -> None:
    """Strings that ring have nothing above 3 kHz here; a jump of the loudness would have."""

    def played(*levels: float) -> np.ndarray:
        instrument = Instrument(ONE, StringsConfig(partials=2, decay_s=30.0), SoundConfig())
        pluck(instrument.strings, np.full(1, 0.1))
        sound = []
        for level in levels:
            instrument.level = level
            sound.append(instrument.render(256))
        return np.concatenate(sound)[512:, 0]  # from where they are as loud as at first

    def above_db(sound: np.ndarray) -> float:
        spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)))) ** 2
        return float(10 * np.log10(spectrum[3000 * len(sound) // RATE :].sum() / spectrum.sum()))

    steady = played(*[1.0] * 85)
    middle = len(steady) // 2
    top = middle + int(np.argmax(np.abs(steady[middle : middle + 400])))
    jumping = np.where(np.arange(len(steady)) < top, 1.0, 0.2) * steady
    changed = played(*[1.0] * 40, 0.2, 0.9, 0.0, 1.0, 0.5, *[0.5] * 40)
    assert above_db(steady) < -100.0 and above_db(jumping) > -40.0
    assert above_db(changed) < -60.0
