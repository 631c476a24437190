"""`bunraku lights convert`: a fixture in, a profile's YAML out; a rig in, its fixtures and profiles out."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping
from io import BufferedReader
from pathlib import Path
from typing import Any

import yaml

from appliance.box.durable import put_in_place, write_beside
from appliance.fixture_library import gdtf, mvr, open_fixture_library
from appliance.fixture_library.open_fixture_library import LibraryError
from appliance.pose.foreign_file import TooLargeError, content, opened, plain_json
from appliance.show.config_error import ConfigError, Problem
from appliance.show.fixture_profile import FOLDER, ProfileConfig
from appliance.show.lights import LightsConfig
from appliance.show.validation import validated
from appliance.show.yaml_file import read_yaml

_LARGEST = 4_000_000  # bytes; the largest fixture of the library has 1.2 MB
_LARGEST_ARCHIVE = 1_000_000_000  # with models and pictures of all its fixtures, none of which is read
_HEAD = """\
# Made by `bunraku lights convert` from {name}, {kind}.
# Prove it with `bunraku lights test` before the show.
"""


def convert_file(source: Path, out: Path | None, mode: str | None = None) -> None:
    """Write the profile, of all modes or one; of a rig, a folder with its fixtures and profiles.

    Prints what was left out and what to do next. Raises ConfigError; then no profile was written for a
    fixture, and no list for a rig.
    """
    if source.suffix.casefold() == ".mvr":
        _convert_rig(source, out or source.with_suffix(""), mode)
        return
    out = out or source.with_suffix(".yaml")
    is_gdtf = source.suffix.casefold() == ".gdtf"
    values, notes = _gdtf_values(source, mode) if is_gdtf else _library_values(source, mode)
    profile = _write_profile(
        values, out, source.name, "a fixture in GDTF" if is_gdtf else "a fixture of the Open Fixture Library"
    )
    for note in notes:
        print(note)
    modes = ", ".join(f"{mode.name} ({len(mode.channels)})" for mode in profile.modes)
    print(f"{profile.name}: {out}. Modes and their channels: {modes}.")
    print(f"Put it into the folder {FOLDER} of a show and write `profile: {out.stem}` in its lights.")


def _convert_rig(source: Path, out: Path, mode: str | None) -> None:
    if mode is not None:
        raise ConfigError([Problem(source, 0, "A rig names the modes of its fixtures itself.", "No --mode.")])
    try:
        with _opened_archive(source) as stream:
            fixtures, profiles, notes = mvr.rig_of(stream)
    except LibraryError as error:
        raise ConfigError([Problem(source, 0, str(error))]) from None
    except OSError as error:
        raise _unreadable(source, error) from None
    for name, values in profiles.items():
        _write_profile(values, out / FOLDER / f"{name}.yaml", source.name, "a rig in MVR")
    rig = out / "rig.yaml"
    put_in_place(
        write_beside(rig, _text({"fixtures": fixtures}, source.name, "a rig in MVR", 200).encode()), rig
    )
    for note in notes:
        print(note)
    print(f"{len(fixtures)} fixture{'s' * (len(fixtures) != 1)}: {rig}. Profiles: {out / FOLDER}.")
    try:
        validated(LightsConfig, read_yaml(rig), {"directory": out})
    except ConfigError as error:
        print(f"A show refuses this list as it is:\n{error}")
    print(
        f"Read it, then copy the list into `lights: fixtures:` of a show and the profiles into its {FOLDER}."
    )


def _opened_archive(source: Path) -> BufferedReader:
    stream = opened(source)
    if os.fstat(stream.fileno()).st_size > _LARGEST_ARCHIVE:
        stream.close()
        raise TooLargeError(errno.EFBIG, f"it is larger than {_LARGEST_ARCHIVE / 1e6:g} MB", str(source))
    return stream


def _unreadable(source: Path, error: OSError) -> ConfigError:
    return ConfigError([Problem(source, 0, f"The file cannot be read ({error.strerror}).")])


def _write_profile(values: Mapping[str, Any], out: Path, name: str, kind: str) -> ProfileConfig:
    out.parent.mkdir(parents=True, exist_ok=True)
    written = write_beside(out, _text(values, name, kind).encode())
    try:
        profile = validated(ProfileConfig, read_yaml(written), {})
    except ConfigError:
        written.unlink()
        raise
    put_in_place(written, out)
    return profile


def _text(values: Mapping[str, Any], name: str, kind: str, width: int = 100) -> str:
    return _HEAD.format(name=name, kind=kind) + yaml.safe_dump(
        dict(values), sort_keys=False, allow_unicode=True, default_flow_style=None, width=width
    )


def _gdtf_values(source: Path, mode: str | None) -> tuple[dict[str, Any], list[str]]:
    try:
        with _opened_archive(source) as stream:
            return gdtf.profile_values(stream, mode)
    except LibraryError as error:
        raise ConfigError([Problem(source, 0, str(error))]) from None
    except OSError as error:
        raise _unreadable(source, error) from None


def _library_values(source: Path, mode: str | None) -> tuple[dict[str, Any], list[str]]:
    try:
        fixture = plain_json(content(source, _LARGEST).decode())
        return open_fixture_library.profile_values(fixture, mode)
    except OSError as error:
        raise _unreadable(source, error) from None
    except UnicodeDecodeError:
        message, line = "This is not text. Download the fixture as JSON.", 1
    except LibraryError as error:
        message, line = str(error), 0
    except ValueError as error:
        why, line = getattr(error, "msg", error), getattr(error, "lineno", 1)
        message = f"This is not JSON: {why}. Download the fixture again."
    raise ConfigError([Problem(source, line, message)])
