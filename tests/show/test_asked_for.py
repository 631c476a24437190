"""What a box file does not ask for ends at once, and loads next to nothing before it does."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.show.asked_for import require_sound, require_wires
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError, NotAskedForError


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
