"""Box files of strangers: deep, long, with places of the system; refused at once, and in few lines."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
import yaml

from appliance.cli.box_file import Change, change
from appliance.pose.foreign_yaml import DEEPEST, composed, plain_values
from appliance.sensor.keys import KeyFileError, parse_keys
from appliance.sensor.memory import DamagedMemoryError, read_memory
from appliance.show.box import load_box
from appliance.show.bundle import CHECKSUMS, write_checksums
from appliance.show.check import verify_bundle
from appliance.show.config_error import MOST_PROBLEMS, ConfigError
from appliance.show.yaml_edit import with_cue, with_value
from appliance.show.yaml_file import MAX_BYTES

DEEP = ["a: " + "[" * 100_000, "a: " + "{b: " * 60_000, "- " * 100_000, "? " * 100_000]


def box_file(folder: Path, text: str) -> Path:
    (folder / "box.yaml").write_text(text)
    return folder / "box.yaml"


@pytest.mark.parametrize("text", DEEP, ids=["[[[", "{b: {b:", "- - -", "? ? ?"])
def test_what_is_nested_deeper_than_anybody_writes_is_refused_at_once(text: str, tmp_path: Path) -> None:
    began = time.process_time()
    with pytest.raises(ValueError, match="nested too deeply"):
        with_value(text, ("control", "port"), 9003)
    with pytest.raises(ConfigError, match="nested too deeply"):
        load_box(box_file(tmp_path, text))
    with pytest.raises(yaml.YAMLError):
        with_cue(text, {"name": "calm"})
    with pytest.raises(KeyFileError):
        parse_keys(tmp_path / "keys.yaml", text)
    with pytest.raises(DamagedMemoryError):
        read_memory(text.encode())
    reported = change(box_file(tmp_path, ""), None, Change(text, [(["control", "port"], 9003)]))
    assert "nested too deeply" in reported["problems"][0]["message"]
    assert time.process_time() - began < 10.0, "it took 23 s for one of them"


def test_what_people_write_is_not_deep() -> None:
    assert composed("[" * (DEEPEST - 1) + "1" + "]" * (DEEPEST - 1)) is not None
    assert plain_values("a: [{b: [1]}]") == {"a": [{"b": [1]}]}
    with pytest.raises(yaml.YAMLError):
        plain_values("a: &x [1]\nb: [*x, *x]")


def test_a_value_that_no_file_holds_is_refused() -> None:
    deep: list[object] = []
    for _ in range(900):
        deep = [deep]
    with pytest.raises(ValueError, match="nested too deeply"):
        with_value("control: {port: 9002}\n", ("control", "port"), deep)


def test_a_text_of_any_length_is_bounded(tmp_path: Path) -> None:
    reported = change(box_file(tmp_path, ""), None, Change("#" * (MAX_BYTES + 1), []))
    assert "at most 256 kB" in reported["problems"][0]["message"]


@pytest.mark.parametrize("line", ["key{}: 1", "stat{}: 1", "a: {}"], ids=["unknown", "nearly", "twice"])
def test_twenty_thousand_mistakes_are_few_lines_and_say_how_many_more(tmp_path: Path, line: str) -> None:
    text = "\n".join(line.format(number) for number in range(20_000)) + "\n"
    began = time.process_time()
    with pytest.raises(ConfigError) as refused:
        load_box(box_file(tmp_path, text))
    assert time.process_time() - began < 30.0
    lines = str(refused.value).splitlines()
    assert len(lines) == MOST_PROBLEMS + 1
    left_out = 20_000 - MOST_PROBLEMS - ("twice" in lines[0])
    assert f"{left_out} more things are wrong below this line." in lines[-1]


@pytest.mark.parametrize("key", ["a\nb", "\x1b[2J", "‮evil", "x" * 5000, "\x07"])
def test_names_of_a_file_stay_in_their_quotes(tmp_path: Path, key: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_box(box_file(tmp_path, yaml.safe_dump({key: 1, "control": {key: 2}})))
    message = str(refused.value)
    assert len(message.splitlines()) == 2 and "Unknown key '" in message
    assert all(line.isprintable() and len(line) < 500 for line in message.splitlines())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sensors: {keys: /etc/shadow}", "belongs to the system"),
        ("sensors: {keys: /dev/zero}", "belongs to the system"),
        ("sensors: {keys: ../../../../../../../etc/shadow}", "belongs to the system"),
        ("sensors: {keys: link}", "belongs to the system"),
        ("sensors: {keys: .}", "is no file"),
        ("state: /dev/zero", "belongs to the system"),
        ("state: /proc/self", "belongs to the system"),
        ("state: box.yaml", "is no folder"),
        ("journal: {folder: box.yaml/deeper}", "is no folder"),
        ("journal: {folder: /etc}", "belongs to the system"),
        ("runtime: /etc/shadow", "belongs to the system"),
        ('runtime: "a\\0b"', "no name of a file"),
        ("sensors: {serial: [{device: /dev/zero}]}", "no serial device"),
        ("sensors: {serial: [{device: /etc/passwd}]}", "no serial device"),
        ("outputs: {dmx: [{universe: 1, wire: usb-pro, device: /dev/null}]}", "no serial device"),
    ],
)
def test_no_place_of_the_system_is_taken(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "link").symlink_to("/etc/shadow")
    with pytest.raises(ConfigError, match=message) as refused:
        load_box(box_file(tmp_path, text))
    assert refused.value.line == 1


def test_places_of_a_box_are_taken(tmp_path: Path) -> None:
    box = load_box(
        box_file(
            tmp_path,
            "state: /data/bunraku/state\nruntime: /dev/shm/bunraku-test\njournal: {folder: journal}\n"
            "sensors: {keys: /etc/bunraku/keys.yaml, serial: [{device: /dev/ttyACM9}]}\n",
        )
    )
    assert box.journal.folder == tmp_path / "journal" and str(box.runtime) == "/dev/shm/bunraku-test"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("console: null", "takes this page away"),
        ("control: null", "PANIC and BLACKOUT"),
        ("console: {host: 127.0.0.1}", "the box's own screen"),
        ("console: {host: '::', viewers: [0.0.0.0/0]}", "lets every device in"),
        ("console: {host: '::', viewers: ['::/0', 10.0.0.0/8]}", "lets every device in"),
        (
            "console: {host: '::', viewers: [10.0.0.0/8]}\n"
            "projector: {stream: {host: '::', viewers: [0.0.0.0/0]}}",
            "stream: viewers: 0.0.0.0/0 lets every device in",
        ),
    ],
)
def test_a_change_that_shuts_out_or_lets_all_in_is_asked_for_first(
    tmp_path: Path, text: str, message: str
) -> None:
    before = "console: {host: '::', viewers: [10.0.0.0/8]}\n"
    path = box_file(tmp_path, before)
    asked = change(path, None, Change(text, []))
    assert asked["problems"] == [] and message in " ".join(asked["asks"])
    assert path.read_text() == before, "nothing is written before it is answered"
    assert "is written" in change(path, None, Change(text, [], sure=True))["message"]
    assert path.read_text() == text
    assert "asks" not in change(path, None, Change(text + "\n", [])), "what is so already is not asked again"


def test_a_bundle_with_thousands_of_strange_files_is_told_in_few_lines(bundle: Path) -> None:
    write_checksums(bundle)
    with (bundle / CHECKSUMS).open("a") as sums:
        sums.write("no checksum\n" * 5000)
    for number in range(500):
        (bundle / f"strange{number}").touch()
    findings = verify_bundle(bundle)
    levels = [one.level for one in findings]
    assert levels == ["error"] * (MOST_PROBLEMS + 1) + ["warning"] * (MOST_PROBLEMS + 1)
    assert "4970 more things are wrong" in findings[MOST_PROBLEMS].message
    assert "470 more things are wrong" in findings[-1].message
