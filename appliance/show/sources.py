"""Names of what the puppet can start from, beside those that a show gives its phrases."""

from __future__ import annotations

MAIN = "main"  # the phrase that the show starts with
LIVE = "live"  # a live dancer's motion capture, in place of a phrase
