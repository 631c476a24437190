"""The key file: the sensors of a box and the secret that each signs with."""

from __future__ import annotations

import json
import os
import secrets
import stat
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

import yaml

from appliance.pose.foreign_file import content
from appliance.pose.foreign_yaml import composed
from appliance.sensor.sensor_key import SensorKey as SensorKey
from appliance.sensor.wire import KEY_BYTES

HEADER = "# Sensors of this box and their secret keys. With this file anyone can move the puppet.\n"
LARGEST_FILE = 64 * 1024
LONGEST_NAME = 24  # shorter than a key, so that a misplaced key is never shown as a name
ENTRY = "one entry looks like: 'left-wrist: {device: 0x1a2b3c4d, key: 32 hexadecimal digits}'"


class KeyFileError(ValueError):
    """An unusable key file: which line, what is wrong, what to do. Never contains a key."""

    def __init__(self, path: Path, line: int | None, message: str) -> None:
        super().__init__(f"{path}: {message}" if line is None else f"{path}:{line}: {message}")
        self.path = path
        self.line = line
        self.message = message


def load_keys(path: Path) -> dict[str, SensorKey]:
    """The sensors of a key file by name. Raises KeyFileError with the line, OSError when there is no file."""
    return parse_keys(path, read_text(path))


def read_text(path: Path) -> str:
    """A key file's text. Raises KeyFileError for anything else, OSError when there is no file."""
    if path.stat().st_size > LARGEST_FILE:
        raise KeyFileError(path, 1, f"is larger than {LARGEST_FILE // 1024} KiB, so it is no key file")
    try:
        return content(path, LARGEST_FILE).decode()
    except UnicodeDecodeError:
        raise KeyFileError(path, 1, "is not a text file in UTF-8, so it is no key file") from None


def parse_keys(path: Path, text: str) -> dict[str, SensorKey]:
    """The sensors in the text of the key file `path`, by name. Raises KeyFileError with the line."""
    try:
        root = composed(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        # The parser's own message may quote the file, and so a key: only its place is passed on.
        raise KeyFileError(path, mark.line + 1 if mark else 1, f"is not valid YAML here; {ENTRY}") from None
    except (yaml.YAMLError, RecursionError):
        raise KeyFileError(path, 1, f"is not valid YAML; {ENTRY}") from None
    if root is None:
        return {}
    if not isinstance(root, yaml.MappingNode):
        raise KeyFileError(path, 1, f"should hold one entry a sensor; {ENTRY}")
    keys: dict[str, SensorKey] = {}
    for name_node, entry_node in root.value:
        sensor = _sensor(path, name_node, entry_node)
        if sensor.name in keys:
            raise KeyFileError(
                path, _line(name_node), f"sensor {sensor.name!r} is here twice; remove one entry"
            )
        for other in keys.values():
            if other.device_id == sensor.device_id:
                raise KeyFileError(
                    path,
                    _line(entry_node),
                    f"sensors {other.name!r} and {sensor.name!r} have the same device id; each needs its own",
                )
        keys[sensor.name] = sensor
    return keys


def create_keys(path: Path, names: Iterable[str]) -> dict[str, SensorKey]:
    """Write a new key file with a random key for each name, readable only by its owner.

    Raises FileExistsError rather than replace a file: provisioned sensors hold its keys.
    """
    keys: dict[str, SensorKey] = {}
    for name in names:
        keys[name] = fresh_key(name, keys.values())
    text = HEADER + "".join(entry(sensor) for sensor in keys.values())
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    return keys


def fresh_key(name: str, others: Iterable[SensorKey]) -> SensorKey:
    """A sensor with a new random key and an unused device id."""
    taken = {0, *(other.device_id for other in others)}
    device_id = 0
    while device_id in taken:
        device_id = secrets.randbits(32)
    return SensorKey(name, device_id, secrets.token_bytes(KEY_BYTES))


def entry(sensor: SensorKey) -> str:
    """The line of one sensor in a key file."""
    return f"{json.dumps(sensor.name)}: {{device: 0x{sensor.device_id:08x}, key: {sensor.key.hex()}}}\n"


def name_fault(name: str) -> str | None:
    """The fault in a new sensor's name, as a clause; None when box and sensor accept it."""
    if not 0 < len(name) <= LONGEST_NAME or not all("!" <= letter <= "~" for letter in name):
        return (
            f"a sensor's name has 1 to {LONGEST_NAME} letters, digits or punctuation, "
            "without spaces or accents, for instance left-wrist"
        )
    return None


def exposure(path: Path) -> str | None:
    """A warning when others on this machine can read the key file, else None."""
    if path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        return f"{path} can be read by other users, who could then move the puppet. Run: chmod 600 {path}"
    return None


def unknown_sensor(name: str, keys: dict[str, SensorKey]) -> str:
    """The message for a sensor name that the key file does not have."""
    known = ", ".join(sorted(keys)) or "none"
    nearest = get_close_matches(name, keys, n=1)
    meant = f" Did you mean {nearest[0]!r}?" if nearest else ""
    return f"there is no sensor {name!r} in the key file.{meant} It has: {known}"


def _sensor(path: Path, name_node: yaml.Node, entry_node: yaml.Node) -> SensorKey:
    name = _text(path, name_node, "the sensor's name")
    if len(name) > LONGEST_NAME:
        raise KeyFileError(
            path, _line(name_node), f"a sensor's name has at most {LONGEST_NAME} letters; {ENTRY}"
        )
    if not name.isprintable():
        raise KeyFileError(
            path, _line(name_node), "a sensor's name has no control characters: choose one that can be read"
        )
    if not isinstance(entry_node, yaml.MappingNode):
        raise KeyFileError(path, _line(entry_node), f"sensor {name!r} needs a device id and a key; {ENTRY}")
    values: dict[str, tuple[int, str]] = {}
    for field_node, value_node in entry_node.value:
        field_name = _text(path, field_node, "a field's name")
        if field_name not in ("device", "key"):
            shown = f" {field_name!r}" if len(field_name) < 12 else ""  # it might be a misplaced key
            raise KeyFileError(
                path, _line(field_node), f"sensor {name!r} has an unknown field{shown}; {ENTRY}"
            )
        values[field_name] = (_line(value_node), _text(path, value_node, f"the {field_name} of {name!r}"))
    for required in ("device", "key"):
        if required not in values:
            raise KeyFileError(path, _line(entry_node), f"sensor {name!r} has no {required}; {ENTRY}")
    return SensorKey(name, _device_id(path, name, *values["device"]), _key(path, name, *values["key"]))


def _device_id(path: Path, name: str, line: int, text: str) -> int:
    try:
        device_id = int(text, 0)
    except ValueError:
        device_id = 0
    if not 0 < device_id < 1 << 32:
        raise KeyFileError(path, line, f"the device id of {name!r} should be a number from 1 to 0xffffffff")
    return device_id


def _key(path: Path, name: str, line: int, text: str) -> bytes:
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    if len(key) != KEY_BYTES:
        raise KeyFileError(path, line, f"the key of {name!r} should be {2 * KEY_BYTES} hexadecimal digits")
    return key


def _text(path: Path, node: yaml.Node, what: str) -> str:
    if not isinstance(node, yaml.ScalarNode) or not node.value:
        raise KeyFileError(path, _line(node), f"{what} should be plain text; {ENTRY}")
    return str(node.value)


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1
