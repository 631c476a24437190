"""Adds to typer's help: examples, whole sentences in lists of commands, words for values (FILE, NUMBER)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from appliance.cli.examples import EXAMPLES

MACHINERY = ("--socket-fd", "--chosen")  # what units and processes of the box give each other
_VALUES = {"path": "FILE", "int": "NUMBER", "float": "NUMBER", "str": "TEXT"}
_OLDER = {"file": "path", "integer": "int", "text": "str"}  # names of typer before 0.20


def complete_help(command: Any, path: str = "", order: Sequence[str] = ()) -> None:
    """Complete the help of a parsed command (click's, or typer's own) and of all below it.

    order: of the commands below it; those that are not in it come last.
    """
    below = getattr(command, "commands", {})
    for name in sorted(below, key=lambda name: order.index(name) if name in order else len(order)):
        below[name] = below.pop(name)
        complete_help(below[name], f"{path} {name}".strip())
    if examples := EXAMPLES.get(path, ()):
        title = "Example:" if len(examples) == 1 else "Examples:"
        command.epilog = "\n  ".join([f"\b\n{title}", *examples])  # \b: these lines are not wrapped
    command.short_help = _first_sentence(command.help or "")
    for one in command.params:
        one.hidden = one.hidden or bool(set(MACHINERY) & set(one.opts))
        if one.metavar is None and one.param_type_name == "option":
            one.metavar = _value(one, command.context_class(command))


def _first_sentence(text: str) -> str:
    flat = " ".join(text.split("\n\n")[0].split())
    return re.split(r"(?<=[a-z)])[.;] ", flat)[0].rstrip(".") + "."


def _value(option: Any, context: Any) -> str | None:
    """The word for the value of an option; None where typer's own is clear: choices, flags."""
    name = option.display_type(context) if hasattr(option, "display_type") else option.type.name
    kind = re.sub(r"^<?(list\[)?", "", name.lower()).split()[0].rstrip("]>")
    kind = _OLDER.get(kind, kind)
    if option.is_flag or kind not in _VALUES:
        return None
    explained = (option.help or "").lower()
    is_folder = explained.startswith(("folder", "show")) or "into this folder" in explained
    return "FOLDER" if kind == "path" and is_folder else _VALUES[kind]
