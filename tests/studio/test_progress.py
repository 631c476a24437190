"""Long work says how far it is: on a terminal with a bar, else in lines; and commands refuse idle options."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import pytest
from rich.console import Console

from appliance.studio import heartbeat
from appliance.studio.clear_errors import clear_errors
from appliance.studio.progress import EVERY_S, doing, reported, shown
from tests.studio.conftest import bunraku


def console(terminal: bool = False) -> Console:
    return Console(file=io.StringIO(), force_terminal=terminal, width=100)


def said(by: Console) -> str:
    assert isinstance(by.file, io.StringIO)
    return by.file.getvalue()


def test_without_a_terminal_a_line_begins_the_work_and_others_follow_now_and_then() -> None:
    seconds = iter(i * EVERY_S / 2 for i in range(100))
    into = console()
    assert list(shown(range(8), "planting the feet", into, now=lambda: next(seconds))) == list(range(8))
    lines = said(into).splitlines()
    assert lines[0] == "planting the feet ..."
    assert lines[1:] == [f"planting the feet: {share} %" for share in ("25", "50", "75")]


def test_what_takes_no_time_says_one_line_and_nothing_is_said_to_nobody() -> None:
    into = console()
    assert list(shown(iter("abc"), "coding", into, count=3, now=lambda: 0.0)) == ["a", "b", "c"]
    with doing("measuring", into):
        pass
    assert said(into).splitlines() == ["coding ...", "measuring ..."]
    assert list(shown([1], "coding", None)) == [1]


def test_parts_with_words_of_their_own_say_them_now_and_then() -> None:
    seconds = iter((0.0, 0.0, 1.0, EVERY_S, EVERY_S, 2 * EVERY_S, 2 * EVERY_S))
    into = console()
    with reported(into, 4, now=lambda: next(seconds)) as advance:
        for part in ("a", "b", "c", "d"):
            advance(part)
    assert said(into).splitlines() == ["0 %  a", "50 %  c", "75 %  d"]
    with reported(into) as advance:
        advance("of nobody knows how many")
    with reported(None, 3) as advance:
        advance("to nobody")
    assert said(into).splitlines()[3:] == ["of nobody knows how many"]


def test_a_command_that_is_silent_for_long_says_what_it_is_at(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(heartbeat, "QUIET_S", 0.02)
    with clear_errors("map"):
        print("drawing the map ...", file=sys.stderr)
        await_text(stream, "drawing the map ... 0 s", 2)
        Console(stderr=True).print("planting the feet: 40 %", highlight=False)
        await_text(stream, "planting the feet: 40 % ... 0 s", 1)
    assert sys.stderr is stream
    said_then = stream.getvalue()
    monkeypatch.setattr(heartbeat, "QUIET_S", 60.0)
    with clear_errors("map"):
        time.sleep(0.05)
    assert stream.getvalue() == said_then, "a quick command adds nothing"


def await_text(stream: io.StringIO, text: str, times: int) -> None:
    """Returns when the stream has the text so often; the test's own limit ends the waiting."""
    while stream.getvalue().count(text) < times:
        time.sleep(0.005)


def test_on_a_terminal_there_is_a_bar() -> None:
    into = console(terminal=True)
    assert list(shown(range(3), "coding", into)) == [0, 1, 2]
    assert "coding" in said(into) and "..." not in said(into)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("vary X.bvh --model M --mix Y.bvh --count 3 --sigma 2", "--sigma, --count do nothing with --mix"),
        ("vary X.bvh --model M --mix Y.bvh --seed 1", "--seed does nothing with --mix"),
        ("vary X.bvh --model M --share 0.3", "--share does nothing without --mix"),
        ("vary --free --model M --start 3", "--start does nothing without a PHRASE"),
        ("vary --free --model M --mix Y.bvh --region arms", "--mix, --region do nothing without a PHRASE"),
        ("path --model M --draw D.svg --out o.bvh --seed 4", "--seed does nothing with --draw"),
        ("granular C.pt --out o.bvh --to a", "--to does nothing without --from"),
        ("granular C.pt --out o.bvh --samples --speed 2", "--speed does nothing with --samples"),
        ("granular C.pt --out o.bvh --from a --mix 0.2", "--mix does nothing without --to"),
        ("granular C.pt --out o.bvh --from a --seed 2", "--seed does nothing with --from, except"),
        ("granular C.pt --out o.bvh --feedback 0.2 --hop 4", "--hop does nothing with --feedback"),
        ("improvise --model M --out o.bvh --minutes 3", "--minutes does nothing with --model"),
        ("improvise C.pt --out o.bvh --steps 3 --minutes 3", "--minutes does nothing with --steps"),
        ("improvise C.pt --out o.bvh --from 3", "--from does nothing without --prompt"),
        ("improvise C.pt --out o.bvh --prompt P --dances 3", "--dances does nothing with --prompt"),
        ("train --model pose --out o --name x", "--name does nothing with --model pose"),
        (
            "train --model pose --out o --puppet C.pt --recordings r",
            "--puppet does nothing with --model",
        ),
        (
            "train --model improviser --out o --puppet C.pt --keep a",
            "--keep does nothing without",
        ),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(arguments: str, message: str) -> None:
    result = bunraku(*arguments.split())
    reported = " ".join(result.output.replace("│", " ").split())
    assert result.exit_code == 2 and message in reported, reported


def test_a_resumed_training_refuses_what_it_cannot_follow(puppet_checkpoint: Path, recordings: Path) -> None:
    folder = puppet_checkpoint.parent
    for options, message in (
        (("--width", 999), "--width (it has"),
        (("--seed", 7), "--seed (it has 1)"),
        (("--model", "pose"), "--model (it has puppet)"),
        (("--held-out", "sway_0"), "--held-out"),
    ):
        result = bunraku("train", "--resume", "--out", folder, "--recordings", recordings, *options)
        reported = " ".join(result.output.split())
        assert result.exit_code == 2 and "cannot follow" in reported and message in reported, reported
