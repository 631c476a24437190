"""Another value for a key of a YAML text: its comments and all other lines stay as they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from appliance.pose.foreign_yaml import composed, is_shallow
from appliance.show.yaml_file import Location

_INDENT = "  "


def with_value(text: str, location: Location, value: Any) -> str:
    """The text with this value there; a key that it lacks is written first of those around it.

    Raises ValueError for a text that is no YAML, and for a place in a list that it lacks.
    """
    try:
        node = composed(text)
    except yaml.YAMLError as error:
        raise ValueError(f"This is not YAML ({error}).") from error
    if not is_shallow(value):
        raise ValueError(f"The value for '{location[-1]}' is nested too deeply.")
    if node is None:
        return f"{text.rstrip()}\n{location[0]}: {_flow(_nested(location[1:], value))}\n".lstrip()
    key: yaml.Node | None = None
    for depth, step in enumerate(location):
        if isinstance(step, int):
            if not isinstance(node, yaml.SequenceNode) or step >= len(node.value):
                raise ValueError(f"The file has no entry {step} there.")
            key, node = None, node.value[step]
            continue
        if not isinstance(node, yaml.MappingNode):
            return _replaced(text, key, node, _nested(location[depth:], value))
        found = next((pair for pair in node.value if pair[0].value == step), None)
        if found is None:
            return _inserted(text, node, f"{step}: {_flow(_nested(location[depth + 1 :], value))}")
        key, node = found
    return _replaced(text, key, node, value)


def _replaced(text: str, key: yaml.Node | None, node: yaml.Node, value: Any) -> str:
    start = node.start_mark.index if key is None else key.end_mark.index
    written = _flow(value) if key is None else f": {_flow(value)}"
    return text[:start] + written + text[_end(node) :]


def _inserted(text: str, around: yaml.MappingNode, line: str) -> str:
    if around.flow_style:
        at = around.start_mark.index + 1
        return text[:at] + line + (", " if around.value else "") + text[at:]
    first = around.value[0][0].start_mark
    return f"{text[: first.index]}{line}\n{' ' * first.column}{text[first.index :]}"


def _end(node: yaml.Node) -> int:
    """Where it ends; the library counts comments and empty lines behind a block to it."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return int(node.end_mark.index)


def _nested(location: Location, value: Any) -> Any:
    for step in reversed(location):
        value = {step: value}
    return value


def _flow(value: Any) -> str:
    said = yaml.safe_dump(value, default_flow_style=True, width=1 << 20, allow_unicode=True, sort_keys=False)
    return said.removesuffix("\n").removesuffix("\n...")


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
