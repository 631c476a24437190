"""`bunraku lights convert`: a fixture's JSON in, a profile's YAML out, and what was left out."""

from __future__ import annotations

from pathlib import Path

import yaml

from appliance.box.durable import put_in_place, write_beside
from appliance.fixture_library.open_fixture_library import LibraryError, profile_values
from appliance.pose.foreign_file import content, plain_json
from appliance.show.config_error import ConfigError, Problem
from appliance.show.fixture_profile import FOLDER, ProfileConfig
from appliance.show.validation import validated
from appliance.show.yaml_file import read_yaml

_LARGEST = 4_000_000  # bytes; the largest fixture of the library has 1.2 MB
_HEAD = """\
# Made by `bunraku lights convert` from {name}, a fixture of the Open Fixture Library.
# Prove it with `bunraku lights test` before the show.
"""


def convert_file(source: Path, out: Path | None) -> None:
    """Write the profile and print what to do with it. Raises ConfigError; then nothing was written."""
    out = out or source.with_suffix(".yaml")
    values, notes = _values(source)
    text = _HEAD.format(name=source.name) + yaml.safe_dump(
        values, sort_keys=False, allow_unicode=True, default_flow_style=None, width=100
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    written = write_beside(out, text.encode())
    try:
        profile = validated(ProfileConfig, read_yaml(written), {})
    except ConfigError:
        written.unlink()
        raise
    put_in_place(written, out)
    for note in notes:
        print(note)
    modes = ", ".join(f"{mode.name} ({len(mode.channels)})" for mode in profile.modes)
    print(f"{profile.name}: {out}. Modes and their channels: {modes}.")
    print(f"Put it into the folder {FOLDER} of a show and write `profile: {out.stem}` in its lights.")


def _values(source: Path) -> tuple[dict[str, object], list[str]]:
    try:
        return profile_values(plain_json(content(source, _LARGEST).decode()))
    except OSError as error:
        message, line = f"The file cannot be read ({error.strerror}).", 0
    except UnicodeDecodeError:
        message, line = "This is not text. Download the fixture as JSON.", 1
    except LibraryError as error:
        message, line = str(error), 0
    except ValueError as error:
        why, line = getattr(error, "msg", error), getattr(error, "lineno", 1)
        message = f"This is not JSON: {why}. Download the fixture again."
    raise ConfigError([Problem(source, line, message)])
