"""Faults of a journal, in words for people."""

from __future__ import annotations

from appliance.pose.correctable_error import CorrectableError


class JournalError(CorrectableError):
    """A journal that cannot be written, read or danced again; the message says why and what to do."""
