"""A finding of the doctor: a verdict, its effect for the audience, and what to do."""

from __future__ import annotations

import re
from typing import Literal, NamedTuple

Verdict = Literal["ok", "better", "wrong"]
_PATH = re.compile(r"(?<![\w/])/(?:[\w.+-]+/)+(?P<name>[\w+-][\w.+-]*)")
ORDER: tuple[Verdict, ...] = ("wrong", "better", "ok")


class Finding(NamedTuple):
    """ok: leave it. better: the show runs, but this may cost something one day. wrong: mend it first."""

    what: str
    verdict: Verdict
    message: str
    cure: str = ""


def for_phone(text: str) -> str:
    """Without the folders of files, which nobody opens on a phone; commands in backquotes stay."""
    parts = text.split("`")
    parts[::2] = [_PATH.sub(r"\g<name>", part) for part in parts[::2]]
    return "`".join(parts)


def ok(what: str, message: str) -> Finding:
    return Finding(what, "ok", message)


def better(what: str, message: str, cure: str) -> Finding:
    """The show runs; this could be better."""
    return Finding(what, "better", message, cure)


def wrong(what: str, message: str, cure: str) -> Finding:
    """Not before the doors open."""
    return Finding(what, "wrong", message, cure)
