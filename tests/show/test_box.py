"""box.yaml: defaults on loopback, files beside it, faults with their line."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.show.asked_for import require_sound, require_wires
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError, NotAskedForError


def box(directory: Path, text: str) -> BoxConfig:
    path = directory / "box.yaml"
    path.write_text(text)
    return load_box(path)


def test_without_a_file_everything_is_on_this_machine() -> None:
    config = load_box(None)
    assert config.sensors.udp is not None and config.control is not None
    (receiver,) = config.outputs.osc
    assert {config.sensors.udp.host, config.control.host, receiver.host} == {"127.0.0.1"}
    assert (config.sensors.udp.port, config.control.port, receiver.port) == (9750, 9002, 9004)
    assert (receiver.dialect, receiver.frame_message) == ("ai-toolbox", False)
    assert config.limits.tick_budget_ms == 10.0
    assert config.realtime.enabled and config.realtime.priority == 70
    assert config.sensors.keys is None and config.journal.folder is None and config.phase_lock


def test_an_empty_file_is_the_defaults(tmp_path: Path) -> None:
    assert box(tmp_path, "# nothing yet\n") == load_box(None)


def test_everything_can_be_said(tmp_path: Path) -> None:
    config = box(
        tmp_path,
        "sensors:\n"
        "  udp: {host: 0.0.0.0, port: 9751}\n"
        "  serial: [{device: /dev/ttyACM0, baud: 9600}]\n"
        "  keys: state/sensors.keys\n"
        "outputs:\n"
        "  osc:\n"
        "    - {host: localhost, port: 1234, dialect: vmc, frame_message: yes}\n"
        "    - {host: 10.0.0.7, dialect: joint}\n"
        "control: null\n"
        "limits: {tick_budget_ms: 8, late_ms: 12.5}\n"
        "realtime: {priority: 40, enabled: false}\n"
        "phase_lock: off\n"
        "journal: {folder: /var/lib/bunraku/journal, minutes: 5}\n",
    )
    assert config.sensors.keys == tmp_path / "state" / "sensors.keys"
    assert config.journal.folder == Path("/var/lib/bunraku/journal")
    assert [(r.host, r.port, r.dialect, r.frame_message) for r in config.outputs.osc] == [
        ("127.0.0.1", 1234, "vmc", True),
        ("10.0.0.7", 9004, "joint", False),
    ]
    assert config.control is None and not config.phase_lock and not config.realtime.enabled
    assert config.sensors.serial[0].baud == 9600


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("sensors:\n  upd: null", 2, ["Unknown key 'upd' in 'sensors'", "Did you mean 'udp'?"]),
        ("outputs:\n  osc:\n    - prot: 9004", 3, ["Unknown key 'prot' in 'outputs.osc[0]'", "'port'?"]),
        ("outputs:\n  osc:\n    - port: 70000", 3, ["'outputs.osc[0].port' is 70000", "Write 1 to 65535."]),
        ("outputs:\n  osc:\n    - port: 0", 3, ["is 0, out of range"]),
        ("outputs:\n  osc:\n    - dialect: vcm", 3, ["not one of ai-toolbox, joint, vmc", "mean 'vmc'?"]),
        ("outputs:\n  osc:\n    - host: touch.local", 3, ["'touch.local' is not an IPv4", "192.168.0.20"]),
        ("outputs:\n  osc:\n    - host: 300.1.1.1", 3, ["is not an IPv4 address"]),
        ("outputs: {osc: [{port: 1},\n {port: 1}]}", 2, ["is listed twice"]),
        ("limits: {tick_budget_ms: 19}", 1, ["Write 0.5 to 18."]),
        ("realtime:\n  priority: 100", 2, ["Write 1 to 99."]),
        ("phase_lock: 1", 1, ["which is not true or false"]),
        ("journal: {minutes: -1}", 1, ["Write 0.1 to 1440."]),
        ("sensors: {keys: [a]}", 1, ["a list of 1, which is not a file name or null"]),
        ("sensors: {foreign: [{name: a, from: fone}]}", 1, ["not one of phone, osc", "mean 'phone'?"]),
        ("sensors: {foreign: [{name: a, from: phone, bone: x}]}", 1, ["`bone` does nothing"]),
        ("sensors: {foreign: [{name: a, from: vmc}]}", 1, ["is one bone", "LeftLowerArm"]),
        ("sensors: {foreign: [{name: a, from: mocopi, bone: l_arm}]}", 1, ["no bone 'l_arm'", "l_up_arm"]),
        ("sensors: {foreign: [{name: a, from: osc}]}", 1, ["An address is needed"]),
        ("sensors:\n foreign:\n - {name: a, from: gyrosc}\n - {name: a, from: phone}", 4, ["called 'a'"]),
        (
            "sensors:\n  foreign:\n  - {name: a, from: gyrosc,\n     host: 0.0.0.0}",
            4,
            ["no sender is listed", "senders: [192.168.0.20]"],
        ),
        (
            "sensors:\n foreign:\n - {name: a, from: mocopi, bone: head, port: 9}\n"
            " - {name: b, from: gyrosc, port: 9}",
            4,
            ["Port 9 is for mocopi (a)", "b from gyrosc would not be heard", "another `port`"],
        ),
        ("control: null\nsensors: {foreign: [{name: a, from: gyrosc}]}", 2, ["Show control hears gyrosc"]),
        ("sensors: {foreign: [{name: a, from: gyrosc, port: 9002}]}", 1, ["hears commands already"]),
        (
            "pair: {role: first, peer: [127.0.0.2], secret: k}\n"
            "sensors: {foreign: [{name: a, from: gyrosc}]}",
            2,
            ["Port 9760 hears the other box already", "Give a another one"],
        ),
        (
            "locked: {leader: 127.0.0.2, secret: k}\n"
            "sensors: {foreign: [{name: a, from: gyrosc, port: 9761}]}",
            2,
            ["Port 9761 hears boxes in step already"],
        ),
        ("console: null\nsensors: {foreign: [{name: a, from: phone}]}", 2, ["serves no page"]),
        ("sensors: {serial: [{baud: 9600}]}", 1, ["'sensors.serial[0].device' is missing"]),
    ],
)
def test_a_fault_is_named_with_its_line(tmp_path: Path, text: str, line: int, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        box(tmp_path, text + "\n")
    assert (caught.value.file, caught.value.line) == (tmp_path / "box.yaml", line)
    for word in words:
        assert word in str(caught.value)


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        load_box(tmp_path / "box.yaml")


def box_file(folder: Path, text: str) -> Path:
    (folder / "box.yaml").write_text(text)
    return folder / "box.yaml"


@pytest.mark.parametrize("text", ["", "sound: null\n", "outputs: {dmx: []}\n", "outputs: {}\n"])
def test_who_is_not_asked_for_is_told_so(tmp_path: Path, text: str) -> None:
    box = box_file(tmp_path, text)
    assert load_box(box).sound is None and not load_box(box).outputs.dmx
    with pytest.raises(NotAskedForError, match=r"box.yaml: .*no sound.*sound: \{\}"):
        require_sound(box)
    with pytest.raises(NotAskedForError, match=r"box.yaml: No wire .*dmx"):
        require_wires(box)


@pytest.mark.parametrize(
    ("text", "asks_for_sound", "has_wires", "is_sound"),
    [
        ("sound: {}\noutputs: {dmx: [{universe: 1, wire: artnet}]}\n", True, True, True),
        ("sound: {}\n", True, False, True),
        ("outputs: {dmx: [{universe: 1, wire: artnet}]}\n", False, True, True),
        ("sound: loud\noutputs: everywhere\n", True, True, False),
        ("sound: []\noutputs: {dmx: null}\n", True, True, False),
        ("sound: loud\n", True, False, False),
    ],
)
def test_only_what_is_surely_not_asked_for_is_refused_and_all_else_by_the_whole_look(
    tmp_path: Path, text: str, asks_for_sound: bool, has_wires: bool, is_sound: bool
) -> None:
    box = box_file(tmp_path, text)
    for look, asked in ((require_sound, asks_for_sound), (require_wires, has_wires)):
        with contextlib.nullcontext() if asked else pytest.raises(NotAskedForError):
            look(box)
    with contextlib.nullcontext() if is_sound else pytest.raises(ConfigError, match=r"box.yaml:1: "):
        load_box(box)


def test_without_a_box_file_the_defaults_count() -> None:
    require_sound(None)
    require_wires(None)


def test_what_is_no_yaml_is_refused_with_its_line(tmp_path: Path) -> None:
    box = box_file(tmp_path, "sound: {}\n\t- no\n")
    for look in (require_sound, require_wires):
        with pytest.raises(ConfigError, match=r"box.yaml:2: "):
            look(box)


@pytest.mark.parametrize("command", ["sound", "lights"])
def test_neither_numbers_nor_the_box_are_loaded(tmp_path: Path, command: str) -> None:
    """At each power-on of a box without sound and lights, beside the first frame."""
    box = box_file(tmp_path, "state: here\n")
    text = (
        "import sys\nfrom appliance.start import main\ntry:\n    main(sys.argv[1:])\nfinally:\n"
        "    print(*sys.modules)\n"
    )
    line = (sys.executable, "-c", text, command, "--box", str(box))
    ran = subprocess.run(line, capture_output=True, text=True, check=False)
    assert ran.returncode == NotAskedForError.exit_status, ran.stderr
    assert not {"numpy", "appliance.show.box", f"appliance.{command}.run"} & set(ran.stdout.split())


def test_a_box_file_is_read_without_numbers_and_without_shows() -> None:
    """So read by each process of a box, also by those that calculate nothing."""
    text = "import sys, appliance.show.box; print(*sys.modules)"
    ran = subprocess.run((sys.executable, "-c", text), capture_output=True, text=True, check=True)
    needless = {
        "numpy",
        *(f"appliance.show.{name}" for name in ("show", "cues", "dance", "lights", "puppets")),
    }
    assert not needless & set(ran.stdout.split())
