"""Cues over the real port: what one declares, in which order they follow, and what wins over them."""

from __future__ import annotations

from pathlib import Path

from appliance.levers.show_state import ShowState
from appliance.levers.table import (
    CAMERA,
    CARD,
    CUE,
    ITERATIONS,
    LIGHTS,
    LIVELINESS,
    LOOK,
    MASTER,
    PHRASE,
    SEED,
    hand,
)
from tests.show_control.doubles import Asker, StageDouble
from tests.show_control.in_force import declared, show_state


def shown(now: ShowState) -> tuple[str, str, str, float]:
    return now.cue, now[LOOK].value, now[LIGHTS].value, now[MASTER].value


def test_a_cue_declares_picture_lights_and_dance_and_is_answered_when_the_dance_follows(
    folder: Path, stage: StageDouble, asker: Asker
) -> None:
    stage.remark = "At most 8 iterations fit."
    assert asker.ask("/cue", "storm") == ["/reply", "/cue", 1, "Cue storm. At most 8 iterations fit."]
    now = show_state(folder)
    assert shown(now) == ("storm", "ink", "cold", 0.5)
    assert (now[CARD].value, now[CAMERA].value) == ("blank", {"angle_deg": 30.0})
    assert [now[lever].seconds for lever in (LOOK, LIGHTS, MASTER)] == [4.0, 4.0, 4.0]
    assert declared(folder, PHRASE) == ("quiet", 4.0)
    assert declared(folder, hand("lShldr")) == (False, 0.0)
    assert declared(folder, ITERATIONS) == ((12, 11), 4.0)
    assert declared(folder, LIVELINESS) == (0.25, 4.0)
    assert declared(folder, SEED) == (7, 0.0)
    before = now.settings
    assert asker.ask("/cue", 1)[2] == 1
    now = show_state(folder)
    assert shown(now) == ("1", "lines", "cold", 0.5)
    assert declared(folder, CUE) == ("1", 0.0)
    assert {name for name in before if now.settings[name] != before[name]} == {"cue", "look"}


def test_a_command_again_is_declared_again(folder: Path, stage: StageDouble, asker: Asker) -> None:
    """A phrase of which a part plays goes back to the whole phrase."""
    generations = []
    for message in (("/phrase", "quiet"), ("/phrase", "quiet"), ("/cue", "storm"), ("/cue", "storm")):
        assert asker.ask(*message)[2] == 1
        generations.append(show_state(folder)[PHRASE].generation)
    assert generations == sorted(set(generations))


def test_what_is_said_after_a_cue_wins_over_it(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.tell("/look", "lines")
    asker.tell("/cue", "storm")
    asker.tell("/master", 0.25)
    asker.tell("/cue", "1")
    assert {asker.hear()[1] for _ in range(4)} == {"/look", "/cue", "/master"}  # type: ignore[index]
    now = show_state(folder)
    assert shown(now) == ("1", "lines", "cold", 0.25)


def test_cues_follow_each_other(folder: Path, stage: StageDouble, asker: Asker) -> None:
    assert [asker.ask("/cue")[3] for _ in range(2)] == ["Cue 1.", "Cue storm."]
    _, _, done, message = asker.ask("/cue")
    assert not done
    assert "storm was the last cue" in message
    assert show_state(folder).cue == "storm"
