"""Strings of other motion than the body's: of a hand, a live dancer, and couplings between figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from appliance.box.fallback import Fallbacks
from appliance.levers.show_state import ShowState
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.couplings import Couplings
from appliance.sound.fallback import OF_THE_SOUND
from appliance.sound.instrument import Instrument
from appliance.sound.run import Sound
from tests.bundles import FIGURE, write_show
from tests.command import Command
from tests.sound.test_answering import swinging

TICK_S, BLOCK = 0.02, 960
Fill = Callable[[JointFrame, int], None]


def wandering(seed: int, ticks: int = 220) -> np.ndarray:
    """Joints (N, J, 3) that wander in bursts, each by itself and in its own rhythm, about a still root."""
    random = np.random.default_rng(seed)
    joints = len(FIGURE)
    steps = random.normal(size=(ticks, joints, 3))
    smooth = np.apply_along_axis(lambda one: np.convolve(one, np.hanning(11)[1:-1], "same"), 0, steps)
    rhythms, begins = random.uniform(3.0, 12.0, (joints, 1)), random.uniform(0.0, 6.0, (joints, 1))
    bursts = 1.0 + np.sin(np.arange(ticks) / rhythms + begins).T
    smooth *= bursts[..., None]
    smooth[:, 0] = 0.0
    return np.asarray(np.cumsum(0.02 * smooth, axis=0), np.float32)


def coupled_shares(first: np.ndarray, second: np.ndarray, holds: Any = 0.0) -> np.ndarray:
    """The mean shares (J,) of two dances."""
    couplings, shares = Couplings(FIGURE), []
    for tick in range(len(first)):
        puppets = tuple(PuppetFrame.of(len(FIGURE)) for _ in range(2))
        puppets[0].positions[:], puppets[1].positions[:] = first[tick], second[tick]
        puppets[0].holds[:] = holds
        couplings.look(JointFrame(puppets, tick, tick * TICK_S))
        shares.append(couplings.shares)
    assert not np.any(shares[:110]), "before a trail is long enough, chance looks like a coupling"
    return np.asarray(np.mean(shares[125:], axis=0))


def test_figures_that_move_alike_are_coupled_and_strangers_and_one_who_stands_are_not() -> None:
    seeds = range(8)
    later = [np.roll(wandering(seed), 8, axis=0) for seed in seeds]
    alike = np.mean(
        [coupled_shares(wandering(seed), one)[1:] for seed, one in zip(seeds, later, strict=True)]
    )
    strangers = np.mean([coupled_shares(wandering(seed), wandering(seed + 50))[1:] for seed in seeds])
    assert alike > 0.4 and strangers < 0.4 * alike
    assert not coupled_shares(wandering(1), np.zeros_like(wandering(1))).any()


def test_two_who_travel_together_are_coupled_and_two_with_only_the_rhythm_of_speeds_are_not() -> None:
    dance = wandering(2)
    path = np.repeat(dance[:, 3:4], len(FIGURE), axis=1)
    together = coupled_shares(path, path + np.float32([1.0, 0.0, 0.0]))
    assert together.min() > 0.4, "nothing moves about the root"
    assert coupled_shares(dance, -dance).max() < 0.1 * together.min(), "as fast at each moment, the other way"


def test_a_limb_that_follows_the_hand_is_coupled_and_the_hand_by_itself_is_not() -> None:
    dance, still = wandering(3), np.zeros_like(wandering(3))
    dance[:, 2:] = still[:, 2:]
    dance[:, 4] = np.roll(dance[:, 1], 3, axis=0)
    held = np.eye(len(FIGURE))[1]
    shares = coupled_shares(dance, still, held)
    assert shares[4] > 0.4 and shares[1] == 0.0 and not np.delete(shares, 4).any()


def heard(of: str, step: Callable[[Instrument, float], None], seconds: float = 1.0) -> np.ndarray:
    made = Instrument(FIGURE, StringsConfig.model_validate({"of": of}), SoundConfig(block=BLOCK))
    made.level, out = 1.0, []
    for tick in range(round(seconds / TICK_S)):
        step(made, tick * TICK_S)
        out.append(made.render(BLOCK)[:, 0])
    return np.concatenate(out)


def test_only_the_strings_of_coupled_joints_sound_and_are_struck_as_the_coupling_sets_in() -> None:
    made = Instrument(FIGURE, StringsConfig(of="couplings", partials=1), SoundConfig(block=BLOCK))
    made.level, sound = 1.0, []
    string = 3
    shares = np.eye(len(FIGURE))[made.strings.bones[string, 1]]
    for tick in range(150):
        made.couple(shares if tick >= 50 else 0.0 * shares, tick * TICK_S)
        sound.append(made.render(BLOCK)[:, 0])
    silent, onset, after = (
        np.concatenate(sound[:50]),
        np.concatenate(sound[50:55]),
        np.concatenate(sound[60:]),
    )
    assert not silent.any() and np.abs(onset).max() > 0.01
    spectrum = np.abs(np.fft.rfft(after * np.hanning(len(after))))
    assert np.argmax(spectrum) * 48000 / len(after) == pytest.approx(made.strings.hertz[string], rel=0.02)


def test_a_hand_plays_as_fast_as_it_turns_and_a_still_or_unknown_one_is_silent() -> None:
    def turned(radians_s: float) -> float:
        def step(made: Instrument, now: float) -> None:
            half = 0.5 * radians_s * now
            made.turn(np.array([np.cos(half), np.sin(half), 0.0, 0.0], np.float32), now)

        return float(np.abs(heard("hand", step)[24000:]).mean())

    slow, fast = turned(1.0), turned(6.0)
    assert turned(0.0) == 0.0 and fast > 4 * slow > 0.0
    assert not heard("hand", lambda made, now: made.turn(np.zeros(4, np.float32), now)).any()


class Stage:
    """Gives frames in which nothing moves but what `fill` moves."""

    def __init__(self, directory: Path, fill: Fill) -> None:
        self.facts = SimpleNamespace(show_directory=directory, cues=(), led_in=lambda frame: frame.puppets[0])
        self.generation, self._fill, self.tick = 1, fill, -1

    def newest(self, now: float) -> JointFrame:
        rest, live = PuppetFrame.of(len(FIGURE)), np.zeros((len(FIGURE), 3), np.float32)
        frame = JointFrame((rest,), self.tick, now, left=now, hands=np.zeros((1, 4), np.float32), live=live)
        self._fill(frame, self.tick)
        return frame


def move_body(frame: JointFrame, tick: int) -> None:
    frame.puppets[0].positions[:] = swinging(4.0, True)[tick % 200]


def move_live(frame: JointFrame, tick: int) -> None:
    frame.live[:] = swinging(4.0, True)[tick % 200]


def move_hand(frame: JointFrame, tick: int) -> None:
    frame.hands[0] = np.cos(0.05 * tick), 0.0, np.sin(0.05 * tick), 0.0


@pytest.mark.parametrize(("of", "sounding"), [("body", move_body), ("live", move_live), ("hand", move_hand)])
def test_strings_hear_only_whose_motion_the_show_says(tmp_path: Path, of: str, sounding: Fill) -> None:
    directory = write_show(
        tmp_path / "show",
        strings={"of": of},
        motion={"live": True},
        hands=[{"sensor": "wrist", "joint": "lForeArm"}],
    )
    for fill in (move_body, move_live, move_hand):
        stage, state = Stage(directory, fill), SimpleNamespace(read=ShowState)
        sound = Sound(SoundConfig(), stage, state, Fallbacks(OF_THE_SOUND))  # type: ignore[arg-type]
        out = []
        for stage.tick in range(40):
            sound.look(10.0 + TICK_S * stage.tick)
            sound.dance(stage, 10.0 + TICK_S * stage.tick)  # type: ignore[arg-type]
            out.append(sound.render(BLOCK, ShowState()))
        assert np.concatenate(out).any() == (fill is sounding), (of, fill)


def test_what_the_show_does_not_have_is_refused(tmp_path: Path, bunraku: Command) -> None:
    for of, said in (("live", "This show takes no live dancer"), ("hand", "No hand holds a joint of it")):
        with pytest.raises(ConfigError, match=said):
            load_show(write_show(tmp_path / of, strings={"of": of}, hands=[]))
    show = write_show(tmp_path / "couplings", strings={"of": "couplings"})
    said = bunraku(
        *("sound", show / "phrase.bvh", "--show", show, "--file", tmp_path / "out.wav"), status=2
    ).err
    assert "would be silent" in said and not (tmp_path / "out.wav").exists()
