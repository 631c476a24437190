"""Fixture profiles: what each channel of a lamp does; YAML files of the show or built in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from appliance.show.config_error import ConfigError, did_you_mean
from appliance.show.section import Section, key, refusal
from appliance.show.validation import validated
from appliance.show.yaml_file import read_yaml

FOLDER = "profiles"  # inside a show bundle
UNUSED = "-"  # a channel that nothing drives
FINE = (" fine", " finer")  # the second and third byte of an attribute
DIMMER, PAN, TILT = "dimmer", "pan", "tilt"
COLOURS = ("red", "green", "blue", "white", "cyan", "magenta", "yellow")  # `colour` sets them
LAMPS = ("amber", "uv", "lime", "indigo", "warm white", "cold white")  # only rules that name them
MAX_CHANNELS = 512

Byte = Annotated[int, Field(ge=0, le=255)]
BytePair = Annotated[tuple[Byte, Byte], Field(strict=False)]


class AttributeConfig(Section):
    """The special properties of an attribute; one that is not listed has the defaults."""

    name: str = key("As in the modes' channels, without 'fine'.", length=(1, 64))
    default: float | None = key(
        "Value when no rule drives it, as a fraction of its range. Default: pan and tilt in "
        "the middle, colours white, everything else 0.",
        None,
        within=(0, 1),
    )
    limits: BytePair = key(
        "First and last value (0 to 255) of the part of the channel that is used.", (0, 255)
    )
    degrees: float | None = key(
        "For pan (540) and tilt (270): the whole range in degrees.", None, above=0, most=1440
    )
    invert: bool = key("The channel is inverted.", False)
    slew: float | None = key(
        "For pan and tilt (180): the greatest speed, degrees a second.", None, above=0, most=2000
    )
    dims: bool = key(
        "Master and blackout scale it, as they scale the dimmer: for fog, strobes, lasers.", False
    )
    snap: bool = key(
        "It jumps in the middle of a fade instead of sliding: for gobo and colour wheels.", False
    )

    @field_validator("limits")
    @classmethod
    def _in_order(cls, limits: tuple[int, int]) -> tuple[int, int]:
        if limits[0] >= limits[1]:
            raise refusal(f"{list(limits)} has no room between its ends.", "Write [first, last].")
        return limits


class ModeConfig(Section):
    """One layout of channels, as chosen in the fixture's own menu."""

    name: str = key("Name in the fixture's menu.", length=(1, 64))
    channels: list[str] = key(
        "Attributes from the first channel on; 'pan fine' is the second byte of pan, 'pan finer' "
        "the third, '-' a channel that stays 0.",
        length=(1, MAX_CHANNELS),
    )

    @field_validator("channels")
    @classmethod
    def _each_byte_once(cls, channels: list[str]) -> list[str]:
        for place, channel in enumerate(channels):
            if channel != UNUSED and channel in channels[:place]:
                message = f"'{channel}' is on channels {channels.index(channel) + 1} and {place + 1}."
                cure = f"Number them ('{channel} 1', '{channel} 2'), or write '{UNUSED}' for one of them."
                raise refusal(message, cure, at=place)
            coarse = next((channel.removesuffix(fine) for fine in FINE if channel.endswith(fine)), "")
            if coarse and coarse not in channels:
                raise refusal(
                    f"'{channel}' has no coarse channel '{coarse}'.",
                    did_you_mean(coarse, [name for name in channels if not name.endswith(FINE)]),
                    at=place,
                )
        return channels

    @property
    def attributes(self) -> tuple[str, ...]:
        """Names of its attributes, in the order of their first channels."""
        return tuple(name for name in self.channels if name != UNUSED and not name.endswith(FINE))


class ProfileConfig(Section):
    """A fixture profile: modes and what is special about attributes."""

    name: str = key("Manufacturer and model.", length=(1, 200))
    modes: list[ModeConfig] = key(
        "Layouts; the first one is used unless the patch names another.", length=(1, 256)
    )
    attributes: list[AttributeConfig] = key(
        "Special properties of some of them.", [], length=(0, MAX_CHANNELS)
    )

    @model_validator(mode="after")
    def _known_attributes(self) -> ProfileConfig:
        known = [name for mode in self.modes for name in mode.attributes]
        for attribute in self.attributes:
            if attribute.name not in known:
                raise refusal(
                    f"No mode has a channel '{attribute.name}'.",
                    did_you_mean(attribute.name, known),
                    "attributes",
                )
        return self

    def mode(self, name: str | None) -> ModeConfig:
        """The mode of that name, None: the first. Raises KeyError."""
        if name is None:
            return self.modes[0]
        return {mode.name: mode for mode in self.modes}[name]

    def attribute(self, name: str) -> AttributeConfig:
        """The special properties of an attribute; the defaults where there are none."""
        return next((known for known in self.attributes if known.name == name), AttributeConfig(name=name))


def base(attribute: str) -> str:
    """'red' for 'red 2': the attribute without the number of its cell."""
    name, _, number = attribute.rpartition(" ")
    return name if name and number.isdigit() else attribute


def built_in_folder() -> Path:
    """Where the profiles lie that come with the box."""
    return Path(__file__).resolve().parent / FOLDER


def profile_names(show: Path | None) -> Sequence[str]:
    """Names of all profiles that a show can use."""
    folders = [built_in_folder()] + ([show / FOLDER] if show is not None else [])
    return sorted({name for folder in folders for name in _profiles_in(folder)})


def find_profile(name: str, show: Path | None) -> Path | None:
    """The profile's file: the show's own first, then the built-in one; None where there is none."""
    folders = ([show / FOLDER] if show is not None else []) + [built_in_folder()]
    if "/" in name or "\\" in name:
        return None
    return next((path for folder in folders if (path := _profiles_in(folder).get(name)) is not None), None)


def _profiles_in(folder: Path) -> dict[str, Path]:
    """Name to file; the ending in any case."""
    files = (path for path in sorted(folder.glob("*"), reverse=True) if path.is_file())
    return {path.stem: path for path in files if path.suffix.casefold() == ".yaml"}


_read: dict[tuple[Path, int], ProfileConfig] = {}


def load_profile(name: str, show: Path | None) -> ProfileConfig:
    """A profile by its name; raises ConfigError for one that is faulty, KeyError where there is none."""
    path = find_profile(name, show)
    if path is None:
        raise KeyError(name)
    key = (path, path.stat().st_mtime_ns)
    if key not in _read:
        inside = show if show is not None and path.is_relative_to(show) else path.parent
        _read[key] = validated(ProfileConfig, read_yaml(path, inside), {})
    return _read[key]


def profile_refusal(name: str, show: Path | None) -> Exception | None:
    """Why a fixture cannot have this profile, to be raised by validators; None when it can."""
    try:
        load_profile(name, show)
    except KeyError:
        return refusal(f"There is no fixture profile '{name}'.", did_you_mean(name, profile_names(show)))
    except ConfigError as error:
        return refusal(
            f"The fixture profile '{name}' is faulty: {error.problems[0]}", "Mend that file first."
        )
    return None
