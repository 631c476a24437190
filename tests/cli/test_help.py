"""Help: a page for each command, with examples that parse; the nearest command for a word that is none."""

from __future__ import annotations

import re
import shlex
import zipfile
from collections.abc import Iterator
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest

from appliance.cli.app import PLUG_INS, parser, plug_ins
from appliance.cli.examples import EXAMPLES, ORDER, SYNONYMS
from appliance.cli.help_file import help_file
from appliance.cli.help_page import MACHINERY
from tests.command import Command

READING = {"metres_per_unit", "up", "facing", "true_fps", "root", "all_frames"}


@cache
def whole() -> Any:
    """The parser of all commands."""
    return parser(None, plug_ins(entry_points(group=PLUG_INS)))


def paths(command: Any, words: tuple[str, ...] = ()) -> Iterator[str]:
    yield " ".join(words)
    for name, below in getattr(command, "commands", {}).items():
        yield from paths(below, (*words, name))


ALL = sorted(paths(whole()))


def test_every_command_has_an_example_and_its_place() -> None:
    assert sorted(EXAMPLES) == ALL, "appliance/cli/examples.py has an example for each command, and no other"
    assert set(SYNONYMS) == set(ORDER)


@pytest.mark.parametrize("path", [path for path in ALL if path not in ("preflight", "release")])
def test_a_page_of_help(path: str, bunraku: Command) -> None:
    page = bunraku(*path.split(), "-h").out
    assert page == bunraku(*path.split(), "--help").out
    assert page.startswith(f"Usage: bunraku {path}".rstrip())
    assert not any(option in page for option in MACHINERY)
    options = page.partition("Options:")[2]
    assert not any(sign in options for sign in ("<bool>", "<path>", "range>", "<str>", "None", "\b"))
    commands = page.partition("Commands:")[2].partition("Example")[0]
    assert not re.search(r"\.\.\.$", commands, re.MULTILINE), "sentences of commands are whole"
    assert all(example in page for example in EXAMPLES[path])
    assert max(map(len, page.partition("Example")[0].splitlines())) <= 80


@pytest.mark.parametrize("example", sorted({one for examples in EXAMPLES.values() for one in examples}))
def test_an_example_parses(example: str) -> None:
    arguments = shlex.split(example.partition(" > ")[0])[1:]
    command, context = whole(), None
    while getattr(command, "commands", None) and arguments and not arguments[0].startswith("-"):
        command = command.commands[arguments.pop(0)]
    context = command.make_context("bunraku", arguments)
    assert context.params is not None


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("plai", "play"),
        ("strat", "play"),
        ("Doctor", "doctor"),
        ("dmx", "lights"),
        ("latency", "measure"),
        ("gltf", "convert"),
    ],
)
def test_the_nearest_command_by_spelling_or_meaning(word: str, meant: str, bunraku: Command) -> None:
    text = bunraku(word, status=2).err
    assert text == f"bunraku: There is no command '{word}'. Did you mean '{meant}'?\n"


def test_a_word_that_is_near_to_none(bunraku: Command) -> None:
    assert "bunraku -h lists all" in bunraku("qqqq", status=2).err


@pytest.mark.parametrize("arguments", ["--version", "play --version", "sensors --version"])
def test_the_version_by_any_command(arguments: str, bunraku: Command) -> None:
    assert bunraku(*arguments.split()).out == bunraku("version").out


def test_flags_take_no_value_and_values_have_words(bunraku: Command) -> None:
    assert re.search(r"^  --window +Show", bunraku("play", "-h").out, re.MULTILINE)
    page = bunraku("train", "-h").out
    assert re.search(r"^  --out FOLDER +Folder for the show. +\[required\]", page, re.MULTILINE)
    assert re.search(r"^  --catalogue FILE ", page, re.MULTILINE)
    assert re.search(r"^  --steps NUMBER ", page, re.MULTILINE)
    assert re.search(r"^  --name TEXT ", page, re.MULTILINE)


def test_every_command_that_reads_recordings_takes_the_same_options() -> None:
    commands = whole().commands
    readers = {name for name, one in commands.items() if {part.name for part in one.params} >= READING}
    assert readers == {
        *("filmstrip", "convert", "retarget", "inspect", "train", "evaluate", "export", "experiment"),
        *("granular", "improvise", "vary", "map", "path", "duet", "compare-blind"),
        *("compare", "periods", "explore"),
    }


BOX = """# our Wi-Fi password is swordfish
sensors: {keys: keys.yaml}
console:
  port: 8080
  report:
    webhook: https://me:hunter2@hooks.example.org/T0ken
    mail: {to: [a@b.c], sender: a@b.c, host: mail.b.c, user: stage, password: mail.password}
"""
LOG = [
    "12:00 play: The page: http://10.0.0.2:8080, PIN 123456.",
    "12:01 play: http://10.0.0.2/phone#left=abcdef2345",
]
SECRETS = ("swordfish", "hunter2", "T0ken", "123456", "abcdef2345", "mail.password")


def test_it_has_each_part_and_no_secret(tmp_path: Path) -> None:
    box, out = tmp_path / "box.yaml", tmp_path / "help.zip"
    box.write_text(BOX)
    help_file(
        out, box, tmp_path / "no journal", LOG, {"verdict": "PIN 123456"}, {"host": "stage"}, "All is well.\n"
    )
    with zipfile.ZipFile(out) as whole:
        parts = {name: whole.read(name).decode() for name in whole.namelist()}
    assert set(parts) == {"README.txt", "doctor.txt", "log.txt", "status.json", "box.yaml", "versions.json"}
    assert "missing" in parts["README.txt"] and "made" in parts["README.txt"]
    assert parts["doctor.txt"] == "All is well.\n"
    assert "port: 8080" in parts["box.yaml"] and "host: mail.b.c" in parts["box.yaml"]
    for name, text in parts.items():
        assert not [secret for secret in SECRETS if secret in text], name


def test_a_broken_box_file_is_no_reason_to_send_nothing(tmp_path: Path) -> None:
    box, out = tmp_path / "box.yaml", tmp_path / "help.zip"
    for text in ("a: [", "", "\ufeff- &a [*a]\n"):
        box.write_text(text)
        help_file(out, box, None, [], {}, {}, "")
        with zipfile.ZipFile(out) as whole:
            assert whole.read("box.yaml")
            assert "not asked for" in whole.read("README.txt").decode()
