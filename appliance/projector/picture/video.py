"""A looped video as a texture: ffmpeg decodes it in a separate process, which cannot hold up a picture."""

from __future__ import annotations

import logging
import re
import signal
import subprocess
import threading
import time
from typing import IO

import moderngl

from appliance.box.child import end_child, start_child
from appliance.projector.picture.image_file import LINES, MOST_WIDE

_log = logging.getLogger(__name__)

FFMPEG = "ffmpeg"
UNSEEN_S = 2.0  # after which it stops; it begins anew when its look comes back
_Picture = tuple[tuple[int, int], bytes]


class Video:
    """Plays while `texture` is asked for; a file that cannot be played is told, and black."""

    def __init__(self, gl: moderngl.Context, path: str) -> None:
        self._gl, self._path = gl, path
        self._texture = gl.texture((1, 1), 3, bytes(3), alignment=1)
        self._process: subprocess.Popen[bytes] | None = None
        self._newest: _Picture | None = None
        self._seen_at = 0.0
        self._is_unplayable = False

    def texture(self) -> moderngl.Texture:
        """The picture of this moment, its lowest row first. It never waits for one."""
        self._seen_at = time.monotonic()
        if self._process is None and not self._is_unplayable:
            self._begin()
        newest, self._newest = self._newest, None
        if newest is not None:
            size, pixels = newest
            if size != self._texture.size:
                self._texture.release()
                self._texture = self._gl.texture(size, 3, alignment=1)
                self._texture.repeat_x = self._texture.repeat_y = False
                self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._texture.write(pixels, alignment=1)
        return self._texture

    def release(self) -> None:
        """End the process, and give the GPU's memory back."""
        self._stop()
        self._texture.release()

    def _begin(self) -> None:
        """Pictures as PPM, which says their size, in bytes and at the video's own pace."""
        command = [FFMPEG, "-v", "error", "-nostdin", "-stream_loop", "-1", "-re", "-i", self._path, "-an"]
        fits = f"scale=min(iw\\,{MOST_WIDE}):min(ih\\,{LINES}):force_original_aspect_ratio=decrease"
        command += ["-vf", f"{fits},vflip", "-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24", "-"]
        try:
            self._process = start_child(command, stdout=subprocess.PIPE)
        except OSError as error:
            self._is_unplayable = True
            _log.warning(
                f"{self._path} is not played: {FFMPEG} cannot be started ({error.strerror}). The audience "
                "sees the figure before black. Install it: sudo apt install ffmpeg."
            )
            return
        threading.Thread(target=self._read, args=(self._process,), name="video", daemon=True).start()

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        while (picture := _ppm(process.stdout)) is not None:
            self._newest = picture
            if time.monotonic() - self._seen_at > UNSEEN_S:
                self._stop()
        if process is self._process:
            _log.warning(
                f"{self._path} is played no further. The audience sees the figure before its last picture. "
                f"{FFMPEG} says why above: save the video anew."
            )

    def _stop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            end_child(process, 0.0, signal.SIGKILL)


def _ppm(pipe: IO[bytes]) -> _Picture | None:
    """The next picture; None at the end, or where none comes."""
    head = pipe.readline(), pipe.readline(), pipe.readline()
    size = re.fullmatch(rb"(\d{1,5}) (\d{1,5})\n", head[1])
    if size is None or head != (b"P6\n", size[0], b"255\n"):
        return None
    width, height = int(size[1]), int(size[2])
    pixels = pipe.read(3 * width * height)
    return ((width, height), pixels) if len(pixels) == 3 * width * height > 0 else None
