"""Every kind of broken BVH file gives one clear error with the line, in bounded memory."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from appliance.pose import quaternion
from appliance.pose.bvh import BvhError, read_bvh
from tests.pose.test_bvh import LEG

LINES = LEG.splitlines()


def number(text: str) -> int:
    """Line of LEG that begins with a text, counted from 1."""
    return next(i for i, line in enumerate(LINES, start=1) if line.strip().startswith(text))


def without(*numbers: int) -> str:
    return "\n".join(line for i, line in enumerate(LINES, start=1) if i not in numbers)


LAST = len(LINES)
BROKEN = {
    "empty": ("", 1, "the file ends here, the word HIERARCHY should follow"),
    "another format": ("<html><body>404</body></html>", 1, "not a BVH file"),
    "a program": (bytes(range(256)) * 300, None, "not a BVH file"),
    "no hierarchy": (LEG.replace("HIERARCHY\n", ""), 1, "not a BVH file"),
    "only the hierarchy": ("\n".join(LINES[:16]), 17, "the file ends here, 'Frames:' should follow"),
    "cut in the hierarchy": ("\n".join(LINES[:8]), 9, "the file ends here, the rest of the hierarchy"),
    "cut after a joint's name": ("\n".join(LINES[:6]), 7, "the file ends here, an opening brace"),
    "no frame time": (without(number("Frame Time")), number("Frame Time"), "'Frame Time:' is missing"),
    "no frame count": (without(number("Frames")), number("Frames"), "'Frames:' is missing here"),
    "an opening brace is missing": (without(7), 7, "an opening brace '{' is missing here"),
    "a closing brace is missing": (without(15), 15, "a closing brace is missing"),
    "a closing brace is missing inside": (without(13), 15, "a closing brace is missing"),
    "a closing brace too many": (LEG.replace("MOTION", "}\nMOTION"), 16, "'}' is not expected here"),
    "two closing braces on a line": (LEG.replace("\n    }", "\n    } }"), 13, "'}' is not expected here"),
    "a joint outside the root": (LEG.replace("MOTION", "JOINT tail"), 16, "a JOINT stands outside the ROOT"),
    "a second root": (LEG.replace("JOINT knee", "ROOT knee"), 6, "exactly one ROOT"),
    "a joint before the root": (LEG.replace("ROOT hip", "JOINT hip"), 2, "exactly one ROOT"),
    "a joint without a name": (LEG.replace("JOINT knee", "JOINT"), 6, "a JOINT without a name"),
    "a brace for a name": (LEG.replace("JOINT knee\n  {", "JOINT {"), 6, "a JOINT without a name"),
    "a joint twice": (LEG.replace("JOINT knee", "JOINT hip"), 6, "the joint name 'hip' is used twice"),
    "a joint twice, brace beside": (LEG.replace("JOINT knee\n  {", "JOINT hip {"), 6, "'hip' is used twice"),
    "a joint in an end": (LEG.replace("      OFFSET 0 -42 1", "JOINT toe"), 12, "inside an End Site"),
    "channels in an end": (LEG.replace("OFFSET 0 -42 1", "CHANNELS 0"), 12, "a second CHANNELS"),
    "an end outside": (LEG.replace("MOTION", "End Site"), 16, "'End' is not expected here"),
    "an offset outside": (LEG.replace("MOTION", "OFFSET 0 0 0"), 16, "a second OFFSET"),
    "an offset before the root": (
        LEG.replace("ROOT hip", "OFFSET 0 0 0"),
        2,
        "'OFFSET' is not expected here",
    ),
    "a short offset": (
        LEG.replace("OFFSET 0 -40 0", "OFFSET 0 -40"),
        8,
        "OFFSET needs 3 numbers, here are 2",
    ),
    "a long offset": (
        LEG.replace("OFFSET 0 -40 0", "OFFSET 0 -40 0 1"),
        8,
        "OFFSET needs 3 numbers, here are 4",
    ),
    "an offset of words": (LEG.replace("-40", "forty"), 8, "OFFSET: 'forty' is not a number"),
    "an offset that is NaN": (LEG.replace("-40", "nan"), 8, "a value is not finite"),
    "an offset twice": (LEG.replace("OFFSET 0 -40 0", "OFFSET 0 1 0\nOFFSET 0 2 0"), 9, "a second OFFSET"),
    "channels twice": (LEG.replace("    End", "    CHANNELS 0\n    End"), 10, "a second CHANNELS"),
    "fewer channels than said": (
        LEG.replace("CHANNELS 3", "CHANNELS 4"),
        9,
        "CHANNELS says 4, 3 names follow",
    ),
    "more channels than said": (
        LEG.replace("CHANNELS 3", "CHANNELS 2"),
        9,
        "CHANNELS says 2, 3 names follow",
    ),
    "channels without a count": (LEG.replace("CHANNELS 3 Z", "CHANNELS Z"), 9, "CHANNELS says Zrotation"),
    "channels without anything": (
        LEG.replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS"),
        9,
        "nothing",
    ),
    "a superscript count": (LEG.replace("CHANNELS 3", "CHANNELS ³"), 9, "CHANNELS says ³"),
    "a channel of another kind": (
        LEG.replace("3 Zrotation", "3 Wrotation"),
        9,
        "unknown channel 'Wrotation'",
    ),
    "a channel named twice": (LEG.replace("3 Zrotation", "3 Xrotation"), 9, "a channel is named twice"),
    "a word in the hierarchy": (LEG.replace("End Site", "Bend Site"), 10, "'Bend' is not expected here"),
    "no time passes": (LEG.replace("0.02", "0"), 18, "a frame time of '0' s is not plausible"),
    "time goes backwards": (LEG.replace("0.02", "-0.02"), 18, "is not plausible"),
    "hours between frames": (LEG.replace("0.02", "7200"), 18, "is not plausible"),
    "a time that is NaN": (
        LEG.replace("0.02", "nan"),
        18,
        "of 'nan' s is not plausible (0.0001 to 10). Give the rate: --true-fps",
    ),
    "a time of words": (LEG.replace("0.02", "soon"), 18, "of 'soon' s is not plausible"),
    "a rate or milliseconds": (LEG.replace("0.02", "11"), 18, "of '11' s is not plausible"),
    "no row is whole": (
        LEG.replace("0 90 0 ", "0 90 ").replace("10 91", "10 NaN"),
        19,
        "frame 1 has 8 values",
    ),
    "no row at all": (LEG[: LEG.index("0 90 0 ")], 19, "the file has no frames"),
    "nothing can move": (
        LEG[: LEG.index("MOTION")]
        .replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 0")
        .replace("CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation", "CHANNELS 0")
        + "MOTION\nFrames: 1\nFrame Time: 0.02\n\n",
        18,
        "no joint has a channel",
    ),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_one_clear_error_with_the_line(tmp_path: Path, kind: str) -> None:
    content, line, message = BROKEN[kind]
    assert content != LEG
    path = tmp_path / "broken.bvh"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(BvhError) as caught:
        read_bvh(path)
    assert message in str(caught.value)
    assert line is None or caught.value.line == line
    assert str(caught.value).startswith(f"{path}:{caught.value.line}: ")
    assert len(str(caught.value)) < len(str(path)) + 250


def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_bvh(tmp_path / "nowhere.bvh")
    with pytest.raises(IsADirectoryError):
        read_bvh(tmp_path)


@given(st.integers(0, len(LEG) - 2))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_cut_anywhere_it_is_an_error_or_the_whole_rows(tmp_path: Path, length: int) -> None:
    path = tmp_path / "cut.bvh"
    path.write_text(LEG[:length])
    try:
        recording = read_bvh(path)
    except BvhError:
        return
    assert length >= LEG.index("10 91") - 1  # the first row is there, with its line's end or without
    assert len(recording) == 2 if length >= len(LEG) - len("0\n") else bool(recording.notes)


@given(st.integers(0, len(LEG) - 1), st.binary(min_size=1, max_size=8))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
def test_overwritten_anywhere_nothing_but_a_bvh_error_comes(tmp_path: Path, at: int, rubbish: bytes) -> None:
    path = tmp_path / "rubbish.bvh"
    path.write_bytes(LEG.encode()[:at] + rubbish + LEG.encode()[at + len(rubbish) :])
    try:
        recording = read_bvh(path)
    except BvhError:
        return
    assert np.isfinite(recording.poses).all()
    assert np.isfinite(recording.roots).all()


FIVE = (
    LEG.replace("Frames: 2", "Frames: 5")
    + "20 92 10 20 40 60 80 90 70\n30 93 15 30 60 60 80 90 70\n40 94 20 0 0 0 0 0 0\n"
)
FIRST_ROW = number("0 90 0 ")
LOST = {  # text, number of poses, what is said
    "a row too few": (FIVE.replace("Frames: 5", "Frames: 6"), 5, ["announces '6'", "5 rows are there"]),
    "a row too many": (FIVE.replace("Frames: 5", "Frames: 4"), 5, ["announces '4'", "5 rows are there"]),
    "a count that was never written": (FIVE.replace("Frames: 5", "Frames: 0"), 5, ["announces '0'"]),
    "a count of words": (FIVE.replace("Frames: 5", "Frames: many"), 5, ["announces 'many'"]),
    "no count": (FIVE.replace("Frames: 5", "Frames:"), 5, ["announces nothing"]),
    "a count beyond memory": (FIVE.replace("Frames: 5", "Frames: 999999999999"), 5, ["5 rows are there"]),
    "cut within the last row": (FIVE[:-10], 4, [f"line {FIRST_ROW + 4}: 1 row lost (frame 5 has 4 values"]),
    "a value too many within": (FIVE.replace("10 91", "1 10 91"), 5, [f"line {FIRST_ROW + 1}: 1 row lost"]),
    "words within": (
        FIVE.replace("20 92", "20 ninety"),
        5,
        ["'ninety' is not a number", "turns evenly over it"],
    ),
    "NaN within": (FIVE.replace("20 92", "20 nan"), 5, ["not finite", f"line {FIRST_ROW + 2}: "]),
    "infinite at the start": (FIVE.replace("0 90 0", "0 -inf 0"), 4, ["1 row lost", "left out"]),
    "overflowing at the end": (FIVE.replace("40 94", "40 1e999"), 4, ["1 row lost", "left out"]),
    "two rows within": (
        FIVE.replace("20 92", "20").replace("10 91", "x 91"),
        5,
        [f"lines {FIRST_ROW + 1} to {FIRST_ROW + 2}: 2 rows lost", "turns evenly over them"],
    ),
    "a word behind the rows": (FIVE + "\n\nthe end\n", 5, [f"line {FIRST_ROW + 7}: 1 row lost", "left out"]),
    "zeros to the end of the disk": (
        FIVE + "\0" * 200_000,
        5,
        ["a line of more than", "what follows is left out"],
    ),
    "line ends for ever": (FIVE + "\n" * 5000, 5, ["blank lines in a row", "what follows is left out"]),
    "prose for ever": (FIVE + "so it goes\n" * 5000, 5, ["more than 1000 rows behind each other"]),
    "another recording behind it": (
        FIVE + FIVE,
        5,
        [f"line {FIRST_ROW + 5}: a second recording begins here"],
    ),
}


@pytest.mark.parametrize("kind", LOST)
def test_whole_rows_are_kept_and_the_others_are_named(tmp_path: Path, kind: str) -> None:
    text, poses, message = LOST[kind]
    path = tmp_path / "lost.bvh"
    path.write_text(text)
    recording = read_bvh(path)
    assert len(recording) == poses
    for each in message:
        assert each in "; ".join(recording.notes)


def test_over_a_lost_row_the_figure_turns_evenly_and_the_time_stays(tmp_path: Path) -> None:
    path = tmp_path / "lost.bvh"
    path.write_text(FIVE)
    whole = read_bvh(path)
    path.write_text(FIVE.replace("20 92", "20 nan"))
    found = read_bvh(path)
    np.testing.assert_allclose(found.roots[[0, 1, 3, 4]], whole.roots[[0, 1, 3, 4]])
    np.testing.assert_allclose(found.roots[2], (whole.roots[1] + whole.roots[3]) / 2)
    apart = quaternion.angle_between(found.poses[[1, 2]], found.poses[[2, 3]])
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-6)


MEASURED_READ = """
import resource, sys
from appliance.pose import quaternion
from appliance.pose.bvh import BvhError, read_bvh
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    read_bvh(sys.argv[1])
except BvhError as error:
    print(error.line, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""

FRAMES_THAT_NEVER_COME = LEG[: LEG.index("Frames")] + "Frames: 5000000\nFrame Time: 0.02\n"
NONSENSE = {
    "zeros from the start": b"",
    "zeros after a good hierarchy": LEG[: LEG.index("Frames")].encode(),
    "zeros where millions of frames are announced": FRAMES_THAT_NEVER_COME.encode(),
    "a comment without end": b"HIERARCHY\n" + b"x" * 1000,
}


@pytest.mark.parametrize("kind", NONSENSE)
def test_two_gigabytes_of_nonsense_fail_in_bounded_memory(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "huge.bvh"
    path.write_bytes(NONSENSE[kind])
    os.truncate(path, 2 << 30)  # a sparse file: two gigabytes that take no room on the disk
    line, grown_mb = measured(path)
    assert line == NONSENSE[kind].count(b"\n") + 1
    assert grown_mb < 30


REPEATED = {
    "line ends": ("", "\n"),
    "line ends where frames should be": (FRAMES_THAT_NEVER_COME, "\n"),
    "joints in joints": ("HIERARCHY\nROOT a\n{\n", None),
    "ends": ("HIERARCHY\nROOT a\n{\n", "End Site\n{\nOFFSET 0 0 0\n}\n"),
    "offsets": ("HIERARCHY\nROOT a\n{\n", "OFFSET 0 0 0\n"),
}


@pytest.mark.parametrize("kind", REPEATED)
def test_endless_repetition_is_stopped(tmp_path: Path, kind: str) -> None:
    head, part = REPEATED[kind]
    path = tmp_path / "endless.bvh"
    with path.open("w") as file:
        file.write(head)
        if part is None:
            file.writelines(f"JOINT a{i}\n{{\n" for i in range(200_000))
        else:
            file.write(part * 200_000)
    line, grown_mb = measured(path)
    assert line < 10_000
    assert grown_mb < 30


def measured(path: Path) -> tuple[int, int]:
    """Line of the error and megabytes that a process of its own grew by while reading."""
    command = [sys.executable, "-c", MEASURED_READ, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    line, grown_mb = done.stdout.split()
    return int(line), int(grown_mb)
