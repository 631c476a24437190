"""Commands are checked at the door; the documentation lists them all."""

from __future__ import annotations

from pathlib import Path

import pytest

from appliance.levers.addresses import FORMS
from appliance.show_control.command import Command, command

DOCS = Path(__file__).resolve().parents[2] / "docs" / "osc.md"


@pytest.mark.parametrize(
    ("address", "arguments", "expected"),
    [
        ("/go", [], Command("/go")),
        ("/go", [1.0], Command("/go", (1.0,))),
        ("/panic", [], Command("/panic")),
        ("/panic", [0], Command("/panic", (0.0,))),
        ("/panic", [0.0], Command("/panic", (0.0,))),
        ("/panic", [False], Command("/panic", (0.0,))),
        ("/panic", [127], Command("/panic")),
        ("/panic", [0.5], Command("/panic")),
        ("/panic", ["now\a"], Command("/panic")),
        ("/panic", [None], Command("/panic")),
        ("/panic", [0, 0], Command("/panic")),
        ("/blackout", [True], Command("/blackout", (1.0,))),
        ("/master", [0.5, 3], Command("/master", (0.5, 3.0))),
        ("/cue", [], Command("/cue")),
        ("/cue", ["storm"], Command("/cue", (), "storm")),
        ("/cue", [3], Command("/cue", (), "3")),
        ("/cue", [3.0], Command("/cue", (), "3")),
        ("/cue", [2.5], Command("/cue", (), "2.5")),
        ("/look", ["ink", 4], Command("/look", (4.0,), "ink")),
        ("/hold", ["lShldr", 1], Command("/hold", (1.0,), "lShldr")),
        ("/hold", [7, 0], Command("/hold", (0.0,), 7)),
        ("/iterations", [12.0, 11], Command("/iterations", (12.0, 11.0))),
        ("/player/excerpt", [1.0, 2.0], Command("/player/excerpt", (1.0, 2.0))),
        ("/mocap/setjointrot", [3, 0, 1, 0, 1.5], Command("/mocap/setjointrot", (0.0, 1.0, 0.0, 1.5), 3)),
        ("/mocap/setjointpos", [3, 0.5, 1, -2], Command("/mocap/setjointpos", (0.5, 1.0, -2.0), 3)),
        ("/mocap/setjointpos", ["h", 0, 1, 2, 0.5], Command("/mocap/setjointpos", (0.0, 1.0, 2.0, 0.5), "h")),
        ("/projector/corner", [4, -0.5, 1.5], Command("/projector/corner", (4.0, -0.5, 1.5))),
        ("/projector/nudge", [1, -0.01, 0], Command("/projector/nudge", (1.0, -0.01, 0.0))),
        ("/projector/brightness", [2], Command("/projector/brightness", (2.0,))),
        ("/sensors/neutral", [], Command("/sensors/neutral")),
    ],
)
def test_what_keeps_to_its_form_is_taken(address: str, arguments: list[object], expected: Command) -> None:
    assert command(address, arguments) == expected


@pytest.mark.parametrize(
    ("address", "arguments", "complaint"),
    [
        ("/pannic", [], r"Did you mean /panic\?"),
        ("/player/go", [], "is no command"),
        ("/x", [], "docs/osc.md lists"),
        ("/go", [2], "takes \\[0 or 1\\]"),
        ("/go", [0.5], "0 or 1"),
        ("/blackout", [], "takes 0 or 1"),
        ("/blackout", ["on"], "takes 0 or 1"),
        ("/master", [1.5], r"brightness \(0 to 1\)"),
        ("/master", [-0.1], r"brightness \(0 to 1\)"),
        ("/master", [float("nan")], "brightness"),
        ("/master", [float("inf")], "brightness"),
        ("/master", [0.5, 61], r"fade in seconds \(0 to 60\)"),
        ("/stop", [-1], "fade in seconds"),
        ("/cue", [[]], "takes"),
        ("/cue", [float("nan")], "takes"),
        ("/cue", ["a", "b"], "takes"),
        ("/cue", ["x" * 101], "takes"),
        ("/look", [], "takes look"),
        ("/look", [3], "takes look"),
        ("/hold", ["lShldr"], "takes joint, 0 or 1"),
        ("/hold", [True, 1], "takes joint"),
        ("/hold", [1.5, 1], "takes joint"),
        ("/iterations", [5.5, 4], "coding"),
        ("/iterations", [65, 2], r"coding \(0 to 64\)"),
        ("/iterations", [1, 2, 3], "coding"),
        ("/liveliness", [1.5], r"liveliness \(0 to 1\)"),
        ("/liveliness", [], "liveliness"),
        ("/seed", [2**31], "seed"),
        ("/seed", [0.5], "seed"),
        ("/seed", [-1], "seed"),
        ("/player/jump", [], "second"),
        ("/player/jump", ["soon"], "second"),
        ("/player/jump", [-1.0], r"second \(from 0\)"),
        ("/player/rate", [5.0], r"rate \(-4 to 4\)"),
        ("/player/excerpt", [1.0, 2.0, 3.0], "start"),
        ("/mocap/setjointrot", [0.1, 0.0, 1.0, 0.0, 1.5], "takes joint"),
        ("/mocap/setjointrot", ["lShldr", 1.0], "takes joint"),
        ("/mocap/setjointpos", ["lShldr", 1.0, 1.0], "takes joint, x in metres, y in metres, z in metres"),
        ("/mocap/setjointpos", ["lShldr", 1.0, float("nan"), 0.0], "y in metres"),
        ("/mocap/setjointpos", ["lShldr", 0, 0, 0, 0], r"seconds \(0.1 to 3600\)"),
        ("/projector/corner", [0, 0.5, 0.5], r"corner \(1 to 4\)"),
        ("/projector/corner", [1, 1.6, 0.5], r"x \(-0.5 to 1.5\)"),
        ("/projector/nudge", [1, 1.1, 0], r"dx \(-1 to 1\)"),
        ("/projector/brightness", [2.1], r"brightness \(0 to 2\)"),
        ("/projector/corners", [0.0] * 7, "takes"),
        ("/sensors/strobe", [], "takes sensor"),
        ("/sensors/strobe", ["a", "b"], "takes sensor"),
        ("/sensors/neutral", [1], r"takes \[sensor\]"),
        ("/sensors/heading", [""], r"takes \[sensor\]"),
        ("/sensors/reload", ["now"], "takes nothing"),
        ("/ping", [b"blob"], "takes nothing"),
        ("/sensors/strobe", ["\x1b[2J"], "no control characters"),
        ("/mocap/releasejoint", ["\x9b31m"], "no control characters"),
        ("/player/\x1b[2J", [], "no control characters"),
    ],
)
def test_what_is_no_command_is_refused_in_words(
    address: str, arguments: list[object], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        command(address, arguments)


def test_the_documentation_lists_every_command() -> None:
    text = DOCS.read_text()
    assert [address for address in FORMS if f"`{address}`" not in text] == []
