"""An error of the studio, for the person at the keyboard."""

from __future__ import annotations


class StudioError(ValueError):
    """A sentence with the cause and the cure; the command prints it as one message and ends with status 2."""
