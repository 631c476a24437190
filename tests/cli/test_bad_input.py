"""Bad input to every command: a sentence that says what to do and a status that is not zero, no traceback."""

from __future__ import annotations

import errno
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.pose.bvh import write_bvh
from appliance.sensor.keys import create_keys
from tests.command import Command
from tests.studio.tiny import swaying, write_recordings, write_tiny_show

REFUSED = 2
READERS = """
play --show {}
play --alone --show {show} --box {}
check {}
check {show} --box {}
pack {}
project --box {}
control --box {}
console --box {}
console pin --box {}
keep --box {}
kept --box {}
firewall --box {}
journal list --journal {}
journal export {out}/j --journal {}
journal list --box {}
replay {}
filmstrip {}
filmstrip {phrase} --look plaster --show {}
convert {} {out}/c.glb
import {} --out {out}/i.bvh
import {points} --names {} --out {out}/i.bvh
import {points} --like {} --out {out}/i.bvh
sensors --box {}
sensors revoke head --keys {}
lights --show {} --box {rig}
lights test --show {} --box {box}
lights show --show {} --out {out}/rig.png
lights convert {}
emulate --motion trace --trace {} --keys {out}/keys --sensor head --joint lShldr --seconds 0.1
emulate --keys {} --count 2 --seconds 0.1
measure --seconds 4 --show {}
measure --seconds 4 --box {}
train --recordings {} --out {out}/t --steps 1
train --recordings {recordings} --catalogue {} --out {out}/t --steps 1
train --puppet {} --model improviser --out {out}/t --steps 1
evaluate {} {phrase}
evaluate {show} {}
evaluate {show} {phrase} --hands {} --reference {recordings}
export {} --out {out}/e
improvise {} --out {out}/i.bvh
granular {} --out {out}/g.bvh
experiment --out {out}/x --show {} --no-pictures
vary {phrase} --model {} --out {out}/v
path {phrase} --model {} --out {out}/p.bvh --wobble 0.1 1
map {phrase} --model {} --out {out}/m
"""
WRITERS = """
pack {edited}
filmstrip {phrase} --out {}/a.png
convert {phrase} {}/a.glb
convert {phrase} {}/a.bvh
lights convert {fixture} --out {}/a.yaml
emulate --keys {}/sensors.keys --sensor head --seconds 0.1
emulate --keys {keys} --log {}/log.csv --seconds 0.1
train --recordings {recordings} --out {}/show --steps 1
"""
BAD = ("nowhere", "link", "noise", "blank", "folder", "pipe")
GOOD = {("--box {}", "blank"), ("--catalogue {}", "blank"), ("emulate --keys {}", "nowhere")}  # no trouble
NO_SENTENCE = re.compile(r"\[Errno|Traceback|\w+Error\b|\bNone\b|object at 0x")


def readers() -> list[tuple[str, str]]:
    """Each command with two of the bad files, in turn, so that every kind of trouble meets many commands."""
    commands = READERS.strip().splitlines()
    found = [(one, BAD[(2 * n + more) % len(BAD)]) for n, one in enumerate(commands) for more in (0, 1)]
    return [(one, bad) for one, bad in found if not any(part in one and bad == good for part, good in GOOD)]


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Bad files and good ones, by their names in the commands above."""
    root = tmp_path_factory.mktemp("bad")
    bad = ("nowhere.bvh", "link.bvh", "noise.bvh", "blank.bvh", "folder.bvh", "pipe.bvh", "still.bvh")
    good = (
        "alone",
        "out",
        "edited",
        "show",
        "phrase.bvh",
        "recordings",
        "points.csv",
        "box.yaml",
        "rig.yaml",
        "keys",
    )
    at = {name.partition(".")[0]: root / name for name in (*bad, *good, "fixture.json")}
    at["link"].symlink_to(root / "gone.bvh")
    at["noise"].write_bytes(bytes(range(256)) * 40)
    at["blank"].touch()
    for name in ("folder", "out", "alone"):
        at[name].mkdir()
    os.mkfifo(at["pipe"])
    write_tiny_show(at["show"])
    write_tiny_show(at["edited"])
    write_recordings(at["recordings"])
    write_bvh(at["phrase"], swaying(2.0))
    for one_frame in (at["still"], at["alone"] / "still.bvh"):
        write_bvh(one_frame, swaying(2.0).excerpt(0.0, 0.02))
    at["points"].write_text("Hips x,Hips y,Hips z\n" + "0,1,0\n" * 9)
    at["box"].write_text("control: null\nconsole: null\nsensors: {udp: null}\noutputs: {osc: []}\n")
    at["rig"].write_text("outputs: {dmx: [{universe: 1, wire: artnet, host: 127.0.0.1}]}\n")
    create_keys(at["keys"], ["head"])
    channel = {"Dimmer": {"capability": {"type": "Intensity"}}}
    modes = [{"name": "m", "channels": ["Dimmer"]}]
    at["fixture"].write_text(json.dumps({"name": "x", "modes": modes, "availableChannels": channel}))
    return at


def refused(bunraku: Command, arguments: str, place: Path, at: dict[str, Path]) -> str:
    """What a command that must fail says, judged: sentences, about the file that was given."""
    said = bunraku(*(word.format(place, **at) for word in arguments.split()), status=REFUSED).err.strip()
    assert not NO_SENTENCE.search(said), said
    assert said.endswith((".", "?")), said
    return said


def test_there_are_60_kinds_of_bad_input() -> None:
    assert len(readers()) + len(WRITERS.strip().splitlines()) > 60


@pytest.mark.parametrize(("arguments", "bad"), readers())
def test_what_cannot_be_read_is_refused_in_a_sentence(
    arguments: str, bad: str, at: dict[str, Path], bunraku: Command
) -> None:
    assert at[bad].name in refused(bunraku, arguments, at[bad], at)


@pytest.mark.parametrize("arguments", WRITERS.strip().splitlines())
def test_what_cannot_be_written_is_refused_in_a_sentence(
    arguments: str, at: dict[str, Path], disk: Callable[[int, Path], None], bunraku: Command, tmp_path: Path
) -> None:
    folder = at["edited"] if "{edited}" in arguments else tmp_path
    (at["edited"] / "show.yaml").touch()
    disk(errno.EROFS, folder)
    assert "read-only" in refused(bunraku, arguments, tmp_path, at).lower()


def test_one_frame_is_too_little_to_learn_from(at: dict[str, Path], bunraku: Command) -> None:
    said = refused(bunraku, "train --recordings {} --out {out}/t --steps 1", at["alone"], at)
    assert "Nothing moves" in said
    refused(bunraku, "evaluate {show} {}", at["still"], at)


@pytest.fixture
def disk() -> Iterator[Callable[[int, Path], None]]:
    """Lets the system refuse each file that is written below a folder, with an error's number."""
    refusing: list[tuple[int, str]] = []

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if not refusing or event not in ("open", "os.mkdir"):
            return
        number, folder = refusing[0]
        writes = event == "os.mkdir" or (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if writes and isinstance(arguments[0], str) and arguments[0].startswith(folder):
            raise OSError(number, os.strerror(number), arguments[0])

    sys.addaudithook(hook)  # it stays, and does nothing after the test
    yield lambda number, folder: refusing.append((number, str(folder)))
    refusing.clear()
