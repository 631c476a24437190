"""The options of every command that reads other people's recordings."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any, TypeVar

import typer

from appliance.pose.reading_options import ReadingOptions
from appliance.pose.stage_frame import FACINGS, UPS

T = TypeVar("T")
_GROUP = "How recordings are read; PATTERN=VALUE for some of several"


def reading_options(command: Callable[..., T]) -> Callable[..., T]:
    """Adds the options to a command of the command line, which gets them as its argument `reading`."""
    own = inspect.signature(command, eval_str=True)

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> T:
        given = {name: options.pop(name) for name in OPTIONS}
        parsed = {name: _parsed(name, given[name] or []) for name in OPTIONS if name != "all_frames"}
        return command(
            *arguments, **options, reading=ReadingOptions(**parsed, all_frames=given["all_frames"])
        )

    kept = [parameter for name, parameter in own.parameters.items() if name != "reading"]
    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in OPTIONS.items()
    ]
    vars(run)["__signature__"] = own.replace(parameters=[*kept, *added])  # what inspect.signature looks at
    run.__annotations__ = {one.name: one.annotation for one in (*kept, *added)}
    return run


def _option(text: str, metavar: str) -> Any:
    return Annotated[list[str] | None, typer.Option(help=text, metavar=metavar, rich_help_panel=_GROUP)]


OPTIONS: dict[str, tuple[Any, Any]] = {
    "metres_per_unit": (_option("Unit of lengths in metres: 0.0254 for inches.", "METRES"), None),
    "up": (_option("Vertical axis of the file: y or z.", "AXIS"), None),
    "facing": (_option("Where the dancer faces once upright: -z, x, -x; z: it is not turned.", "AXIS"), None),
    "true_fps": (_option("Poses a second, where the header is wrong: 'salsa_*=60'.", "FPS"), None),
    "root": (_option("Joint that carries the body; what is above it is left out.", "JOINT"), None),
    "all_frames": (
        Annotated[
            bool,
            typer.Option("--all-frames", help="Take no frame for a capture error.", rich_help_panel=_GROUP),
        ],
        False,
    ),
}


def _parsed(name: str, several: list[str]) -> dict[str, Any]:
    """Pattern to value. Raises typer.BadParameter."""
    return dict(_pair(name, text) for text in several)


def _pair(name: str, text: str) -> tuple[str, Any]:
    pattern, separator, value = text.rpartition("=")
    pattern = pattern if separator else "*"
    if name == "root":
        return pattern, value
    known = {"up": UPS, "facing": tuple(FACINGS)}.get(name)
    if known is not None:
        value = value.casefold().removeprefix("+")
        if value not in known:
            raise _refusal(name, text, f"one of {', '.join(known)}")
        return pattern, value
    least, most = (1.0, 1000.0) if name == "true_fps" else (1e-6, 10.0)
    try:
        number = float(value)
    except ValueError:
        number = 0.0
    if not least <= number <= most:
        raise _refusal(name, text, f"{_KINDS[name]}, {least:g} to {most:g}, or PATTERN={_EXAMPLES[name]}")
    return pattern, number


_KINDS = {"true_fps": "a rate", "metres_per_unit": "a unit in metres"}
_EXAMPLES = {
    "true_fps": "FPS ('salsa_*=60')",
    "metres_per_unit": "METRES ('solo_*=0.0254')",
}


def _refusal(name: str, text: str, wanted: str) -> typer.BadParameter:
    option = f"--{name.replace('_', '-')}"
    return typer.BadParameter(f"'{text}' is not {wanted}.", param_hint=option)
