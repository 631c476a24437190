"""The sound card through the real PortAudio: away, pulled out, back, too late; a system without sound."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from appliance.box.fallback import Fallbacks
from appliance.levers.show_state import ShowState
from appliance.show.sound import SoundConfig
from appliance.sound.card import Card
from appliance.sound.fallback import OF_THE_SOUND
from appliance.sound.run import Sound
from tests.logged import said
from tests.sound.stage_double import StageDouble

PATIENCE_S = 60.0
NULL_CARD = "pcm.!default { type plug slave.pcm null }\npcm.null { type null }\n"


def until(holds: Callable[[], bool]) -> None:
    late = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < late
        time.sleep(0.01)


@pytest.fixture
def null_card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """PortAudio with a card of ALSA that swallows everything."""
    try:
        __import__("sounddevice")
    except (ImportError, OSError) as error:
        pytest.skip(f"no PortAudio here ({error}): apt-get install libportaudio2")
    (tmp_path / "asound.conf").write_text(NULL_CARD)
    monkeypatch.setenv("ALSA_CONFIG_PATH", str(tmp_path / "asound.conf"))


@pytest.mark.parametrize("channels", [2, 8])
def test_the_real_library_asks_for_block_after_block(null_card: None, channels: int) -> None:
    asked, enough = [], threading.Event()

    def render(frames: int) -> np.ndarray:
        asked.append(frames)
        if len(asked) >= 20:
            enough.set()
            time.sleep(0.01)  # the null card never waits
        return np.zeros((frames, channels), np.float32)

    card = Card(SoundConfig(channels=channels), render)  # type: ignore[arg-type]
    card.look(0.0)
    assert card.trouble == ""
    assert enough.wait(PATIENCE_S)
    card.close()
    assert set(asked) == {128}


def test_a_card_that_is_away_and_back(
    null_card: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "none.conf").write_text("pcm.!default { type hw card 7 }\n")
    monkeypatch.setenv("ALSA_CONFIG_PATH", str(tmp_path / "none.conf"))
    asked = threading.Event()

    def render(frames: int) -> np.ndarray:
        asked.set()
        time.sleep(0.01)
        return np.zeros((frames, 2), np.float32)

    fallbacks = Fallbacks(OF_THE_SOUND)
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), StageDouble(tmp_path), state, fallbacks)  # type: ignore[arg-type]
    card = Card(SoundConfig(), render)  # type: ignore[arg-type]
    card.look(0.0)
    sound.report(card, 0.0)
    assert "No sound card plays 2 channels" in card.trouble
    assert {one.name: one.active for one in fallbacks.happened(0.0)} == {"sound-card-away": True}
    monkeypatch.setenv("ALSA_CONFIG_PATH", str(tmp_path / "asound.conf"))
    card.look(0.5)  # too early to look again
    assert card.trouble
    card.look(2.0)
    assert asked.wait(PATIENCE_S) and card.trouble == ""
    sound.report(card, 2.0)
    assert said[-1] == "The sound card is back, and the strings sound."
    card.close()


def test_a_card_that_is_pulled_out_while_it_plays_is_opened_again(
    null_card: None, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A card that takes a second of sound and is gone: writing to it fails, as when it is pulled out."""
    (tmp_path / "asound.conf").write_text(
        "pcm.!default { type plug slave.pcm short }\npcm.null { type null }\n"
        'pcm.short { type file slave.pcm null format raw file "|exec head -c 400000 >/dev/null" }\n'
    )
    asked = []

    def render(frames: int) -> np.ndarray:
        asked.append(frames)
        time.sleep(0.003)
        return np.zeros((frames, 2), np.float32)

    card = Card(SoundConfig(), render)
    for opened in range(2):
        card.look(10.0 * opened)
        assert card.trouble == ""
        stream, before = card._stream, len(asked)
        until(lambda stream=stream: not stream.active)
        assert len(asked) > before
        card.look(10.0 * opened + 0.5)  # too early to open it again
        assert "unplugged" in card.trouble
    card.close()
    capfd.readouterr()  # what ALSA and PortAudio say of it


def test_a_library_that_did_not_start_once_is_started_again(
    null_card: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sounddevice

    start, fails = sounddevice._initialize, [True]

    def initialize() -> None:
        if fails and fails.pop():
            raise sounddevice.PortAudioError("no memory")
        start()

    monkeypatch.setattr(sounddevice, "_initialize", initialize)
    card = Card(SoundConfig(), lambda frames: np.zeros((frames, 2), np.float32))
    card.look(0.0)
    assert "No sound card plays" in card.trouble
    card.look(2.0)
    assert card.trouble == ""
    card.close()


def test_a_card_that_asks_for_nothing_any_more_is_opened_again(null_card: None) -> None:
    """Some drivers never say that their card is gone."""
    card, ended = Card(SoundConfig(), lambda frames: np.zeros((frames, 2), np.float32)), []
    stream = SimpleNamespace(active=True, abort=lambda **_: ended.append("abort"), close=lambda **_: None)
    card._stream, card._tries_at = stream, 100.0
    for now in (10.0, 10.5, 10.9):
        card._fill(np.ones((256, 2), np.float32), 256, None, SimpleNamespace(output_underflow=False))
        card.look(now)
    card.look(11.8)
    assert card.trouble == "" and not ended
    card.look(12.0)
    assert "unplugged" in card.trouble and ended == ["abort"]


def test_without_the_library_the_strings_wait_for_it(
    null_card: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries = []

    def missing() -> Any:
        tries.append(1)
        raise OSError("PortAudio library not found")

    monkeypatch.setattr("appliance.sound.card._loaded", missing)
    card = Card(SoundConfig(), lambda frames: np.zeros((frames, 2), np.float32))
    for now in (0.0, 2.0, 9.0, 11.0):
        card.look(now)
    assert card.is_missing and "Install the Debian package libportaudio2" in card.trouble
    assert len(tries) == 2


def test_a_system_without_sound_is_no_end_of_the_process(tmp_path: Path, null_card: None) -> None:
    """In a process of its own: PortAudio would abort it."""
    program = """
import logging, os, sys, numpy, threading
from types import SimpleNamespace
from appliance.box.fallback import Fallbacks
from appliance.show.sound import SoundConfig
from appliance.sound.card import Card
from appliance.sound.fallback import OF_THE_SOUND
from appliance.sound.run import Sound
logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stdout)
asked = threading.Event()
def render(frames):
    asked.set()
    return numpy.zeros((frames, 2), numpy.float32)
there = os.environ["ALSA_CONFIG_PATH"]
card, fallbacks = Card(SoundConfig(), render), Fallbacks(OF_THE_SOUND)
sound = Sound(SoundConfig(), None, None, fallbacks)
os.environ["ALSA_CONFIG_PATH"] = "/nonexistent"
card.look(0.0)
sound.report(card, 0.0)
print([(one.name, one.active) for one in fallbacks.happened(0.0)])
os.environ["ALSA_CONFIG_PATH"] = there
card.look(2.0)
sound.report(card, 2.0)
print(asked.wait(60.0))
card.close()
"""
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    said = ran.stdout.splitlines()
    assert said[0].startswith("This system has no sound") and "libasound2-data" in said[0]
    assert said[1:] == ["[('no-sound-card', True)]", "The sound card is back, and the strings sound.", "True"]


def test_blocks_that_come_too_late_are_counted(null_card: None, tmp_path: Path) -> None:
    card = Card(SoundConfig(), lambda frames: np.zeros((frames, 2), np.float32))
    out = np.ones((256, 2), np.float32)
    card._fill(out, 256, None, SimpleNamespace(output_underflow=True))
    card._fill(out, 256, None, SimpleNamespace(output_underflow=False))
    fallbacks = Fallbacks(OF_THE_SOUND)
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), StageDouble(tmp_path), state, fallbacks)  # type: ignore[arg-type]
    sound.report(card, 1.0)
    assert [(one.name, one.times) for one in fallbacks.happened(1.0)] == [("sound-dropouts", 1)]
    assert not out.any()
