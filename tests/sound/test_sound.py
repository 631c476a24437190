"""The sound's process: cue, master, panic, a stage that is lost; a dance into a file."""

from __future__ import annotations

import wave
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from appliance.box.fallback import Fallbacks
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, MASTER, STRINGS
from appliance.show.box import BoxConfig
from appliance.show.config_error import NotAskedForError
from appliance.show.sound import SoundConfig, StringsConfig
from appliance.sound.fallback import OF_THE_SOUND
from appliance.sound.render_file import render_file
from appliance.sound.run import Entrance, Sound, require_sound
from tests.bundles import swaying_phrase, write_show
from tests.logged import said
from tests.sound.stage_double import StageDouble

PATIENCE_S = 60.0


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
        (ShowState().to(CUE, "strings").to(MASTER, 0.5), 0.5),
        (ShowState().to(CUE, "strings").to(STRINGS, 0.4, 1.0, 0.0), 0.4),
        (ShowState().to(CUE, "strings").to(STRINGS, 0.0, 9.0, 2.0), 0.5),
        (ShowState().to(CUE, "opening"), 0.0),
        (ShowState(panic=True).to(CUE, "strings"), 0.0),
        (ShowState(blackout=True).to(CUE, "strings"), 0.0),
    ],
)
def test_how_loud_the_strings_are(tmp_path: Path, state: ShowState, loud: float) -> None:
    show = write_show(tmp_path / "show", strings={"cues": ["strings"]}, cues=[{"name": "strings"}])
    declared = SimpleNamespace(read=lambda: state)
    fallbacks = Fallbacks(OF_THE_SOUND)
    sound = Sound(SoundConfig(), StageDouble(show), declared, fallbacks)  # type: ignore[arg-type]
    sound.look(10.0)
    assert sound.instrument is not None and sound.instrument.level == pytest.approx(loud)


def test_without_a_stage_the_strings_rest(tmp_path: Path) -> None:
    stage = StageDouble(write_show(tmp_path / "show", strings={}))
    fallbacks = Fallbacks(OF_THE_SOUND)
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, fallbacks)  # type: ignore[arg-type]
    for tick in range(20):
        sound.look(10.0 + 0.02 * tick)
        sound.dance(stage, 10.0 + 0.02 * tick)  # type: ignore[arg-type]
    assert sound.instrument is not None and sound.instrument.level == 1.0
    assert np.abs(sound.instrument.render(4096)).max() > 0.0
    stage.lives = False
    course = []
    for now in np.arange(10.4, 11.6, 0.1):
        sound.look(now)
        course.append(sound.instrument.level)
    assert course[0] == 1.0 and course[-1] == 0.0 and np.diff(course).min() > -0.25  # out, but evenly
    assert {one.name: one.active for one in fallbacks.happened(12.0)} == {"sound-rests": True}
    stage.lives = True
    sound.look(12.02)
    assert sound.instrument.level == 1.0
    assert said == ["A test: 7 strings."]


@pytest.mark.parametrize("urgent", [{"panic": True}, {"blackout": True}])
def test_the_cards_thread_sees_to_panic_by_itself(tmp_path: Path, urgent: dict[str, bool]) -> None:
    """Two blocks after it is declared nothing is left, also where `look` waits for a processor."""
    stage = StageDouble(write_show(tmp_path / "show", strings={}))
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, Fallbacks(OF_THE_SOUND))  # type: ignore[arg-type]
    for tick in range(20):
        sound.look(10.0 + 0.02 * tick)
        sound.dance(stage, 10.0 + 0.02 * tick)  # type: ignore[arg-type]
        assert sound.render(960, ShowState()).shape == (960, 2)
    assert sound.render(256, ShowState()).any()
    fading, silent = (sound.render(256, ShowState(**urgent)) for _ in range(2))  # type: ignore[arg-type]
    assert np.abs(fading[-1]).max() < 1e-6 and not silent.any()


def test_another_show_comes_in_when_the_strings_of_the_one_before_are_silent(tmp_path: Path) -> None:
    stage = StageDouble(write_show(tmp_path / "show", strings={}))
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, Fallbacks(OF_THE_SOUND))  # type: ignore[arg-type]
    sound.look(10.0)
    before = sound.instrument
    stage.facts.show_directory, stage.generation = write_show(tmp_path / "other", strings={"base_hz": 80}), 2
    sound.look(10.02)
    assert before is not None and sound.instrument is before and before.level == 0.0
    sound.look(10.05)
    assert sound.instrument is before
    sound.look(10.2)
    assert sound.instrument is not before and sound.instrument is not None
    assert sound.instrument.strings.hertz.min() == pytest.approx(80.0) and sound.instrument.level == 1.0


def test_a_show_without_strings_is_silent(tmp_path: Path) -> None:
    stage = StageDouble(write_show(tmp_path / "show"))
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, Fallbacks(OF_THE_SOUND))  # type: ignore[arg-type]
    sound.look(10.0)
    assert sound.instrument is None and said == ["A test has no `strings:`, and is silent."]


def test_a_box_file_that_asks_for_no_sound_gets_none() -> None:
    with pytest.raises(NotAskedForError, match=r"asks for no sound.*sound: \{\}"):
        require_sound(BoxConfig())


@pytest.mark.parametrize("channels", [2, 8])
def test_a_recorded_dance_is_rendered_into_a_file(tmp_path: Path, channels: int) -> None:
    config = SoundConfig(channels=channels)  # type: ignore[arg-type]
    seconds = render_file(swaying_phrase(1.0), StringsConfig(), config, tmp_path / "out.wav")
    with wave.open(str(tmp_path / "out.wav")) as file:
        assert (file.getnchannels(), file.getframerate()) == (channels, 48000)
        assert file.getnframes() == round(seconds * 48000)
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2").reshape(-1, channels)
    assert np.abs(samples).max() > 300 and np.abs(samples[-480:]).max() < np.abs(samples).max() / 2


def test_a_block_is_whole_strokes_of_the_bow(tmp_path: Path) -> None:
    assert SoundConfig(block=100).block == 96
    assert (
        render_file(swaying_phrase(0.2), StringsConfig(), SoundConfig(block=100), tmp_path / "out.wav") > 1.0
    )


def test_frames_of_another_skeleton_are_not_played(tmp_path: Path) -> None:
    """The card's own reader may see a new stage before `look` has built its strings."""
    stage = StageDouble(write_show(tmp_path / "show", strings={}))
    state = SimpleNamespace(read=ShowState)
    sound = Sound(SoundConfig(), stage, state, Fallbacks(OF_THE_SOUND))  # type: ignore[arg-type]
    sound.dance(stage, 10.0)  # type: ignore[arg-type]  # no strings yet
    sound.look(10.0)
    other = SimpleNamespace(tick=1, frame_time=0.0, positions=np.zeros((3, 3), np.float32))
    sound.dance(SimpleNamespace(newest=lambda now: other, facts=stage.facts), 10.0)  # type: ignore[arg-type]
    assert sound.instrument is not None and not sound.render(256, ShowState()).any()
