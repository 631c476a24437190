"""The projector's end of the stream: gives pictures to the process that serves them, when that asks."""

from __future__ import annotations

import logging
import math
import os
import subprocess
import sys
from collections.abc import Callable

from appliance.box.child import await_end, start_child
from appliance.projector.raw_stream import RawStream
from appliance.projector.stream.pipe import WANTED, head
from appliance.projector.window import Size
from appliance.show.stream import StreamConfig

_log = logging.getLogger(__name__)

AGAIN_S = 5.0  # before a process that ended is started once more
HUNG_S = 5.0  # without a sign, of which it gives one a second
_STARTS_WITHIN_S = 20.0
_LAST_OUTPUT_S = 1.0


class Feed:
    """Runs the stream's process. It costs a picture nothing while nobody looks, and never waits."""

    def __init__(self, config: StreamConfig) -> None:
        self._config = config
        self._process: subprocess.Popen[bytes] | None = None
        self._pictures: RawStream | None = None
        self._begun_at, self._hangs_at = -math.inf, 0.0
        self._is_said = False

    def offer(self, now: float, size: Size, read: Callable[[], bytes]) -> None:
        """Give the picture of this moment where one is wanted. read: its bytes as OpenGL gives them."""
        if self._pictures is None or self._pictures.is_closed or self._is_over():
            if now - self._begun_at >= AGAIN_S:
                self._begin(now)
            return
        asked = self._asked()
        if asked:
            self._hangs_at = now + HUNG_S
        elif now >= self._hangs_at and self._process is not None:
            self._process.kill()
        if WANTED in asked:
            self._pictures.offer(read(), size)

    def close(self) -> None:
        """End the process."""
        if self._process is None:
            return
        self._process.terminate()  # first: then no picture waits for it
        if self._pictures is not None:
            self._pictures.close()
        await_end(self._process, _LAST_OUTPUT_S)
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._process = self._pictures = None

    def _begin(self, now: float) -> None:
        if self._process is not None and not self._is_said:
            self._is_said = True
            _log.warning(
                f"The stream on port {self._config.port} has ended, or hung. The audience sees the picture; "
                f"media servers and mixers do not. It is started again every {AGAIN_S:g} s: is the port "
                "another program's?"
            )
        self.close()
        self._begun_at, self._hangs_at = now, now + _STARTS_WITHIN_S
        pictures, into = os.pipe()
        command = [sys.executable, "-m", "appliance.projector.stream", self._config.model_dump_json()]
        try:
            self._process = start_child(command, stdin=pictures, stdout=subprocess.PIPE)
        except OSError as error:
            os.close(into)
            if not self._is_said:
                self._is_said = True
                _log.warning(
                    f"The stream's process cannot be started ({error.strerror}). The audience sees the "
                    "picture; media servers and mixers do not. It is tried again every "
                    f"{AGAIN_S:g} s: is the machine out of memory?"
                )
            return
        finally:
            os.close(pictures)
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._pictures = RawStream(into, head)

    def _is_over(self) -> bool:
        return self._process is None or self._process.poll() is not None

    def _asked(self) -> bytes:
        """Its messages since the last picture: it is alive, and it wants one or not."""
        assert self._process is not None and self._process.stdout is not None
        try:
            return os.read(self._process.stdout.fileno(), 64)
        except BlockingIOError:
            return b""
