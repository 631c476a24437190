"""Bad input to every command: a sentence that says what to do and a status that is not zero, no traceback."""

from __future__ import annotations

import errno
import json
import os
import random
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from appliance.cli.check import check_show
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.pose.bvh import write_bvh
from appliance.sensor.keys import create_keys
from appliance.show.bundle import CHECKSUMS, write_checksums
from appliance.stage.stage_error import StageError
from tests.bundles import write_show
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


DEADLINE_S = 120.0  # far more than the check's own limit, on a busy machine
SOUND = b"It is sound."
ROUNDS, MOST_ROUNDS = 3, 10  # each kind is tried so often; MOST_ROUNDS with --long
FILES = ("show.yaml", "skeleton.bvh", "phrase.bvh", "puppet.onnx", "report.json", CHECKSUMS)
SHOW = """\
name: A test
dancer: {network: puppet.onnx, coding_iterations: 3, interaction_iterations: 2, hop: 1}
motion: {phrase: phrase.bvh, phrases: {quiet: phrase.bvh}, start_s: 0.5, rate: 1.0, grounded: true}
hands:
  - {sensor: left-wrist, joint: lShldr, facing: [1, 0, 0], at_neutral: [1, 0, 0, 0]}
  - {turning: {axis: [0, 1, 0], seconds_per_turn: 5}, joint: Chest, weight: 0.5}
looks: [{name: marble, style: plaster, figure: '#f2e6d8', camera: {move: orbit, period_s: 120}}]
lights:
  fixtures: [{name: wash, profile: led-par, universe: 1, address: 101, place: [0, 4, 2]}]
  mappings: [{name: warm, rules: [{reads: speed, drives: dimmer, attack_s: 0.1, fixtures: [wash]}]}]
cues: [{name: storm, phrase: quiet, iterations: [3, 2], hands: [lShldr], look: marble, lights: warm}]
"""
ODD = (
    *("", "~", "1:60:59", "0x" + "f" * 5000, "9" * 5000, "1e400", ".nan", "-.inf", "0o8", "2026-02-30"),
    *("=", "<<", "!!binary x", "!!python/object:os.system x", "&a [*a]", "*a", "? [1]", "{", "[" * 2000),
    *("- - - -", "\t", "|", "'\\0'", '"\\0"', '"\\ud800"', "a/../../b", "/dev/zero", "..", "\x85", "true"),
    *("-1", "1.5", "1e-400"),
)
PLAIN = (None, True, -1, 0, 1, 3, 0.5, 1e300, 10**30, "", "x", "lShldr", "phrase.bvh", "\xe4\0")


def random_tree(rng: random.Random, depth: int = 0) -> Any:
    kind = rng.randrange(3 if depth < 4 else 1)
    if kind == 1:
        return [random_tree(rng, depth + 1) for _ in range(rng.randrange(4))]
    if kind == 2:
        keys = (*yaml.safe_load(SHOW), "name", "joint", "sensor", "x", "")
        return {rng.choice(keys): random_tree(rng, depth + 1) for _ in range(rng.randrange(4))}
    return rng.choice((None, True, -1, 0, 1, 3, 0.5, 1e300, 10**30, "", "x", "lShldr", "phrase.bvh", "ä\0"))


def changed_tree(value: Any, rng: random.Random) -> Any:
    """The same tree, somewhere with another value."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        return value | {key: changed_tree(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        place = rng.randrange(len(value))
        return [*value[:place], changed_tree(value[place], rng), *value[place + 1 :]]
    return random_tree(rng)


def random_show(rng: random.Random) -> bytes:
    if rng.random() < 0.2:
        return yaml.safe_dump(random_tree(rng)).encode()
    return yaml.safe_dump(changed_tree(yaml.safe_load(SHOW), rng), sort_keys=False).encode()


def odd_show(rng: random.Random) -> bytes:
    """Something that YAML knows and a show does not, in the place of a word."""
    words = SHOW.split(" ")
    words[rng.randrange(1, len(words))] = rng.choice(ODD)
    return " ".join(words).encode(errors="surrogatepass")


def random_bytes(rng: random.Random) -> bytes:
    return rng.randbytes(rng.choice((0, 1, 100, 100_000)))


def damaged(whole: bytes, rng: random.Random) -> bytes:
    """Some bytes are others, a part is missing or stands there twice."""
    data = bytearray(whole)
    for _ in range(rng.randrange(1, 9)):
        data[rng.randrange(len(data))] = rng.randrange(256)
    begin, end = sorted(rng.randrange(len(data)) for _ in range(2))
    return bytes(rng.choice((data, data[:begin], data[:begin] + data[end:], data[:end] + data[begin:])))


@pytest.mark.parametrize("name", FILES)
def test_check_ends_with_words_whatever_a_file_holds(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, rng: random.Random, long_run: bool
) -> None:
    show, box = write_show(tmp_path / "show"), tmp_path / "box.yaml"
    box.write_text("control: null\nsensors: {udp: null}\noutputs: {osc: []}\n")
    (show / "show.yaml").write_text(SHOW)
    (show / "report.json").write_text('{"network": {"joints": 17}, "minutes": [1, 2.5]}\n')
    write_checksums(show)
    assert said(show, box) == SOUND
    whole = (show / name).read_bytes()
    made: list[Callable[[], bytes]] = [lambda: random_bytes(rng), lambda: damaged(whole, rng)]
    if name == "show.yaml":
        made += [lambda: random_show(rng), lambda: odd_show(rng)] * 3
    for make in made * (MOST_ROUNDS if long_run else ROUNDS):
        content = make()
        (show / name).write_bytes(content)
        if name != CHECKSUMS:
            write_checksums(show)
        reported = run_with_timeout(DEADLINE_S, lambda: said(show, box)).decode()
        assert reported and "Traceback" not in reported + capfd.readouterr().err, content
        if name != "puppet.onnx":  # what native code does with a damaged one is given up, and said
            assert "given up" not in reported, content


def said(show: Path, box: Path) -> bytes:
    try:
        check_show(show, box)
    except StageError as error:
        return str(error).encode(errors="replace")
    return SOUND
