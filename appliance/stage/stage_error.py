"""The one error with which the stage refuses to start: a sentence for people, exit status 2."""

from __future__ import annotations

from appliance.pose.correctable_error import CorrectableError


class StageError(CorrectableError):
    """The stage cannot start; the message says what happened, what the audience sees and what to do."""
