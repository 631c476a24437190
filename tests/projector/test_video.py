"""A looped video behind the figure, by a double of ffmpeg that writes the pictures that it is asked for."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from appliance.pose.recording import Recording
from appliance.projector.picture import video
from appliance.projector.picture.renderer import Renderer
from appliance.projector.picture.video import Video
from appliance.projector.still import draw_still, moment_of
from appliance.show.look import LookConfig, looks_by_name
from tests.logged import said
from tests.projector.golden_looks import AT_S, SIZE, renderer

WITHIN_S = 60.0
WRAPPER = """#!/bin/sh
exec "{python}" "$0.py" "$@"
"""  # a first line with an interpreter may have no space in its path
DOUBLE = """import pathlib, sys, time
arguments = " ".join(sys.argv[1:])
pathlib.Path(__file__).with_name("asked").write_text(arguments)
assert "-stream_loop -1 -re -i" in arguments and "vflip -f image2pipe -c:v ppm -" in arguments
most = b"255" if "-pix_fmt rgb24" in arguments else b"65535"  # a ten-bit video is asked for in 16 bits
for number in range({pictures}):
    sys.stdout.buffer.write(b"P6\\n3 2\\n" + most + b"\\n" + bytes([10 * number, 0, 200] * 6))
    sys.stdout.buffer.flush()
    time.sleep(0.05)
"""


@pytest.fixture
def ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], Path]:
    """Puts a double in the place of ffmpeg; returns where it notes what it was asked for."""

    def made(pictures: int) -> Path:
        program = tmp_path / "ffmpeg"
        program.write_text(WRAPPER.format(python=sys.executable))
        program.with_name("ffmpeg.py").write_text(DOUBLE.format(pictures=pictures))
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
        return tmp_path / "asked"

    return made


def until(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + WITHIN_S
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def red(texture: moderngl.Texture) -> int:
    framebuffer = texture.ctx.framebuffer([texture])
    pixels = framebuffer.read(components=4)
    framebuffer.release()
    return pixels[0]


@pytest.fixture
def played(gl: moderngl.Context) -> Iterator[Video]:
    played = Video(gl, "waves.mp4")
    yield played
    played.release()


def test_each_picture_is_shown_in_its_size(played: Video, ffmpeg: Callable[[int], Path]) -> None:
    asked = ffmpeg(20)
    first = played.texture()
    assert first.size == (1, 1) and red(first) == 0, "black until the first picture"
    until(lambda: red(played.texture()) > 0)
    assert played.texture().size == (3, 2)
    before = red(played.texture())
    until(lambda: red(played.texture()) > before)
    assert "-i waves.mp4" in asked.read_text()


def test_it_stops_where_nobody_sees_it_and_begins_anew(
    played: Video, ffmpeg: Callable[[int], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "UNSEEN_S", 0.05)
    ffmpeg(10_000)
    until(lambda: red(played.texture()) >= 30)
    process = played._process
    assert process is not None
    until(lambda: process.poll() is not None)
    until(lambda: played.texture().size == (3, 2) and 0 < red(played.texture()) < 30)


def test_a_video_that_ends_is_told_and_its_last_picture_stays(
    played: Video, ffmpeg: Callable[[int], Path]
) -> None:
    ffmpeg(3)
    until(lambda: red(played.texture()) == 20)
    until(lambda: "is played no further" in "".join(said))
    assert red(played.texture()) == 20


def test_without_ffmpeg_it_is_told_once(played: Video, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "FFMPEG", "no-such-program")
    for _ in range(3):
        assert played.texture().size == (1, 1)
    assert "".join(said).count("is not played") == 1


def test_a_look_shows_its_video_behind_the_figure(
    ffmpeg: Callable[[int], Path], gl: moderngl.Context, dance: Recording
) -> None:
    ffmpeg(10_000)
    shown = LookConfig(name="sea", style="plaster", video="waves.mp4")
    looks = looks_by_name([shown, LookConfig(name="dark", style="plaster")], Path("show"))
    assert looks["sea"].video == "show/waves.mp4"

    def blue(made: Renderer, look: str) -> float:
        picture = draw_still(gl, made, moment_of(dance, AT_S), look, SIZE)
        return float(np.median(picture[..., 2]))

    with renderer(gl, dance.skeleton, looks) as made:
        until(lambda: blue(made, "sea") > 100)
        assert blue(made, "dark") < 30
