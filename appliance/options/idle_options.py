"""Options that would do nothing in the way a command is used: they are refused, not ignored."""

from __future__ import annotations

from collections.abc import Iterable

import typer


def refuse_idle(context: typer.Context, names: Iterable[str], where: str) -> None:
    """Raises typer.BadParameter for those of a command's parameters, by name, that the user wrote.

    where: the use of the command in which they do nothing: 'with --free'.
    """
    options = {parameter.name: parameter.opts[0] for parameter in context.command.params if parameter.opts}
    idle = [options[name] for name in names if is_written(context, name)]
    if idle:
        one = len(idle) == 1
        message = f"{', '.join(idle)} {'does' if one else 'do'} nothing {where}"
        raise typer.BadParameter(f"{message}. Leave {'it' if one else 'them'} out.")


def is_written(context: typer.Context, name: str) -> bool:
    """Whether the user gave this parameter, by name."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
