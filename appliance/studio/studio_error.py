"""An error of the studio, for the person at the keyboard."""

from __future__ import annotations


class StudioError(ValueError):
    """What happened and what to do; the command prints it as one message and ends with status 2."""
