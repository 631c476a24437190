"""The tables of docs/osc.md, written from this package: `python -m appliance.levers.reference`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from appliance.levers import addresses
from appliance.levers.addresses import QUESTIONS, Address
from appliance.levers.form import FADE
from appliance.levers.status import FIELDS, STATUS, TAGS

SECTIONS = {
    "### The show": addresses.THE_SHOW,
    "### Playback and joints": addresses.PLAYBACK,
    "### Projector": addresses.PROJECTOR,
    "### Sensors": addresses.SENSORS,
    "### Gestures": addresses.GESTURES,
    "## Motion that is made ahead": addresses.MADE_AHEAD,
}
_COMMANDS = "| address | arguments | what it does |\n|---|---|---|\n"
_QUESTIONS = "| question | answers | arguments |\n|---|---|---|\n"
_STATUS = "| address | type tag | meaning |\n|---|---|---|\n"


def written(page: str) -> str:
    """The page with its tables of commands, questions and the status anew. Raises ValueError where one is
    missing.
    """
    for heading, section in SECTIONS.items():
        page = _replaced(page, page.index(f"\n{heading}\n"), _COMMANDS, map(_row, section))
    page = _replaced(page, 0, _STATUS, _fields())
    return _replaced(page, 0, _QUESTIONS, _answers())


def _replaced(page: str, after: int, head: str, rows: Iterable[str]) -> str:
    begin = page.index(head, after) + len(head)
    end = page.index("\n\n", begin) + 1
    return page[:begin] + "".join(f"{row}\n" for row in rows) + page[end:]


def _row(one: Address) -> str:
    does = one.does[:1].lower() + one.does[1:].removesuffix(".")
    return f"| `{one.address}` |{_spaced(arguments(one))}| {does} |"


def arguments(one: Address) -> str:
    """The arguments of an address, with the fade that is taken where none is given."""
    if one.arguments or one.form.syntax() == "nothing":
        return one.arguments.strip()
    default = f"; {one.fade_s:g}" if one.fade_s else ""
    return one.form.syntax().replace(f"[{FADE}]", f"[fade in seconds{default}]")


def _answers() -> Iterator[str]:
    for question in QUESTIONS:
        for place, (answer, tags, about) in enumerate(question.answers):
            asked = "" if place else f"`{question.address}`"
            yield f"|{_spaced(asked)}| `{answer}`{f' `{tags}`' if tags else ''} | {about} |"
    yield "| all of them | `/end` `,si` | the question's address; how many answers came before |"


def _fields() -> Iterator[str]:
    for name, (kind, meaning) in FIELDS.items():
        yield f"| `{STATUS}/{name}` | `,{TAGS[kind]}` | {meaning} |"


def _spaced(cell: str) -> str:
    return f" {cell} " if cell else " "


if __name__ == "__main__":
    osc = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/osc.md")
    osc.write_text(written(osc.read_text("utf-8")), "utf-8")
