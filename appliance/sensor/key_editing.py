"""Changes to the key file: one writer at a time, comments stay, a power cut leaves a whole file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import yaml

from appliance.box.durable import alone_in, put_in_place, write_beside
from appliance.pose.foreign_yaml import composed
from appliance.sensor.keys import (
    HEADER,
    KeyFileError,
    SensorKey,
    entry,
    name_fault,
    parse_keys,
    read_text,
    unknown_sensor,
)

_PATIENCE_S = 2.0  # another change takes milliseconds, a provisioning as long as its cable


class KeyEditing:
    """One change of a key file in memory; `prepare` and `commit` write it.

    Comments stay beside or above their sensor. Only a file that cannot be edited in place (one line in
    braces, anchors) is rewritten without its comments.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._text = read_text(path) if path.exists() else HEADER
        self.keys: Mapping[str, SensorKey] = parse_keys(path, self._text)
        self._beside: Path | None = None

    def put(self, sensor: SensorKey) -> None:
        """Add a sensor, or replace the one of this name."""
        self._require_good_name(sensor.name)
        if sensor.name in self.keys:
            self._change(
                {name: sensor if name == sensor.name else key for name, key in self.keys.items()},
                lambda text: _replaced(text, sensor),
            )
        else:
            self._change(
                {**self.keys, sensor.name: sensor},
                lambda text: _added(text, sensor),
            )

    def remove(self, name: str) -> None:
        """Remove a sensor. Raises KeyFileError when there is none of this name."""
        self._require(name)
        self._change(
            {other: key for other, key in self.keys.items() if other != name},
            lambda text: _removed(text, name),
        )

    def rename(self, name: str, new: str) -> None:
        """Rename a sensor. Raises KeyFileError when the name is taken or invalid."""
        self._require(name)
        self._require_good_name(new)
        if new in self.keys:
            raise KeyFileError(self.path, None, f"there is a sensor {new!r} already; choose another name")
        self._rename({name: new})

    def swap(self, name: str, other: str) -> None:
        """Swap the names of two sensors. Raises KeyFileError when one of them does not exist."""
        self._require(name)
        self._require(other)
        self._rename({name: other, other: name})

    def prepare(self) -> None:
        """Write the changed file beside the old one, so that errors happen now. Raises OSError."""
        self._beside = write_beside(self.path, self._text.encode(), private=True)

    def commit(self) -> None:
        """Replace the old file with the changed one. Raises OSError."""
        if self._beside is None:
            self.prepare()
        assert self._beside is not None
        put_in_place(self._beside, self.path)
        self._beside = None

    def discard(self) -> None:
        """Remove a prepared file that was not committed."""
        if self._beside is not None:
            self._beside.unlink(missing_ok=True)
            self._beside = None

    def _rename(self, names: Mapping[str, str]) -> None:
        renamed = {
            names.get(name, name): replace(key, name=names.get(name, name)) for name, key in self.keys.items()
        }
        self._change(renamed, lambda text: _renamed(text, names))

    def _change(self, wanted: Mapping[str, SensorKey], edit: Callable[[str], str]) -> None:
        """Take the edited text if it parses as wanted; else rewrite the file."""
        try:
            edited = edit(self._text)
            as_wanted = parse_keys(self.path, edited) == wanted
        except (KeyFileError, yaml.YAMLError):
            as_wanted = False
        self._text = edited if as_wanted else HEADER + "".join(entry(sensor) for sensor in wanted.values())
        self.keys = wanted

    def _require(self, name: str) -> None:
        if name not in self.keys:
            raise KeyFileError(self.path, None, unknown_sensor(name, dict(self.keys)))

    def _require_good_name(self, name: str) -> None:
        fault = name_fault(name)
        if fault:
            raise KeyFileError(self.path, None, fault)


@contextmanager
def editing(path: Path) -> Iterator[KeyEditing]:
    """The key file's content for one writer; changes that are not committed inside are discarded.

    A file that does not exist yet has no sensors. Raises KeyFileError for another writer or a broken file,
    OSError when its folder cannot be written.
    """
    path = path.resolve()  # a link stays one
    with ExitStack() as held:
        try:  # the folder is locked: the file itself is replaced at each change
            held.enter_context(alone_in(path.parent, _PATIENCE_S))
        except BlockingIOError:
            raise KeyFileError(
                path, None, "another bunraku is changing this file; try again when it is done"
            ) from None
        change = KeyEditing(path)
        held.callback(change.discard)
        yield change


class _EntrySpan(NamedTuple):
    """Span of an entry in the text: its name from `begin` to `name_end`, all of it to `end`."""

    begin: int
    name_end: int
    end: int


def _entry_spans(text: str) -> dict[str, _EntrySpan]:
    root = composed(text)
    assert isinstance(root, yaml.MappingNode)  # it was read before, and has sensors
    return {
        name.value: _EntrySpan(name.start_mark.index, name.end_mark.index, _end(value))
        for name, value in root.value
    }


def _end(node: yaml.Node) -> int:
    """The end of a value; the mark of a block comes after the comments that follow it."""
    if isinstance(node, yaml.MappingNode) and not node.flow_style and node.value:
        return _end(node.value[-1][1])
    return int(node.end_mark.index)


def _replaced(text: str, sensor: SensorKey) -> str:
    span = _entry_spans(text)[sensor.name]
    return text[: span.begin] + entry(sensor).rstrip("\n") + text[span.end :]


def _added(text: str, sensor: SensorKey) -> str:
    return text + ("" if text.endswith("\n") or not text else "\n") + entry(sensor)


def _removed(text: str, name: str) -> str:
    """Without the lines of this entry and the comment behind it."""
    span = _entry_spans(text)[name]
    begin, end = text.rfind("\n", 0, span.begin) + 1, text.find("\n", span.end)
    return text[:begin] + (text[end + 1 :] if end >= 0 else "")


def _renamed(text: str, names: Mapping[str, str]) -> str:
    spans = {name: span for name, span in _entry_spans(text).items() if name in names}
    for name, span in sorted(spans.items(), key=lambda item: item[1], reverse=True):
        text = text[: span.begin] + json.dumps(names[name]) + text[span.name_end :]
    return text
