"""What the doctor found: a verdict, what it means for the audience, and what to do."""

from __future__ import annotations

from typing import Literal, NamedTuple

Verdict = Literal["ok", "better", "wrong"]
ORDER: tuple[Verdict, ...] = ("wrong", "better", "ok")


class Finding(NamedTuple):
    """ok: leave it. better: the show runs, but this may cost something one day. wrong: mend it first."""

    what: str
    verdict: Verdict
    words: str
    cure: str = ""


def ok(what: str, words: str) -> Finding:
    """All is well."""
    return Finding(what, "ok", words)


def better(what: str, words: str, cure: str) -> Finding:
    """The show runs; this could be better."""
    return Finding(what, "better", words, cure)


def wrong(what: str, words: str, cure: str) -> Finding:
    """Not before the doors open."""
    return Finding(what, "wrong", words, cure)
