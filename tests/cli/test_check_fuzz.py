"""`check` over files full of chance: it ends in time, with words and without a traceback."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from appliance.cli.check import check_show
from appliance.cli.run_with_timeout import run_with_timeout
from appliance.show.bundle import CHECKSUMS, write_checksums
from appliance.stage.stage_error import StageError
from tests.bundles import write_show

DEADLINE_S = 120.0  # far more than the check's own limit, on a busy machine
SOUND = b"It is sound."
ROUNDS, MOST_ROUNDS = 3, 10  # of each kind; MOST_ROUNDS with --long
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
