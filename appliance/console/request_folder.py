"""The folder in which the page and another process meet: what the page asks for, until that is done."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from appliance.box.durable import private_folder, write_whole
from appliance.pose.foreign_file import stored_json


class Wish(Protocol):
    """A request: a NamedTuple."""

    def _asdict(self) -> dict[str, Any]: ...


Asked = TypeVar("Asked", bound=Wish)


class RequestFolder(ABC, Generic[Asked]):
    """The request is a file: it is there while something is wanted, and its removal ends that."""

    def __init__(self, folder: Path, request: str) -> None:
        self.folder, self._request = folder, folder / request

    def want(self, wanted: Asked) -> None:
        """Write the request. Raises OSError."""
        private_folder(self.folder)
        write_whole(self._request, json.dumps(wanted._asdict()).encode())

    def wanted(self) -> Asked | None:
        """The current request; None: nothing, or nothing that can be read."""
        try:
            return self._sound(stored_json(self._request))
        except (OSError, ValueError, TypeError, KeyError, AttributeError):
            return None

    def end(self) -> None:
        """Nothing is wanted any more; what was made so far stays."""
        with suppress(OSError):
            self._request.unlink(missing_ok=True)

    @abstractmethod
    def _sound(self, said: Any) -> Asked | None:
        """The request as it was read; None, or an error that `wanted` catches, for anything else."""
