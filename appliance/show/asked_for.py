"""Whether a box file asks for sound lights or remote control at all: a look that loads next to nothing.

At each power-on a process is started for either; on a small machine all that it loads takes seconds.
"""

from __future__ import annotations

from pathlib import Path

from appliance.show.config_error import NotAskedForError, Problem
from appliance.show.yaml_file import read_yaml


def require_sound(box: Path | None) -> None:
    """Raises NotAskedForError where a box file is given and has no sound; ConfigError: it is no YAML."""
    if box is not None and read_yaml(box).values.get("sound") is None:
        raise no_sound(box)


def require_wires(box: Path | None) -> None:
    """Raises NotAskedForError where a box file is given and has no wires; ConfigError: it is no YAML."""
    if box is None:
        return
    outputs = read_yaml(box).values.get("outputs", {})
    if isinstance(outputs, dict) and outputs.get("dmx", []) == []:
        raise no_wires(box)


def no_sound(box: Path | None) -> NotAskedForError:
    """The sentence about this box file."""
    cure = "Write `sound: {}` for the system's own sound card."
    return _not_asked_for(box, "This box file asks for no sound.", cure)


def require_remote(box: Path | None) -> None:
    """Raises NotAskedForError where there is nothing to follow; ConfigError: it is no YAML."""
    values = {} if box is None else read_yaml(box).values
    if all(values.get(name) is None for name in ("timecode", "midi", "hours")):
        cure = "Add `timecode: {source: art-net}`, or `midi: {}` for each controller that is plugged in."
        raise _not_asked_for(box, "This box file has neither timecode nor MIDI nor opening hours.", cure)


def no_wires(box: Path | None) -> NotAskedForError:
    """The sentence about this box file."""
    cure = "Add one under outputs: dmx:, for instance {universe: 1, wire: artnet, host: 192.168.0.30}."
    return _not_asked_for(box, "No wire leads to the lights.", cure)


def _not_asked_for(box: Path | None, message: str, cure: str) -> NotAskedForError:
    return NotAskedForError([Problem(box or Path("box.yaml"), 0, message, cure)])
