"""Snapshots: the state that later ticks depend on, as bytes, of objects that name their fields once.

A class names them in SNAPSHOT, after those of its base class. A field is a number, text, None, an array,
an object with a snapshot, or a list, tuple or dictionary of these. Arrays and objects are restored in place.
TIMES names those of the fields that are monotonic seconds.
Where fields do not say enough, a class has `state`, which gives the rest as plain values, and `restore`,
which takes it after the fields. `settle` works out what follows from all of that.
"""

from __future__ import annotations

import json
import struct
from functools import cache
from typing import Any

import numpy as np

_HEAD = struct.Struct("<I")  # bytes of the JSON; the arrays follow it
_ARRAY, _TUPLE, _REST = "\0array", "\0tuple", "\0rest"  # keys that no state has
_PLAIN = frozenset((int, float, str, bool, type(None)))


def packed(one: Any) -> bytes:
    """The state of an object. Raises TypeError for a field that has none."""
    arrays: list[bytes] = []
    encoded = json.dumps(_plain(one, arrays)).encode()
    return b"".join((_HEAD.pack(len(encoded)), encoded, *arrays))


def restore(one: Any, data: bytes) -> None:
    """Restore, in place, the state that `packed` saved. Raises what DAMAGED lists for invalid bytes."""
    _restored(one, unpacked(data))


def shift_times(one: Any, seconds: float) -> None:
    """Shift all monotonic times of an object by the seconds by which its new clock is ahead."""
    kind: Any = type(one)
    for base in kind.__mro__:
        for name in vars(base).get("TIMES", ()):
            if (time := getattr(one, name)) is not None:
                setattr(one, name, time + seconds)
    for name in _fields(kind):
        _shift_field(one, name, seconds)


def _shift_field(one: Any, name: str, seconds: float) -> None:
    field = getattr(one, name)
    if hasattr(field, "shifted"):
        setattr(one, name, field.shifted(seconds))
        return
    parts = field.values() if type(field) is dict else field if type(field) in (list, tuple) else (field,)
    for part in parts:
        if _has_state(type(part)):
            shift_times(part, seconds)


def _plain(value: Any, arrays: list[bytes]) -> Any:
    kind: Any = type(value)
    if kind in _PLAIN:
        return value
    if kind is np.ndarray:
        arrays.append(value.tobytes())
        return {_ARRAY: [_form(value.dtype), value.shape]}
    if kind is list:
        return [each if type(each) in _PLAIN else _plain(each, arrays) for each in value]
    if kind is tuple:
        return {_TUPLE: [each if type(each) in _PLAIN else _plain(each, arrays) for each in value]}
    if kind is dict:
        return {name: _plain(each, arrays) for name, each in value.items()}
    if _has_state(kind):
        state = {name: _plain(getattr(value, name), arrays) for name in _fields(kind)}
        return state | {_REST: _plain(value.state(), arrays)} if hasattr(kind, "state") else state
    if isinstance(value, tuple):  # a named one
        return _plain(tuple(value), arrays)
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"A snapshot cannot hold a {kind.__name__}")


def unpacked(data: bytes) -> Any:
    """The plain values and arrays of a state. Raises as `restore` does."""
    (length,) = _HEAD.unpack_from(data)
    at = _HEAD.size + length

    def whole(found: dict[str, Any]) -> Any:
        nonlocal at
        if _TUPLE in found:
            return tuple(found[_TUPLE])
        if _ARRAY not in found:
            return found
        form, shape = found[_ARRAY]
        array = np.frombuffer(data, form, int(np.prod(shape)), at).reshape(shape)
        at += array.nbytes
        return array

    return json.loads(data[_HEAD.size : at], object_hook=whole)


def _restored(now: Any, value: Any) -> Any:
    """The value to set where `now` stands; `now` itself where it was restored in place."""
    kind: Any = type(now)
    if kind is np.ndarray:
        now[...] = value
    elif _has_state(kind):
        for name in _fields(kind):
            field = getattr(now, name)
            if (new := _restored(field, value[name])) is not field:
                setattr(now, name, new)
        if hasattr(kind, "state"):
            now.restore(value[_REST])
        if hasattr(kind, "settle"):
            now.settle()
    elif kind in (list, tuple) and now and _has_state(type(now[0])):
        for one, state in zip(now, value, strict=True):
            _restored(one, state)
    elif kind is dict and any(_has_state(type(one)) for one in now.values()):
        for name, one in now.items():
            _restored(one, value[name])
    else:
        return value
    return now


def _has_state(kind: Any) -> bool:
    return bool(_fields(kind)) or hasattr(kind, "state")


@cache
def _fields(kind: type) -> tuple[str, ...]:
    named = (vars(one).get("SNAPSHOT", ()) for one in reversed(kind.__mro__))
    return tuple(name for names in named for name in names)


@cache
def _form(kind: np.dtype[Any]) -> str:
    return kind.str  # numpy works it out anew each time: more than a microsecond
