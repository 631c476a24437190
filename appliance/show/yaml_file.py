"""YAML with its line numbers: plain values, and the line on which each of them stands."""

from __future__ import annotations

import re
from collections.abc import Hashable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from appliance.pose.foreign_file import content, require_inside
from appliance.pose.foreign_yaml import composed
from appliance.show.config_error import ConfigError, Problem, shortened

MAX_BYTES = 256 * 1024  # a long show file has some 2 kB
_LARGEST_NUMBER = 1 << 63  # 60:60:... and 0xff... can have more digits than Python prints
_BARE_COLOUR = re.compile(r"[:\[,]\s+#[0-9a-fA-F]{3}")
_TIMESTAMP = "tag:yaml.org,2002:timestamp"
_TAGS = {
    f"tag:yaml.org,2002:{kind}" for kind in ("map", "seq", "str", "int", "float", "bool", "null", "merge")
}

Location = tuple[str | int, ...]


@dataclass
class YamlFile:
    """Plain values of a file, and the line of each: `lines[("hands", 0, "joint")]`."""

    path: Path
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[Location, int] = field(default_factory=dict)

    def line(self, location: Location) -> int:
        """Line of a value, or of the nearest thing around it that the file has."""
        for end in range(len(location), -1, -1):
            if location[:end] in self.lines:
                return self.lines[location[:end]]
        return 1

    def at(self, *location: str | int) -> Any:
        """The plain value at this location; None where the file has none."""
        values: Any = self.values
        for step in location:
            values = values.get(step) if isinstance(values, dict) else None
        return values

    def problem(self, location: Location, message: str, cure: str) -> Problem:
        """The fault of the value there."""
        return Problem(self.path, self.line(location), message, cure)


def read_yaml(path: Path, inside: Path | None = None) -> YamlFile:
    """Read one document whose top level has keys. inside: the folder that links must not leave.

    Raises ConfigError: file missing or unreadable, not YAML, a key written twice, anchors, too large.
    """
    return parsed_yaml(path, _read(path, inside))


def parsed_yaml(path: Path, data: bytes) -> YamlFile:
    """The same of a file that was read already: its name is for the messages."""
    text = _text(path, data)
    file = YamlFile(path)
    problems: list[Problem] = []
    try:
        root = composed(text)
        if root is not None:
            file.values = _Plain(file, problems).value(root, ())
    except yaml.MarkedYAMLError as error:
        raise _not_yaml(path, text, error) from None
    except yaml.YAMLError as error:
        raise _refused(path, 1, str(error).splitlines()[0]) from None
    if not problems and not isinstance(file.values, dict):
        problems.append(Problem(path, 1, "The file does not consist of keys.", "Write 'key: value' lines."))
    if problems:
        raise ConfigError(problems)
    return file


def _read(path: Path, inside: Path | None) -> bytes:
    try:
        if inside is not None:
            require_inside(path, inside)
        return content(path, MAX_BYTES)
    except OSError as error:
        why = f"The file cannot be read ({error.strerror})."
        raise ConfigError([Problem(path, 0, why, "Check its name and place.")]) from None


def _text(path: Path, data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ConfigError([Problem(path, line, "This line is not text.", "Save it as UTF-8.")]) from None


def _not_yaml(path: Path, text: str, error: yaml.MarkedYAMLError) -> ConfigError:
    """The three most common mistakes in plain words; all others in those of the YAML library."""
    mark, start = error.problem_mark or error.context_mark, error.context_mark
    line = mark.line + 1 if mark else 1
    why = error.problem or "it breaks off"
    if "'\\t'" in why:
        return _refused(path, line, "this line has a tab", "Put spaces in its place.")
    first = start.line + 1 if start else line
    above = max(first - 1, 1)  # a line that breaks off is noticed on the next one
    for number, written in enumerate(text.splitlines()[above - 1 : line], start=above):
        if _BARE_COLOUR.search(written):
            cure = "Write colours in quotes, like '#f2e6d8'."
            return _refused(path, number, "text after a bare # is a comment", cure)
    if error.context in ("while parsing a flow mapping", "while parsing a flow sequence"):
        bracket = "{" if "mapping" in error.context else "["
        cure = "Close it where it ends, and put commas between its parts and a colon behind each key."
        until = f", up to line {line}" if line > first else ""
        return _refused(path, first, f"something is wrong behind the '{bracket}' on this line{until}", cure)
    return _refused(path, line, why)


def _refused(path: Path, line: int, why: str, cure: str = "") -> ConfigError:
    cure = cure or "Check indentation, colons and brackets on this line and the one above."
    return ConfigError([Problem(path, line, f"This is not YAML: {why}.", cure)])


class _Plain:
    """Turns the node tree into dicts, lists and scalars, noting lines on the way."""

    def __init__(self, file: YamlFile, problems: list[Problem]) -> None:
        self._file, self._problems = file, problems
        self._scalars = yaml.constructor.SafeConstructor()
        self._seen: set[int] = set()

    def value(self, node: yaml.Node, location: Location) -> Any:
        self._file.lines.setdefault(location, node.start_mark.line + 1)
        if id(node) in self._seen:  # an alias stands for the anchored node itself, however often
            self._problem(node, "Anchors and aliases (& and *) are not used here.", "Write the value again.")
            return None
        self._seen.add(id(node))
        if node.tag not in _TAGS | {_TIMESTAMP}:
            self._problem(node, f"Tags like {node.tag} are not used here.", "Remove what starts with '!'.")
            return None
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, location)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, (*location, place)) for place, item in enumerate(node.value)]
        return self._scalar(node)

    def _mapping(self, node: yaml.MappingNode, location: Location) -> dict[Hashable, Any]:
        values: dict[Hashable, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                self._problem(key_node, "A key is a single word.", "Put it on a separate line.")
                continue
            key: str = key_node.value
            if key in values:
                first = self._file.line((*location, key))
                self._problem(
                    key_node,
                    f"The key '{shortened(key)}' is here twice (first on line {first}).",
                    "Remove one.",
                )
                continue
            self._file.lines[(*location, key)] = key_node.start_mark.line + 1
            values[key] = self.value(value_node, (*location, key))
        return values

    def _scalar(self, node: yaml.Node) -> Any:
        if node.tag == _TIMESTAMP:
            return node.value
        try:
            value = self._scalars.construct_object(node)
            if not isinstance(value, int) or abs(value) < _LARGEST_NUMBER:
                return value
        except (yaml.YAMLError, ValueError, OverflowError):
            pass
        self._problem(
            node, f"'{shortened(node.value)}' cannot be read.", "Write a number, a word or 'quoted text'."
        )
        return None

    def _problem(self, node: yaml.Node, message: str, cure: str) -> None:
        self._problems.append(Problem(self._file.path, node.start_mark.line + 1, message, cure))
