"""One more cue in the text of a show.yaml, whose comments and order stay as they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from appliance.pose.foreign_yaml import composed

_INDENT = "  "


def with_cue(text: str, cue: Mapping[str, Any]) -> str:
    """The text with this cue as the last one. Raises yaml.YAMLError or ValueError for no show.yaml."""
    text = text if text.endswith("\n") else f"{text}\n"
    written = yaml.safe_dump(
        dict(cue), default_flow_style=True, sort_keys=False, width=float("inf"), allow_unicode=True
    ).strip()
    root = composed(text)
    if not isinstance(root, yaml.MappingNode) or root.flow_style:
        raise ValueError("this is no show.yaml")
    found = next((value for key, value in root.value if key.value == "cues"), None)
    if found is None:
        return f"{text}\ncues:\n{_INDENT}- {written}\n"
    if not isinstance(found, yaml.SequenceNode):
        raise ValueError("its cues are no list")
    if found.flow_style:
        end = found.end_mark.index - 1  # the closing bracket
        return f"{text[:end]}{', ' if found.value else ''}{written}{text[end:]}"
    lines = text.splitlines(keepends=True)
    place = found.end_mark.line
    while not lines[place - 1].strip() or lines[place - 1].lstrip().startswith("#"):
        place -= 1  # comments after the last cue belong to the next section
    lines.insert(place, f"{' ' * found.start_mark.column}- {written}\n")
    return "".join(lines)
