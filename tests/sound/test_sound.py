"""The sound's process: cue, master, panic, a stage that is lost; the card through the real PortAudio."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
import wave
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from appliance.box.fallback import Fallbacks
from appliance.box.show_state import ShowState
from appliance.show.box import BoxConfig
from appliance.show.config_error import NotAskedForError
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.card import Card
from appliance.sound.fallback import OF_THE_SOUND
from appliance.sound.render_file import render_file
from appliance.sound.run import Entrance, Sound, require_sound
from tests.bundles import FIGURE, swaying_phrase, write_show

PATIENCE_S = 60.0
NULL_CARD = "pcm.!default { type plug slave.pcm null }\npcm.null { type null }\n"


def until(holds: Callable[[], bool]) -> None:
    late = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < late
        time.sleep(0.01)


def test_strings_come_in_and_go_over_the_fade_of_the_cue() -> None:
    cues, fades, entrance = ["strings"], {"strings": 4.0, "opening": 2.0}, Entrance()
    assert entrance.share("opening", cues, fades, 0.0) == 0.0  # the first cue that is seen: no fade
    course = [entrance.share("strings", cues, fades, 1.0 + time) for time in (0.0, 1.0, 2.0)]
    assert course == [0.0, 0.25, 0.5]
    assert entrance.share("opening", cues, fades, 3.0) == 0.5  # out again from where they are
    assert [entrance.share("opening", cues, fades, now) for now in (4.0, 5.0)] == [0.25, 0.0]
    assert Entrance().share("opening", [], {}, 0.0) == 1.0


@pytest.mark.parametrize(
    ("state", "loud"),
    [
        (ShowState(cue="strings", master=0.5, master_before=0.5), 0.5),
        (ShowState(cue="strings").with_strings(0.4, 1.0, 0.0), 0.4),
        (ShowState(cue="strings").with_strings(0.0, 9.0, 2.0), 0.5),
        (ShowState(cue="opening"), 0.0),
        (ShowState(cue="strings", panic=True), 0.0),
        (ShowState(cue="strings", blackout=True), 0.0),
    ],
)
def test_how_loud_the_strings_are(tmp_path: Path, state: ShowState, loud: float) -> None:
    show = write_show(tmp_path / "show", strings={"cues": ["strings"]}, cues=[{"name": "strings"}])
    declared = SimpleNamespace(read=lambda: state)
    fallbacks = Fallbacks(OF_THE_SOUND)
    sound = Sound(SoundConfig(), StageDouble(show), declared, print, fallbacks)  # type: ignore[arg-type]
    sound.look(10.0)
    assert sound.instrument is not None and sound.instrument.level == pytest.approx(loud)


class StageDouble:
    """Gives the frames of a body that turns."""

    def __init__(self, directory: Path) -> None:
        cues = ({"name": "strings", "fade_s": 2.0},)
        self.facts, self.generation = SimpleNamespace(show_directory=directory, cues=cues), 1
        self.number, self.lives = 0, True

    def newest(self, now: float) -> Any:
        self.number += self.lives
        positions = np.random.default_rng(self.number).normal(size=(len(FIGURE), 3)).astype(np.float32)
        return SimpleNamespace(tick=self.number, left=now, frame_time=0.02 * self.number, positions=positions)


def test_without_a_stage_the_strings_rest(tmp_path: Path) -> None:
    stage = StageDouble(write_show(tmp_path / "show", strings={}))
    fallbacks, said = Fallbacks(OF_THE_SOUND), []
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, said.append, fallbacks)  # type: ignore[arg-type]
    for tick in range(20):
        sound.look(10.0 + 0.02 * tick)
    assert sound.instrument is not None and sound.instrument.level == 1.0
    assert np.abs(sound.instrument.render(4096)).max() > 0.0
    stage.lives = False
    sound.look(12.0)
    assert sound.instrument.level == 0.0
    assert {one.name: one.active for one in fallbacks.happened(12.0)} == {"sound-rests": True}
    stage.lives = True
    sound.look(12.02)
    assert sound.instrument.level == 1.0
    assert said == ["A test: 7 strings."]


def test_a_show_without_strings_is_silent(tmp_path: Path) -> None:
    stage, said = StageDouble(write_show(tmp_path / "show")), []
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, said.append, Fallbacks(OF_THE_SOUND))  # type: ignore[arg-type]
    sound.look(10.0)
    assert sound.instrument is None and said == ["A test has no `strings:`, and is silent."]


def test_a_box_file_that_asks_for_no_sound_gets_none() -> None:
    with pytest.raises(NotAskedForError, match=r"asks for no sound.*sound: \{\}"):
        require_sound(BoxConfig())


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
    assert set(asked) == {256}


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

    fallbacks, said = Fallbacks(OF_THE_SOUND), []
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), StageDouble(tmp_path), state, said.append, fallbacks)  # type: ignore[arg-type]
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
    assert card._stream is not None
    card._stream.abort()  # as PortAudio does when the card is pulled out
    card.look(3.0)
    asked.clear()
    card.look(5.0)
    assert asked.wait(PATIENCE_S) and card.trouble == ""
    card.close()


def test_a_system_without_sound_is_no_end_of_the_process(tmp_path: Path, null_card: None) -> None:
    """In a process of its own: PortAudio would abort it."""
    program = """
import os, sys, numpy, threading
from types import SimpleNamespace
from appliance.box.fallback import Fallbacks
from appliance.show.sound import SoundConfig
from appliance.sound.card import Card
from appliance.sound.fallback import OF_THE_SOUND
from appliance.sound.run import Sound
asked = threading.Event()
def render(frames):
    asked.set()
    return numpy.zeros((frames, 2), numpy.float32)
there = os.environ["ALSA_CONFIG_PATH"]
card, fallbacks = Card(SoundConfig(), render), Fallbacks(OF_THE_SOUND)
sound = Sound(SoundConfig(), None, None, print, fallbacks)
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
    sound = Sound(SoundConfig(), StageDouble(tmp_path), state, print, fallbacks)  # type: ignore[arg-type]
    sound.report(card, 1.0)
    assert [(one.name, one.times) for one in fallbacks.happened(1.0)] == [("sound-dropouts", 1)]
    assert not out.any()


@pytest.mark.parametrize("channels", [2, 8])
def test_a_recorded_dance_is_rendered_into_a_file(tmp_path: Path, channels: int) -> None:
    config = SoundConfig(channels=channels)  # type: ignore[arg-type]
    seconds = render_file(swaying_phrase(1.0), StringsConfig(), config, tmp_path / "out.wav")
    with wave.open(str(tmp_path / "out.wav")) as file:
        assert (file.getnchannels(), file.getframerate()) == (channels, 48000)
        assert file.getnframes() == round(seconds * 48000)
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2").reshape(-1, channels)
    assert np.abs(samples).max() > 300 and np.abs(samples[-480:]).max() < np.abs(samples).max() / 2
