"""The base of all errors that the user can correct: a command ends with their one sentence."""

from __future__ import annotations


class CorrectableError(Exception):
    """The message says what happened, what the audience sees of it, and what to do."""
