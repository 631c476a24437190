"""YAML that others wrote: read no deeper than anybody writes it, and no alias stands for a copy of a copy."""

from __future__ import annotations

from typing import Any

import yaml

DEEPEST = 32


class TooDeepError(yaml.YAMLError):
    """Nested deeper than any file of ours; the library would take seconds for it, and then give up."""

    def __str__(self) -> str:
        return "it is nested too deeply"


class _ShallowLoader(yaml.SafeLoader):
    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self._depth += 1
        if self._depth > DEEPEST:
            raise TooDeepError
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


class _PlainLoader(_ShallowLoader):
    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):  # a few of them can stand for more than any memory holds
            raise yaml.YAMLError("an alias")
        return super().compose_node(parent, index)


def is_shallow(value: object, deepest: int = DEEPEST) -> bool:
    """Whether lists and dicts in each other can be written in a file that is read again."""
    if not isinstance(value, list | dict):
        return True
    parts = value.values() if isinstance(value, dict) else value
    return deepest > 1 and all(is_shallow(part, deepest - 1) for part in parts)


def composed(text: str) -> yaml.Node | None:
    """The node tree of one document, with its marks. Raises yaml.YAMLError."""
    return yaml.compose(text, Loader=_ShallowLoader)


def plain_values(text: str) -> Any:
    """The values of one document without aliases. Raises yaml.YAMLError, ValueError."""
    return yaml.load(text, Loader=_PlainLoader)
