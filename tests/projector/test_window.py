"""Displays: missing, unknown, without OpenGL, lost; and the same picture with and without one."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from appliance.box.wall_file import WALL
from appliance.projector import context as context_module
from appliance.projector.context import GlContext, offscreen
from appliance.projector.fallback import STAGE_UNSEEN
from appliance.projector.keyboards import Key
from appliance.projector.loop import Projector
from appliance.projector.png import write_png
from appliance.projector.projector_error import GPU_LOST, NO_DISPLAY, ProjectorError
from appliance.projector.resolution import Resolution
from appliance.projector.run import Options, Run
from appliance.projector.sdl import sdl2
from appliance.projector.window import Window
from appliance.show.box import BoxConfig
from appliance.show.projector import ProjectorConfig
from tests.bundles import write_show
from tests.logged import said
from tests.projector.stage_double import StageDouble
from tests.virtual_display import virtual_display

PICTURE = """
import os, sys
from pathlib import Path
from appliance.projector.alignment import Alignment
from appliance.projector.context import GlContext
from appliance.projector.controls import Controls
from appliance.projector.final_pass import FinalPass
from appliance.projector.window import Window
from appliance.show.projector import ProjectorConfig

config = ProjectorConfig(gamma=1.3)
window = Window(config, sys.argv[1], (320, 180))
context = GlContext(window)
final = FinalPass(context.gl, config)
final.resize((8, 8))
final.picture.color_attachments[0].write(bytes(range(256)))
pinned = Alignment(((0.1, 0.05), (0.93, 0.12), (0.85, 0.97), (0.02, 0.8)), True, 0.9)
controls = Controls(pinned, lambda alignment: None)
controls.set_grid(True)
assert window.size == (320, 180), window.size
final.draw(context.gl.screen, window.size, controls, 0.7, ("60.0 pictures/s", window.kind[:0]))
sys.stdout.buffer.write(context.gl.screen.read(viewport=(0, 0, 320, 180), components=4))
window.show()
final.release()
context.close()
window.close()
"""


def picture(kind: str, **environment: str) -> np.ndarray:
    without = {"DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"}
    clean = {name: value for name, value in os.environ.items() if name not in without}
    done = subprocess.run(
        [sys.executable, "-c", PICTURE, kind], capture_output=True, check=True, env={**clean, **environment}
    )
    return np.frombuffer(done.stdout, np.uint8).reshape(180, 320, 4)[..., :3].astype(int)


def test_a_window_on_a_desktop_shows_what_is_drawn_offscreen() -> None:
    with virtual_display() as display:
        shown = picture("window", DISPLAY=display)
    drawn = picture("offscreen")
    assert drawn.any()
    assert np.abs(shown - drawn).max() <= 1


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    if Path("/dev/dri").exists():
        pytest.skip("this machine has a display of its own")


def test_no_display_at_all(no_display: None) -> None:
    with pytest.raises(
        ProjectorError, match=r"There is no display .*kmsdrm.*Plug the projector in"
    ) as caught:
        Window(ProjectorConfig(), "fullscreen")
    assert caught.value.status == NO_DISPLAY


def test_a_desktop_that_does_not_answer(no_display: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":987")
    with pytest.raises(ProjectorError, match=r"x11: .*kmsdrm: "):
        Window(ProjectorConfig(), "window")


def test_a_missing_display_is_refused_with_a_list_of_those_present(monkeypatch: pytest.MonkeyPatch) -> None:
    with virtual_display() as display:
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        for wanted in (3, "HDMI-7"):
            with pytest.raises(ProjectorError, match=r"these are there: 0 \(.*under `display`"):
                Window(ProjectorConfig(display=wanted), "window")
        Window(ProjectorConfig(display="s"), "window").close()  # a part of its name will do


def test_no_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    window = Window(ProjectorConfig(), "offscreen", (64, 64))
    try:
        with monkeypatch.context() as patched:
            patched.setattr(sdl2, "SDL_GL_CreateContext", lambda _: None)
            with pytest.raises(
                ProjectorError, match=r"no OpenGL ES 3.0 .*Install the graphics card's driver"
            ):
                GlContext(window)
        with monkeypatch.context() as patched:
            patched.setattr(context_module, "ES_3_0", 990)
            with pytest.raises(ProjectorError, match=r"no OpenGL ES 3.0"):
                GlContext(window)
        GlContext(window).close()
    finally:
        window.close()


def test_a_context_of_this_machine() -> None:
    window = Window(ProjectorConfig(), "offscreen", (64, 48))
    context = GlContext(window)
    assert context.gl.version_code >= 300 and not context.is_lost
    assert context.is_software == ("llvmpipe" in context.renderer or "softpipe" in context.renderer)
    assert window.size == (64, 48)
    context.close()
    window.close()


def test_no_picture_waits_behind_another_one_on_kms() -> None:
    window = Window(ProjectorConfig(), "offscreen", (64, 48))
    try:
        assert sdl2.SDL_GetHintBoolean(b"SDL_VIDEO_DOUBLE_BUFFER", 0)
    finally:
        window.close()


def test_a_lost_context_ends_the_projector_with_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures: list[int] = []

    def reset() -> int:
        pictures.append(1)
        return 0x8255 if len(pictures) > 3 else 0  # GL_UNKNOWN_CONTEXT_RESET

    monkeypatch.setattr(context_module, "reset_status", lambda: reset)
    box = BoxConfig(runtime=tmp_path / "run", state=tmp_path / "state")
    run = Run(box, Options("offscreen", (64, 36), seconds=20))
    try:
        with pytest.raises(
            ProjectorError, match=r"was reset.*sees black.*Start the projector again"
        ) as caught:
            run.project(lambda: False)
    finally:
        run.close()
    assert caught.value.status == GPU_LOST
    assert len(pictures) == 4


def test_keys_and_a_closed_window_arrive(tmp_path: Path) -> None:
    box = BoxConfig(runtime=tmp_path / "run", state=tmp_path / "state")
    run = Run(box, Options("offscreen", (64, 36), seconds=20))
    try:
        for symbol, modifier in ((sdl2.SDLK_c, 0), (sdl2.SDLK_LEFT, sdl2.KMOD_LSHIFT), (sdl2.SDLK_q, 0)):
            event = sdl2.SDL_Event()
            event.type = sdl2.SDL_KEYDOWN
            event.key.keysym.sym, event.key.keysym.mod = symbol, modifier
            sdl2.SDL_PushEvent(event)
        run.project(lambda: False)
    finally:
        run.close()
    assert "Corner mode" in said[0] and f"({-10 / 64:.4f}, 0.0000)" in said[1] and "pressed q" in said[2]
    assert "-0.15625" in (tmp_path / "state" / "projector.alignment").read_text()


def test_smaller_pictures_are_reported_once_and_stand_in_the_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = BoxConfig(runtime=tmp_path / "run", state=tmp_path / "state")
    shares: list[float] = []
    run = Run(box, Options("offscreen", (64, 36), seconds=20, shows_info=True))
    monkeypatch.setattr(Resolution, "share", property(lambda _: 0.5))
    monkeypatch.setattr(Resolution, "note_picture", lambda *_: True)
    monkeypatch.setattr(Projector, "draw", lambda *arguments: shares.append(arguments[-1]))
    try:
        run.project(lambda: any("64x36 at 50%" in line for line in said))
    finally:
        run.close()
    (sentence,) = (line for line in said if "sees the dance in 32x18" in line)
    assert "Pictures of 64x36 take longer" in sentence and "box file fixes it" in sentence
    assert any("64x36 at 50%" in line for line in said)
    assert set(shares) == {0.5}


def test_the_test_card_has_lines_of_the_box_and_the_picture_of_a_show_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = BoxConfig(runtime=tmp_path / "run", state=tmp_path / "state")
    drawn: list[tuple[str, ...]] = []
    monkeypatch.setattr(
        Projector,
        "draw",
        lambda *arguments: drawn.extend(
            one for one in arguments if isinstance(one, tuple) and one and isinstance(one[0], str)
        ),
    )
    for shows_info in (False, True):
        drawn.clear()
        options = Options(
            "offscreen", (64, 36), seconds=3, shows_info=shows_info, card=lambda: ("pin 123456",)
        )
        run = Run(box, options)
        try:
            run.project(lambda: any("pin 123456" in lines for lines in drawn))
        finally:
            run.close()
        assert any("pin 123456" in lines for lines in drawn) == shows_info


def test_the_page_gets_a_picture_of_the_wall_but_none_with_the_pin(tmp_path: Path) -> None:
    for shows_info in (True, False):
        box = BoxConfig(runtime=tmp_path / "run", state=tmp_path / "state")
        run = Run(box, Options("offscreen", (64, 36), seconds=30, shows_info=shows_info))
        wall, pictures = tmp_path / "run" / WALL, 0

        def is_enough() -> bool:
            nonlocal pictures
            pictures += 1
            return pictures > 30 if shows_info else wall.exists()  # noqa: B023

        try:
            run.project(is_enough)
            assert wall.exists() != shows_info
        finally:
            run.close()
        assert not wall.exists()


def test_a_pause_of_the_whole_machine_is_not_reported_as_a_black_picture(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    run = Run(BoxConfig(runtime=folder, state=tmp_path / "state"), Options("offscreen", (64, 36)))
    now = time.monotonic()

    def is_black_reported() -> bool:
        run.report(now)
        return any(one.name == STAGE_UNSEEN.name and one.active for one in run.fallbacks.happened(now))

    def draw(pictures: int, stage: StageDouble | None = None) -> None:
        nonlocal now
        for _ in range(pictures):
            now += 1 / 60
            if stage is not None:
                stage.write(now)
            run.projector.draw(now, run.context.gl.screen, (64, 36))

    with closing(run), closing(StageDouble(folder, write_show(tmp_path / "show"))) as stage:
        draw(60, stage)
        assert not is_black_reported()
        now += 2.0
        draw(1)
        assert run.reader.state(now) == "stale" and not is_black_reported()
        draw(60)
        assert is_black_reported()
        draw(60, stage)
        assert not is_black_reported()


def test_keys_are_named_as_printed_on_them() -> None:
    window = Window(ProjectorConfig(), "offscreen", (64, 36))
    event = sdl2.SDL_Event()
    event.type = sdl2.SDL_KEYDOWN
    symbols = (sdl2.SDLK_TAB, sdl2.SDLK_ESCAPE, sdl2.SDLK_1, sdl2.SDLK_PLUS, sdl2.SDLK_KP_MINUS, sdl2.SDLK_UP)
    for symbol in symbols:
        event.key.keysym.sym = symbol
        sdl2.SDL_PushEvent(event)
    names = [key.name for key in window.events() if isinstance(key, Key)]
    window.close()
    assert names == ["Tab", "Escape", "1", "+", "Keypad -", "Up"]


def test_pictures_as_png(tmp_path: Path) -> None:
    with offscreen((5, 3)) as gl:
        gl.screen.use()
        gl.clear(1.0, 0.5, 0.0, 1.0)
        gl.clear(0.0, 0.0, 1.0, 1.0, viewport=(0, 0, 5, 1))
        write_png(tmp_path / "one.png", gl.screen.read(components=4), 5, 3)
    image = np.asarray(Image.open(tmp_path / "one.png").convert("RGB"))
    assert image.shape == (3, 5, 3)
    assert image[0, 0].tolist() == [255, 128, 0] and image[2, 4].tolist() == [0, 0, 255]
