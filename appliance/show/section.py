"""Shared by all sections of a configuration file: strict types, no unknown keys, kinds of value."""

from __future__ import annotations

import ipaddress
import math
import os
import stat
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from appliance.show.bundle import require_file
from appliance.show.config_error import did_you_mean

# Nothing that a box file names is here; a name that leads here would be read, or written over, as the box.
_OF_THE_SYSTEM = ("/etc", "/proc", "/sys", "/dev", "/boot", "/usr", "/bin", "/sbin", "/lib")
_BUT = ("/etc/bunraku", "/dev/shm", "/usr/local", "/usr/src")
_MEMORY = 1  # major number of /dev/zero and the like
MOST_PUPPETS = 4  # on one stage
UNIT_TOLERANCE = 0.05  # how far from length 1 a hand-written quaternion may be before it is a typing error


class Section(BaseModel):
    """A part of show.yaml or box.yaml. Frozen; a word is never taken for a number, nor 'yes' for a text."""

    # defer_build: a validator is built when something is read with it, and most processes read few kinds.
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


def key(
    meaning: str,
    default: Any = ...,
    *,
    within: tuple[float | None, float | None] = (None, None),
    above: float | None = None,
    most: float | None = None,
    length: tuple[int, int | None] | None = None,
) -> Any:
    """A key of a section: its sentence in docs/configuration.md, its default (... when needed), its bounds.

    within: least and greatest number; above: just out of bounds; length: fewest and most characters, entries.
    """
    least, greatest = within
    shortest, longest = length or (None, None)
    return Field(
        default=default,
        description=meaning,
        ge=least,
        gt=above,
        le=most if greatest is None else greatest,
        min_length=shortest or None,
        max_length=longest,
    )


def part(section: type[Section]) -> Any:
    """A key that opens another section, which has its own defaults."""
    return Field(default_factory=section, description=str(section.__doc__))


def refusal(
    message: str, cure: str, at: str | int | tuple[str | int, ...] | None = None
) -> PydanticCustomError:
    """An error for validators to raise; `at`: the key (or keys) below the validated one where it stands."""
    return PydanticCustomError("refused", "{message}", {"message": message, "cure": cure, "at": at})


def refuse_repeats(values: Sequence[object], message: str, cure: str) -> None:
    """Raise for the first repeated value; the message may name {value}, {first} and {place}."""
    for place, value in enumerate(values):
        if value in values[:place]:
            text = message.format(value=value, first=values.index(value), place=place)
            raise refusal(text, cure, at=place)


def each_name_once(kind: str) -> Callable[[list[Any]], list[Any]]:
    """A validator for a list of sections with names. kind: what they are, in the plural."""

    def named_once(sections: list[Any]) -> list[Any]:
        names = [section.name for section in sections]
        refuse_repeats(names, f"Two {kind} are called '{{value}}'.", "Give one another name.")
        return sections

    return named_once


def _in_degrees(value: Any) -> Any:
    """`euler: {x: 90}` or `axis: [0, 1, 0]` with `angle: 90` as a quaternion; anything else as it is."""
    if not isinstance(value, dict):
        return value
    import numpy as np  # here: most processes read a file without degrees, and nothing else of them needs it

    from appliance.pose import quaternion

    cure = "Write {euler: {x: 90}}, or {axis: [0, 1, 0], angle: 90}, in degrees; or [w, x, y, z]."
    euler = value.get("euler")
    if len(value) == 1 and isinstance(euler, dict) and set(euler) <= {"x", "y", "z"}:
        angles = [euler.get(axis, 0.0) for axis in "zyx"]
        if all(map(_is_number, angles)):
            return quaternion.from_euler(np.radians(np.array(angles, np.float64)), "zyx").tolist()
    if set(value) == {"axis", "angle"} and _is_number(value["angle"]):
        axis = value["axis"]
        if isinstance(axis, list) and len(axis) == 3 and all(map(_is_number, axis)):
            turn = quaternion.from_axis_angle(_axis((axis[0], axis[1], axis[2])), np.radians(value["angle"]))
            return turn.tolist()
    raise refusal("This is no orientation.", cure)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _unit(orientation: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = math.hypot(*orientation)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        raise refusal(
            f"This orientation has the length {length:.3g}; a rotation has the length 1.",
            "Write a unit quaternion in the order w, x, y, z ([1, 0, 0, 0] turns nothing), or degrees: "
            "{euler: {x: 90}}.",
        )
    w, x, y, z = (part / length for part in orientation)
    return w, x, y, z


def _axis(axis: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*axis)
    if not 1e-6 < length < 1e6:
        raise refusal("An axis needs a direction.", "Write for instance [0, 1, 0], which points upwards.")
    x, y, z = (part / length for part in axis)
    return x, y, z


Direction = Literal["x", "-x", "y", "-y", "z", "-z"]


def _each_axis_once(axes: tuple[Direction, Direction, Direction]) -> tuple[Direction, Direction, Direction]:
    if sorted(axis[-1] for axis in axes) != ["x", "y", "z"]:
        raise refusal("Each of x, y and z is needed once.", "Write for instance [x, -z, y].")
    return axes


Axes = Annotated[tuple[Direction, Direction, Direction], Field(strict=False), AfterValidator(_each_axis_once)]


def _ipv4(host: str) -> str:
    if host == "localhost":
        return "127.0.0.1"
    try:
        return str(ipaddress.IPv4Address(host))
    except ValueError:
        raise refusal(
            f"'{host}' is not an IPv4 address in numbers.",
            "Write it like 192.168.0.20: looking up a name could hold up the show.",
        ) from None


def _inside_the_bundle(name: str, info: ValidationInfo) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name:
        raise refusal(
            f"'{name}' is not inside the show's folder.", "Put the file there and write only its name."
        )
    directory = (info.context or {}).get("directory")
    cure = "Check the name, or copy the whole bundle again."
    try:
        if directory is not None:
            require_file(directory, name)
    except (FileNotFoundError, NotADirectoryError, ValueError):  # no name holds a zero
        raise refusal(f"There is no file '{name}' in {directory}.", cure) from None
    except OSError as error:
        raise refusal(f"'{name}' cannot be part of the show ({error.strerror}).", cure) from None
    return name


def _in_the_skeleton(joint: str, info: ValidationInfo) -> str:
    joints: Sequence[str] | None = (info.context or {}).get("joints")
    if joints is not None and joint not in joints:
        raise refusal(f"The skeleton has no joint '{joint}'.", did_you_mean(joint, joints))
    return joint


def _beside_the_file(path: Path, info: ValidationInfo) -> Path:
    directory = (info.context or {}).get("directory")
    if directory is None:
        return path
    placed = Path(directory, path.expanduser())
    try:
        real = Path(os.path.realpath(placed))
    except ValueError:
        raise refusal(f"'{path}' is no name of a file: no name holds a zero.", "Check it.") from None
    for system in _OF_THE_SYSTEM:
        if real.is_relative_to(system) and not any(map(real.is_relative_to, _BUT)):
            raise refusal(f"'{path}' belongs to the system.", "Name a place of the box, like `state`.")
    return placed


def _file_beside(path: Path, info: ValidationInfo) -> Path:
    placed = _beside_the_file(path, info)
    if _kind_of(placed) not in (None, stat.S_IFREG):
        raise refusal(f"'{path}' is no file.", "Name a file, or none that is there yet.")
    return placed


def _folder_beside(path: Path, info: ValidationInfo) -> Path:
    placed = _beside_the_file(path, info)
    existing = next((one for one in (placed, *placed.parents) if _kind_of(one) is not None), placed)
    if _kind_of(existing) not in (None, stat.S_IFDIR):
        raise refusal(f"'{path}' is no folder.", "Name a folder; it is made where it is missing.")
    return placed


def _kind_of(path: Path) -> int | None:
    """None: there is nothing, or nothing that can be looked at."""
    try:
        return stat.S_IFMT(path.stat().st_mode)
    except (OSError, ValueError):  # no name holds a zero
        return None


def _serial_device(name: str) -> str:
    try:
        found = Path(name).stat()
    except (OSError, ValueError):
        return name  # it may be plugged in later
    if not stat.S_ISCHR(found.st_mode) or os.major(found.st_rdev) == _MEMORY:
        raise refusal(f"'{name}' is no serial device.", "Look for it: ls /dev/tty*, or /dev/serial/by-id.")
    return name


Orientation = Annotated[
    tuple[float, float, float, float],
    Field(strict=False),
    BeforeValidator(_in_degrees),
    AfterValidator(_unit),
]
Axis = Annotated[tuple[float, float, float], Field(strict=False), AfterValidator(_axis)]
Joint = Annotated[str, AfterValidator(_in_the_skeleton)]
Ipv4 = Annotated[str, AfterValidator(_ipv4)]
BundleFile = Annotated[str, Field(min_length=1), AfterValidator(_inside_the_bundle)]
LocalFile = Annotated[Path, Field(strict=False), AfterValidator(_file_beside)]
LocalFolder = Annotated[Path, Field(strict=False), AfterValidator(_folder_beside)]
SerialDevice = Annotated[str, AfterValidator(_serial_device)]
