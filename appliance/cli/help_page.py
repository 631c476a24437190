"""What `-h` prints: usage, arguments, options but for the box's own machinery, and examples."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from appliance.cli.examples import EXAMPLES

MACHINERY = ("--socket-fd", "--chosen")  # what units and processes of the box give each other
_WIDEST, _NARROWEST = 100, 60
_COLUMN = 26  # of names and values; a longer one has its text on the next line
_LONGEST_CHOICE = 30
_RANGE = re.compile(r"(?:(?P<least>[-\d.e]+)<=)?x(?:>=(?P<more>[-\d.e]+))?(?:<=(?P<most>[-\d.e]+))?")


def give_help(command: Any, path: str = "bunraku", order: Sequence[str] = ()) -> None:
    """Let a parsed command (click's, or typer's own), and all below it, print our page for `-h`.

    order: of the commands below it; those that are not in it come last.
    """
    below = getattr(command, "commands", {})
    for name in sorted(below, key=lambda name: order.index(name) if name in order else len(order)):
        below[name] = below.pop(name)
        give_help(below[name], f"{path} {name}")
    command.format_help = partial(_write, command, path)


def _write(command: Any, path: str, context: Any, formatter: Any) -> None:
    width = max(_NARROWEST, min(_WIDEST, shutil.get_terminal_size((80, 24)).columns))
    formatter.write("\n".join(_page(command, path, context, width)) + "\n")


def _page(command: Any, path: str, context: Any, width: int) -> Iterator[str]:
    parameters = command.get_params(context)
    shown = [one for one in parameters if not one.hidden and not set(MACHINERY) & set(one.opts)]
    arguments = [one for one in shown if one.param_type_name == "argument"]
    options = [one for one in shown if one.param_type_name == "option"]
    below = getattr(command, "commands", {})
    needed = [f"{one.opts[0]} {_value(one, context)}" for one in options if one.required]
    usage = [path, *(_name(one) for one in arguments), *needed, "[OPTIONS]"]
    yield f"Usage: {' '.join([*usage, *['COMMAND ...'] * bool(below)])}"
    for paragraph in (command.help or "").split("\n\n"):
        lines = textwrap.wrap(" ".join(paragraph.split()), width - 2)
        yield from ("", *(f"  {line}" for line in lines))
    yield from _table("Commands", [(name, _first_sentence(one)) for name, one in below.items()], width)
    yield from _table("Arguments", [(_name(one), one.help or "") for one in arguments], width)
    rows = [(_option(one, context), _told(one, context)) for one in options]
    if path == "bunraku":
        rows.append(("--version", "Print the version, and end."))
    yield from _table("Options", rows, width)
    examples = EXAMPLES.get(path.removeprefix("bunraku").strip(), ())
    if examples:
        yield from ("", "Example:" if len(examples) == 1 else "Examples:")
        yield from (f"  {example}" for example in examples)
    if below:
        yield from ("", f"{path} COMMAND -h tells more of a command.")


def _table(title: str, rows: Sequence[tuple[str, str]], width: int) -> Iterator[str]:
    if not rows:
        return
    yield from ("", f"{title}:")
    column = min(_COLUMN, max(len(name) for name, _ in rows))
    for name, text in rows:
        lines = textwrap.wrap(text, width - column - 4, break_on_hyphens=False) or [""]
        if len(name) > column:
            yield f"  {name}"
            name = ""
        yield f"  {name:<{column}}  {lines[0]}".rstrip()
        yield from (" " * (column + 4) + line for line in lines[1:])


def _first_sentence(command: Any) -> str:
    words = " ".join((command.help or "").split("\n\n")[0].split())
    return re.split(r"(?<=[a-z)])[.;] ", words)[0].rstrip(".") + "."


def _name(argument: Any) -> str:
    """An argument as usage shows it: NETWORK, [PHRASE], RECORDING..."""
    word = argument.metavar or str(argument.name).upper().replace("_", "-")
    word = f"{word.removesuffix('S')}..." if argument.nargs != 1 else word
    return word if argument.required else f"[{word}]"


def _option(option: Any, context: Any) -> str:
    names = ", ".join(sorted(option.opts, key=len)) + "".join(f" / {name}" for name in option.secondary_opts)
    return f"{names} {_value(option, context)}".rstrip()


def _value(option: Any, context: Any) -> str:
    """What stands behind an option: nothing for a flag."""
    kind = _kind(option, context)
    if option.is_flag or kind == "bool":
        return ""
    if option.metavar:
        return str(option.metavar)
    if "|" in kind:
        return kind if len(kind) <= _LONGEST_CHOICE else "NAME"
    if "path" in kind.lower():
        words = (option.help or "").lower()
        is_folder = words.startswith(("folder", "show")) or "into this folder" in words
        return "FOLDER" if is_folder else "FILE"
    return "NUMBER" if re.search(r"int|float", kind.lower()) else "TEXT"


def _kind(option: Any, context: Any) -> str:
    """The type in the parser's words, which differ between its releases."""
    words = option.display_type if hasattr(option, "display_type") else option.make_metavar
    return re.sub(r"^[<\[{]+|[>\]}.]+$", "", str(words(context))).removeprefix("list[")


def _told(option: Any, context: Any) -> str:
    """The text of an option, and in brackets what values it takes."""
    facts = ["required"] if option.required else []
    kind = _kind(option, context)
    if "|" in kind and len(kind) > _LONGEST_CHOICE:
        facts.append(kind.replace("|", ", "))
    if hasattr(option, "_get_number_range_help_str"):
        facts += _bounds(option._get_number_range_help_str() or "")
    if isinstance(option.show_default, str):
        facts.append(f"default: {option.show_default}")
    elif not option.is_flag and option.default not in (None, (), []) and not callable(option.default):
        default = getattr(option.default, "value", option.default)
        facts.append(f"default: {default:g}" if isinstance(default, float) else f"default: {default}")
    return (option.help or "") + (f" [{'; '.join(facts)}]" if facts else "")


def _bounds(words: str) -> list[str]:
    """`0<=x<=8` as `0 to 8`, `x>=1` as `1 or more`."""
    found = _RANGE.search(words)
    if not found:
        return []
    limits = found["least"] or found["more"], found["most"]
    least, most = (limit and f"{float(limit):g}" for limit in limits)
    return [f"{least} to {most}" if least and most else f"{least} or more" if least else f"at most {most}"]
