"""The one error with which the projector ends by itself: a sentence for people, an exit status."""

from __future__ import annotations

import os

NO_DISPLAY = os.EX_UNAVAILABLE  # 69: no display or no OpenGL; starting again helps once that is mended
NO_PLACE = os.EX_CANTCREAT  # 73: for the pictures that were asked for as files
GPU_LOST = os.EX_TEMPFAIL  # 75, also for a display that hangs: starting again at once is the cure


class ProjectorError(Exception):
    """No picture can be shown: what happened, what the audience sees, what to do; `status` to exit with."""

    def __init__(self, message: str, status: int) -> None:
        self.status = status
        super().__init__(message)
