"""Commands about motion that is made ahead: their bounds, what they declare, and who keeps."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from appliance.box.made_motion import SavedNamesWriter
from appliance.levers.show_state import ShowState
from appliance.levers.sources import MOST_POINTS, PARAMETERS
from appliance.levers.status import Status
from appliance.levers.table import AGAIN, MADE_NUMBERS, PATH_POINTS, PHRASE
from appliance.show_control.command import command
from appliance.show_control.show_state_commands import declare
from appliance.show_control.stage_observer import StageObserver
from appliance.show_control.status_messages import answer_to
from tests.show_control.doubles import facts

SOURCES = ("main", "quiet", "vary", "granular", "path", "improvise")
NOW = 100.0


def declared(address: str, *arguments: Any, **more: Any) -> tuple[ShowState, str]:
    """What a command declares in a show with all sources."""
    before = more.pop("before", ShowState(show="A test"))
    asked = command(address, arguments)
    return declare(before, asked, facts(**{"phrases": SOURCES} | more), NOW)


@pytest.mark.parametrize("source", PARAMETERS)
def test_each_parameter_is_declared_within_its_bounds(source: str) -> None:
    for name, about in PARAMETERS[source].items():
        address = f"/motion/{source}/{name}"
        state, message = declared(address, about.most, 3.0)
        assert state[MADE_NUMBERS[source][name]].value == about.most and name in message
        for wrong in ((about.most + 1,), (about.least - 1,), (), (about.least, 100.0), ("far",)):
            with pytest.raises(ValueError, match=address):
                declared(address, *wrong)


def test_points_of_the_map_come_in_pairs_between_0_and_1() -> None:
    for count in (0, 1, MOST_POINTS):
        state, message = declared("/motion/path", *[0.25, 0.75] * count)
        assert state[PATH_POINTS].value == (0.25, 0.75) * count and message
    with pytest.raises(ValueError, match="has no y"):
        declared("/motion/path", 0.5, 0.5, 0.5)
    for wrong in ((0.5, 1.5), [0.5] * (2 * MOST_POINTS + 1)):
        with pytest.raises(ValueError, match=r"takes .*\.\.\."):
            declared("/motion/path", *wrong)


def test_again_counts_on() -> None:
    once, _ = declared("/motion/again")
    twice, _ = declared("/motion/again", before=once)
    assert [state[AGAIN].value for state in (once, twice)] == [1, 2]


def test_a_show_without_the_source_is_told_so() -> None:
    for address, arguments in {
        "/motion/vary/sigma": (1.0,),
        "/motion/path": (0.5, 0.5),
        "/motion/again": (),
    }.items():
        with pytest.raises(ValueError, match="source"):
            declared(address, *arguments, phrases=("main",))


def test_a_cue_declares_the_parameters_that_it_names_with_its_fade() -> None:
    changes = {"vary": {"sigma": 2.0}, "path": {"points": [0.25, 0.75]}}
    cue = {"name": "wild", "phrase": "vary", "motion": changes, "fade_s": 8.0}
    state, _ = declared("/cue", "wild", cues=(cue,))
    sigma, phrase = state[MADE_NUMBERS["vary"]["sigma"]], state[PHRASE]
    assert (sigma.value, sigma.seconds) == (2.0, 8.0)
    assert (phrase.value, phrase.seconds) == ("vary", 8.0)
    assert state[PATH_POINTS].value == (0.25, 0.75)
    assert len([name for name in state.settings if name.startswith("motion")]) == 2


def test_kept_motions_are_known_by_name(tmp_path: Path) -> None:
    with closing(SavedNamesWriter(tmp_path)) as writer, closing(StageObserver(tmp_path)) as observer:
        assert observer.saved() == ()
        writer.write(["anna", "bert"])
        assert observer.saved() == ("anna", "bert")


def test_the_status_tells_what_is_danced_and_every_parameter() -> None:
    state, _ = declared("/motion/vary/sigma", 2.0, 8.0)
    shown = facts(motion={"vary": {"sigma": 0.7, "seed": 3}})
    recipe = {"source": "vary", "sigma": 0.9, "seed": 4, "number": 1001, "prompt": "long"}
    for made, danced in (("", []), (json.dumps(recipe), [("source", "vary"), ("sigma", 0.9), ("seed", 4)])):
        health = {"puppets": [{"is_led": True, "made": made}]}
        seen = SimpleNamespace(facts=shown, health=lambda health=health: health)
        observer = cast(StageObserver, seen)
        *answers, end = answer_to("/motion", state, observer, Status(phrase="vary"), NOW)
        assert [answer[1:] for answer in answers if answer[0] == "/motion/is"] == danced
        parameters = [answer[1:] for answer in answers if answer[0] == "/motion/parameter"]
        assert parameters == [("vary", "sigma", 2.0), ("vary", "seed", 3.0)]
        assert end == ("/end", "/motion", len(answers))
