"""Plain English: what people read has no sentence that reads like a translation."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools import english

HOW = "Rewrite these sentences (python -m tools.english PATH lists them)."
BAD = {
    "what": [
        "What a desk may set.",
        "What writers left there that were killed before they published goes.",
        "Reads a file. What is none goes.",
    ],
    "of": ["of a hundred", "Of the last second, at most."],
    "alone": ["Without it the page is for this machine alone.", "`--log` prints late ticks alone."],
    "each": ["One short flash each 3 seconds.", "It tries again each 0.5 s.", "Each ten ticks it yields."],
    "stands": ["The key stands in the box file.", "Its files lie under /data.", "Look at what lies there."],
    "own": ["It writes in a thread of its own.", "Those are processes of their own."],
    "want": ["It ends for want of memory."],
    "for": [
        "The disk has a thread, for it may hang.",
        "It dances at once, for some sticks take longer to wake up.",
        "Limits are generous; for a core is never the test's own.",
    ],
    "who": ["Whoever has the key may enter.", "a process who waits", "Who reads it sees a frame."],
    "none": ["Raises ValueError for a number that is none.", "A card that is none."],
    "inversion": ["Kept are: displays of Intel.", "Left out is the rest."],
    "tells": ["`-h` tells the options.", "The journal tells what was danced."],
    "of it": ["What is known of it is kept.", "The newest that was heard of the other box."],
    "whose": ["The dancer in whose latents it goes on.", "None of whose joints is held."],
    "to be": ["The folder has what is to be learned.", "Nothing is to be heard."],
    "long": [" ".join(["The box sends a frame and"] * 9) + " ends."],
}
GOOD = [
    "What is a cue? It calls up a look.",
    "Deletes temporary files left by writers that died before publishing.",
    "Of course it does.",
    "The dancer stands alone on the stage. Leave the file alone.",
    "Each of the three sensors has a key. Each 20 ms step is a tick.",
    "The figure stands on the floor. A stub stands in for the sensor. The dancer lies on the ground.",
    "It falls of its own accord. Bring a show of your own.",
    "A word for people, for example a name; for the others, see below.",
    "One key, for a sensor that has no name.",
    "Somebody who dances may wear it. Who is it? The technician who provisioned it.",
    "There is none. None of them is open.",
    "The box tells the sensor to sleep.",
    "Sensor 3 silent for 0.5 s. The dancer moves freely. Check its battery.",
    "Speed is measured. The new file is read at the next start.",
]


@pytest.mark.parametrize(("tic", "text"), [(tic, text) for tic, texts in BAD.items() for text in texts])
def test_a_tic_is_found(tic: str, text: str) -> None:
    assert tic in [name for name, _ in english.tics_in(text)]


@pytest.mark.parametrize("text", GOOD)
def test_plain_english_passes(text: str) -> None:
    assert english.tics_in(text, "message") == []


def test_each_tic_has_examples() -> None:
    assert BAD.keys() == {*english.PATTERNS, "long"}


def test_a_module_s_docstrings_comments_and_messages_are_read(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text(
        '"""What this is for."""\n'
        "# of the\n# last second\n"
        "KEY = 'stands in'  # of a box\n"
        "def say(name: str) -> str:\n"
        "    return f'The key {name} stands in the file: {name!r}'\n"
    )
    found = english.findings_in(module, tmp_path)
    assert [(one.line, one.kind, one.tic) for one in found] == [
        (1, "docstring", "what"),
        (6, "message", "stands"),
        (2, "comment", "of"),
        (4, "comment", "of"),
    ]


def test_a_page_is_read_without_its_code(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# What it is\n\nA key that stands\nin the file.\n\n```sh\necho whoever reads it\n```\n\n"
        "| `x stands in y` | it lies in the box file |\n|---|---|\n- [Whoever](a.md) reads\n"
    )
    found = english.findings_in(page, tmp_path)
    assert [(one.line, one.tic) for one in found] == [(3, "stands"), (10, "stands"), (12, "who")]


def test_comments_of_the_firmware_and_of_scripts_are_read(tmp_path: Path) -> None:
    header, script = tmp_path / "a.h", tmp_path / "a.sh"
    header.write_text("// What it holds.\nint a;  // of a box\n")
    script.write_text("#!/bin/sh\n# for want of a disk\nls # of a box\n")
    assert [one.tic for one in english.findings_in(header, tmp_path)] == ["what", "of"]
    assert [one.tic for one in english.findings_in(script, tmp_path)] == ["want", "of"]
    shader = tmp_path / "a.glsl"
    shader.write_text("// What it draws.\nin vec2 uv;\n")
    assert [one.tic for one in english.findings_in(shader, tmp_path)] == ["what"]
    page = tmp_path / "a.js"
    page.write_text("const A = 1; // of a frame\nconst b = c * of + d; // a frame's\n")
    assert [one.line for one in english.findings_in(page, tmp_path)] == [1]


def test_the_page_s_words_are_read(tmp_path: Path) -> None:
    words = tmp_path / "en.json"
    words.write_text(
        '{\n "runs": "So. The log tells the rest.",\n "b": { "one": "a \\"bar\\" of its own" }\n}\n'
    )
    assert [(one.line, one.tic) for one in english.findings_in(words, tmp_path)] == [(2, "tells"), (3, "own")]


def test_scripts_without_an_ending_and_the_page_s_words_are_among_the_files() -> None:
    names = {str(path.relative_to(english.ROOT)) for path in english.files()}
    assert {english.WORDS, "deploy/bunraku-release", "deploy/system/usr/sbin/bunraku-access-point"} <= names
    assert "appliance/console/page/words/de.json" not in names


def test_no_sentence_reads_like_a_translation() -> None:
    found = english.findings()
    assert not found, "\n".join([HOW, *map(str, found)])
