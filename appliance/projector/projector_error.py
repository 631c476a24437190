"""The error that ends the projector: a sentence for the user, an exit status."""

from __future__ import annotations

import os

from appliance.pose.correctable_error import CorrectableError

NO_DISPLAY = os.EX_UNAVAILABLE  # 69: no display or no OpenGL; restarting helps once that is fixed
NO_PLACE = os.EX_CANTCREAT  # 73: for the pictures of --frames
GPU_LOST = os.EX_TEMPFAIL  # 75, also for a display that hangs: restart at once


class ProjectorError(CorrectableError):
    """No picture can be shown: what happened, what the audience sees, what to do; `status` to exit with."""

    def __init__(self, message: str, status: int) -> None:
        self.status = status
        super().__init__(message)
