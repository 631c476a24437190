"""What the studio cannot do, said to the person at the keyboard."""

from __future__ import annotations


class StudioError(ValueError):
    """What happened and what to do; the command shows it as one message and ends with status 2."""
