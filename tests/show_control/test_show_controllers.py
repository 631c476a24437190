"""Show controllers: Companion's page, and the examples for QLab and Eos, at the real control port."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.levers.show_state import Change, ShowState
from appliance.levers.table import CUE, GOING, LOOK, MASTER
from appliance.show.bundle import default_show_path
from appliance.show.control import ControlConfig, FeedbackConfig
from appliance.show.show import load_show
from appliance.show_control.feedback import messages_of
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "deploy" / "companion" / "bunraku.companionconfig"
EXAMPLES = (ROOT / "docs" / "osc.md").read_text().partition("### Show controllers")[2].partition("\n\n**")[0]
Words = list[Any]


def sent(action: str, options: dict[str, Any]) -> Words:
    """The message that Companion's generic OSC module makes of an action: its README and its source."""
    path = options["path"]
    if action == "send_blank":
        return [path]
    if action == "send_multiple":
        words = shlex.split(options["arguments"])
        return [path, *(_number(one) for one in words)]
    kind = action.removeprefix("send_")
    return [path, {"int": int, "float": float, "string": str}[kind](options[kind])]


def _number(word: str) -> Any:
    if not re.fullmatch(r"-?[\d.]+", word):
        return word
    return float(word) if "." in word else int(word)


def by_example() -> Iterator[tuple[str, Words]]:
    """As each program's manual has it: QLab and Companion with quotes, Eos with = and commas."""
    rows = [line.split("|")[1:-1] for line in EXAMPLES.splitlines() if line.startswith("| ")][1:]
    for program, _, *examples in rows:
        for example in (cell.strip().strip("`") for cell in examples):
            address, _, listed = example.partition("=")
            words = listed.split(",") if listed else []
            if "Eos" not in program:
                address, *words = shlex.split(example)
            yield program.strip(), [address, *map(_number, words)]


def buttons() -> list[dict[str, Any]]:
    rows = json.loads(PAGE.read_text())["page"]["controls"].values()
    return [button for row in rows for button in row.values()]


@pytest.fixture
def asker(folder: Path, key_file: Path) -> Iterator[Asker]:
    """A control port beside a stage that dances the show of the box, with a cue of the examples."""
    show = load_show(default_show_path()).config
    cues = [{"name": name, "fade_s": 0.0} for name in ("walk in", *(one.name for one in show.cues))]
    known = facts(show_name=show.name, cues=cues, looks=tuple(one.name for one in show.looks))
    with StageDouble(folder, known):
        control = ControlInThread(folder, key_file)
        asker = Asker(control.port)
        yield asker
        asker.close()
        control.close()


def test_each_button_and_each_example_is_done_by_the_box(asker: Asker) -> None:
    """The null is a misspelt look: the same reply says no."""
    from_companion = [
        sent(action["action"], action["options"])
        for button in buttons()
        for action in button["steps"]["0"]["action_sets"]["down"]
    ]
    examples = [*by_example()]
    assert {program.split()[0] for program, _ in examples} == {"QLab", "ETC", "Companion"}
    assert len(from_companion) == len(buttons()) >= 20 and len(examples) == 9
    for words in (*from_companion, *(words for _, words in examples)):
        assert asker.ask("/cue", "walk in")[2] == 1, "behind the last one there is no next cue"
        address, about, done, sentence = asker.ask(*words)
        assert (address, about, done) == ("/reply", words[0], 1), (words, sentence)
    assert asker.ask("/look", "inc")[2] == 0


def test_each_lit_button_waits_for_what_the_box_tells() -> None:
    """By address, type and value; each is lit by its own command."""
    page = json.loads(PAGE.read_text())
    ((box, connection),) = page["instances"].items()
    assert connection["config"]["targetPort"] == str(ControlConfig().port)
    assert connection["config"]["feedbackPort"] == str(FeedbackConfig().port)
    kinds = {"osc_feedback_int": int, "osc_feedback_float": float, "osc_feedback_string": str}
    lit = 0
    for button in buttons():
        (action,) = button["steps"]["0"]["action_sets"]["down"]
        assert action["instance"] == box
        for one in button["feedbacks"]:
            lit += 1
            assert one["instance_id"] == box
            path, value = one["options"]["path"], kinds[one["type"]](one["options"]["arguments"])
            states = [ShowState(blackout=True), ShowState(panic=True), _with(path, value)]
            reported = [message for state in states for message in messages_of(state)]
            assert any(
                message[0] == path and message[1] == value and type(message[1]) is kinds[one["type"]]
                for message in reported
            ), (path, value)
    assert lit >= 20


def _with(path: str, value: Any) -> ShowState:
    """A state in which a lever is there."""
    levers = {one.address: one for one in (LOOK, MASTER)} | {"/cue": CUE, "/go": GOING}
    return ShowState().changed(0.0, [Change(levers[path], value)] if path in levers else [])
