"""How soon a hand is heard, by the clock of an emulated card that speaks PortAudio's interface."""

from __future__ import annotations

import functools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.instrument import Instrument
from hw_sim.figures import SOUND_MS, STILL_S
from hw_sim.latency import sounded_ms
from hw_sim.sound_card import Played, environment, read_played
from tests.bundles import FIGURE

RATE = 48000
STEPS = [0.6 + 0.6 * number for number in range(3)]

PLAYS = """
import sys, time
from types import SimpleNamespace
import numpy
from appliance.show.sound import SoundConfig
from appliance.sound.card import OFTEN, Card

asked = []

def render(frames):
    asked.append(frames)
    if sys.argv[1] == "slow" and frames == 128 and len(asked) > 2:
        time.sleep(0.02)
    return numpy.full((frames, 2), 0.25, numpy.float32)

card = Card(SoundConfig(), render)
now = 0.0
card.look(now)
while len(asked) < 60:
    time.sleep(0.002)
    now += 0.002
    card.look(now)
card.close()
print(card.dropouts >= OFTEN, asked[-1], card.trouble)
"""


def played_by_the_card(tmp_path: Path, how: str) -> tuple[Played, str]:
    log = tmp_path / "played"
    ran = subprocess.run(
        [sys.executable, "-c", PLAYS, how],
        env={**environment(log), "ALSA_CONFIG_PATH": "/usr/share/alsa/alsa.conf"},
        capture_output=True,
        text=True,
        check=True,
    )
    return read_played(log), ran.stdout.strip()


def test_the_card_plays_each_block_one_block_after_it_asked_for_it(tmp_path: Path) -> None:
    played, _ = played_by_the_card(tmp_path, "fast")
    on_time = played.samples != 0.0
    assert on_time.sum() > len(played.samples) / 2 and set(played.samples[on_time]) == {0.5}
    np.testing.assert_allclose(np.diff(played.at[: 128 * 30]), 1 / RATE, rtol=1e-4)


def test_a_card_whose_blocks_come_late_again_and_again_is_given_longer_ones(tmp_path: Path) -> None:
    played, ended = played_by_the_card(tmp_path, "slow")
    assert ended.startswith("True ") and int(ended.split()[1]) in (256, 512), ended
    assert played.late >= 6


@functools.cache
def danced(late_ms: float, moves: bool = True, follows_s: float = 0.0, block: int = 128) -> Played:
    """A figure whose arm jumps at STEPS, read `late_ms` later; follows_s: its sound follows it so slowly."""
    rest, _ = FIGURE.forward_kinematics(np.tile([1.0, 0, 0, 0], (len(FIGURE), 1)), np.array([0.0, 1.0, 0.0]))
    made, out, at, place, speed = (
        Instrument(FIGURE, StringsConfig(partials=2), SoundConfig(block=block)),
        [],
        [],
        -1,
        0.0,
    )
    made.level = 1.0
    for number in range(round(2.3 * RATE / block)):
        now = number * block / RATE
        if int(now * 50) != place:
            place = int(now * 50)
            gone = sum(np.clip((place / 50 - late_ms / 1000 - step) / 0.06, 0, 1) for step in STEPS) * moves
            positions = rest.copy()
            if follows_s:
                speed += (gone - speed) * 0.02 / follows_s
                gone = speed
            positions[2:, 1] += 0.25 * (1.0 - np.cos(np.pi * gone)) / 2
            made.dance(positions, place / 50)
        out.append(made.render(block).sum(axis=1))
        at.append(now + block / RATE + np.arange(block) / RATE)
    return Played(np.concatenate(at), np.concatenate(out))


def test_the_first_change_is_found_and_the_way_before_it_counts() -> None:
    heard = {late: sounded_ms(STEPS, danced(late)) for late in (0.0, 40.0)}
    assert all(len(found) >= 2 for found in heard.values())
    assert np.median(heard[40.0]) - np.median(heard[0.0]) == pytest.approx(40.0, abs=6.0)


def test_what_ignores_the_hand_or_follows_slowly_does_not_pass() -> None:
    """The null products: strings that play something else, a hand that is smoothed, long blocks."""
    assert len(sounded_ms(STEPS, danced(0.0, moves=False))) == 0
    assert len(sounded_ms([step + STILL_S for step in STEPS], danced(0.0))) == 0
    soon, blocks = np.median(sounded_ms(STEPS, danced(0.0))), sounded_ms(STEPS, danced(0.0, block=1024))
    assert np.median(blocks) > soon + SOUND_MS
    smooth = sounded_ms(STEPS, danced(0.0, follows_s=0.3))
    assert len(smooth) < 2 or np.median(smooth) > soon + SOUND_MS
