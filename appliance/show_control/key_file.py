"""The sensors' key file: show control reads it on request, and only after it has changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from appliance.sensor.keys import SensorKey


class KeyFile:
    """Keys of the sensors that the box admits; the stage itself never reads a file."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self._read: tuple[object, Mapping[str, SensorKey] | str] | None = None

    def keys(self) -> Mapping[str, SensorKey]:
        """The keys in it. Raises ValueError with a sentence for people."""
        stamp = self._stamp()
        if self._read is None or self._read[0] != stamp:
            try:
                self._read = stamp, self._load()
            except ValueError as error:
                self._read = stamp, str(error)
        found = self._read[1]
        if isinstance(found, str):
            raise ValueError(found)
        return found

    def _stamp(self) -> object:
        """A value that changes with the file; None when nothing is there."""
        try:
            status = self.path.stat() if self.path is not None else None
        except OSError:
            return None
        return status and (status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)

    def _load(self) -> Mapping[str, SensorKey]:
        from appliance.sensor.keys import KeyFileError, load_keys  # reads YAML: not needed on most nights

        if self.path is None:
            raise ValueError("This box has no key file: name one under sensors.keys in its box file.")
        goes_on = "The box goes on with the keys that it has."
        try:
            return load_keys(self.path)
        except KeyFileError as error:
            raise ValueError(f"{error}. {goes_on}") from None
        except OSError as error:
            raise ValueError(f"{self.path} cannot be read ({error.strerror}). {goes_on}") from None
