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
    "utf-16": (LEG.encode("utf-16"), 1, "not a BVH file"),
    "a program": (bytes(range(256)) * 300, None, "not a BVH file"),
    "no hierarchy": (LEG.replace("HIERARCHY\n", ""), 1, "not a BVH file"),
    "only the hierarchy": ("\n".join(LINES[:16]), 17, "the file ends here, 'Frames:' should follow"),
    "cut in the hierarchy": ("\n".join(LINES[:8]), 9, "the file ends here, the rest of the hierarchy"),
    "cut after a joint's name": ("\n".join(LINES[:6]), 7, "the file ends here, an opening brace"),
    "cut in the frames": ("\n".join(LINES[:-1]), LAST, "the file ends here, frame 2 of 2 should follow"),
    "cut inside a frame": (LEG[:-9], LAST, "frame 2 has 6 values, the channels need 9"),
    "no frame time": (without(number("Frame Time")), number("Frame Time"), "'Frame Time: S' should stand"),
    "no frame count": (without(number("Frames")), number("Frames"), "'Frames: N' should stand here"),
    "an opening brace is missing": (without(7), 7, "an opening brace '{' should stand here"),
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
    "no frames": (LEG.replace("Frames: 2", "Frames: 0"), 17, "the file has no frames"),
    "a negative count": (LEG.replace("Frames: 2", "Frames: -2"), 17, "'Frames: N' should stand here"),
    "a count of words": (LEG.replace("Frames: 2", "Frames: two"), 17, "'Frames: N' should stand here"),
    "a count in superscript": (LEG.replace("Frames: 2", "Frames: ²"), 17, "'Frames: N' should stand here"),
    "a count beyond reason": (LEG.replace("Frames: 2", f"Frames: {'9' * 5000}"), 17, "'Frames: N' should"),
    "a count beyond memory": (LEG.replace("Frames: 2", "Frames: 999999999999"), 18, "too many to read"),
    "fewer frames than said": (LEG.replace("Frames: 2", "Frames: 3"), LAST + 1, "frame 3 of 3 should follow"),
    "more frames than said": (
        LEG.replace("Frames: 2", "Frames: 1"),
        LAST,
        "more lines follow than the 1 frames",
    ),
    "something after the frames": (LEG + "\n\nthe end\n", LAST + 3, "more lines follow than the 2 frames"),
    "no time passes": (LEG.replace("0.02", "0"), 18, "a frame time of 0.0 s is not plausible"),
    "time goes backwards": (LEG.replace("0.02", "-0.02"), 18, "is not plausible"),
    "hours between frames": (LEG.replace("0.02", "7200"), 18, "is not plausible"),
    "a time that is NaN": (LEG.replace("0.02", "nan"), 18, "a value is not finite"),
    "a time of words": (LEG.replace("0.02", "soon"), 18, "Frame Time: 'soon' is not a number"),
    "a value too few": (LEG.replace("0 90 0 ", "0 90 "), 19, "frame 1 has 8 values, the channels need 9"),
    "a value too many": (
        LEG.replace("0 90 0 ", "0 90 0 0 "),
        19,
        "frame 1 has 10 values, the channels need 9",
    ),
    "a value of words": (LEG.replace("10 91", "10 ninety"), 20, "frame 2: 'ninety' is not a number"),
    "a decimal comma": (LEG.replace("10 91", "10 91,5"), 20, "frame 2: '91,5' is not a number"),
    "NaN": (LEG.replace("10 91", "10 NaN"), 20, "frame 2: a value is not finite"),
    "infinite": (LEG.replace("10 91", "10 -inf"), 20, "frame 2: a value is not finite"),
    "overflowing": (LEG.replace("10 91", "10 1e999"), 20, "frame 2: a value is not finite"),
    "binary in a frame": (LEG.encode().replace(b"10 91", b"10 \xff\x00\x80"), 20, "is not a number"),
    "zeros to the end of the disk": (LEG.encode() + bytes(200_000), 21, "a line of more than"),
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
def test_cut_anywhere_it_is_an_error_or_the_same_recording(tmp_path: Path, length: int) -> None:
    path = tmp_path / "cut.bvh"
    path.write_text(LEG[:length])
    try:
        recording = read_bvh(path)
    except BvhError:
        return
    assert length >= len(LEG) - len("0\n")  # the last number may lose a digit and stay a number
    assert len(recording) == 2


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


MEASURED_READ = """
import resource, sys
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
    "zeros after the last frame": LEG.encode(),
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
    "line ends after the last frame": (LEG, "\n"),
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
