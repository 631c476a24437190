"""How to read other people's recordings: the same options for every command that reads any."""

from __future__ import annotations

import fnmatch
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from appliance.pose.bvh import BvhError, read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import UnknownJointError
from appliance.pose.stage_frame import CENTIMETRE, FACINGS, UPS, Guess, Reading, in_stage_frame

T = TypeVar("T")
_GROUP = "How recordings are read; PATTERN=VALUE for some of several"


@dataclass(frozen=True)
class ReadingOptions:
    """What is known of recordings beyond their files, by pattern of their names, the first that fits counts.

    metres_per_unit; up: 'y' or 'z'; facing: a key of FACINGS; root: a joint's name; all_frames: none is a
    capture error.
    """

    metres_per_unit: Mapping[str, float] = field(default_factory=dict)
    up: Mapping[str, str] = field(default_factory=dict)
    facing: Mapping[str, str] = field(default_factory=dict)
    true_fps: Mapping[str, float] = field(default_factory=dict)
    root: Mapping[str, str] = field(default_factory=dict)
    all_frames: bool = False

    def reading_of(self, name: str) -> Reading:
        """How a recording of this name, without its ending, is to be read."""
        found = (first_fit(one, name) for one in (self.metres_per_unit, self.up, self.facing, self.root))
        return Reading(*found)

    def fps_of(self, name: str) -> float | None:
        """Its rate, where its header is wrong."""
        rate: float | None = first_fit(self.true_fps, name)
        return rate

    def over(self, other: ReadingOptions) -> ReadingOptions:
        """These, and the other's where these say nothing."""
        mapped = ("metres_per_unit", "up", "facing", "true_fps", "root")
        joined = {name: {**getattr(self, name), **_rest(getattr(other, name), self, name)} for name in mapped}
        return ReadingOptions(**joined, all_frames=self.all_frames or other.all_frames)


AS_THE_FILES_SAY = ReadingOptions()


def _rest(known: Mapping[str, Any], first: ReadingOptions, name: str) -> dict[str, Any]:
    """What is known by other patterns than those that come first."""
    return {pattern: value for pattern, value in known.items() if pattern not in getattr(first, name)}


def first_fit(by_pattern: Mapping[str, Any], name: str) -> Any:
    """The value of the first pattern that fits a name; None without one."""
    return next((value for pattern, value in by_pattern.items() if fnmatch.fnmatch(name, pattern)), None)


def read_upright(path: Path, options: ReadingOptions = AS_THE_FILES_SAY) -> tuple[Recording, list[Guess]]:
    """A BVH file in the stage's frame, and what was lost or changed.

    Raises BvhError, also for a root that it does not have, or OSError.
    """
    recording = read_bvh(path, true_fps=options.fps_of(path.stem))
    return brought_in(path, recording, options.reading_of(path.stem))


def brought_in(
    path: Path, recording: Recording, reading: Reading, unit_m: float = CENTIMETRE
) -> tuple[Recording, list[Guess]]:
    """A recording of this file in the stage's frame, and what was lost or changed.

    unit_m: of the file's lengths, as it was read. Raises BvhError for a root that it does not have.
    """
    try:
        found, guesses = in_stage_frame(recording, reading, unit_m=unit_m)
    except UnknownJointError as error:
        raise BvhError(path, 1, f"{error} Give another --root.") from error
    return found, [*(Guess(note, "") for note in recording.notes), *guesses]


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


def _option(words: str, metavar: str) -> Any:
    return Annotated[list[str] | None, typer.Option(help=words, metavar=metavar, rich_help_panel=_GROUP)]


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
    return dict(_pair(name, words) for words in several)


def _pair(name: str, words: str) -> tuple[str, Any]:
    pattern, separator, value = words.rpartition("=")
    pattern = pattern if separator else "*"
    if name == "root":
        return pattern, value
    known = {"up": UPS, "facing": tuple(FACINGS)}.get(name)
    if known is not None:
        value = value.casefold().removeprefix("+")
        if value not in known:
            raise _refusal(name, words, f"one of {', '.join(known)}")
        return pattern, value
    least, most = (1.0, 1000.0) if name == "true_fps" else (1e-6, 10.0)
    try:
        number = float(value)
    except ValueError:
        number = 0.0
    if not least <= number <= most:
        raise _refusal(name, words, f"{_WORDS[name]}, {least:g} to {most:g}, or PATTERN={_EXAMPLES[name]}")
    return pattern, number


_WORDS = {"true_fps": "a rate", "metres_per_unit": "a unit in metres"}
_EXAMPLES = {
    "true_fps": "FPS ('salsa_*=60')",
    "metres_per_unit": "METRES ('solo_*=0.0254')",
}


def _refusal(name: str, words: str, wanted: str) -> typer.BadParameter:
    option = f"--{name.replace('_', '-')}"
    return typer.BadParameter(f"'{words}' is not {wanted}.", param_hint=option)
