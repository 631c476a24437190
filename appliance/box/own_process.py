"""A process beside the stage: its place in the runtime folder, its log, its signs of life."""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Protocol, TypeVar

from appliance.box.fallback import Fallback, Fallbacks
from appliance.box.log import process_log
from appliance.box.notify import Notifier
from appliance.box.process_health import ProcessHealthWriter
from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.box.stop_signals import stop_signals

if TYPE_CHECKING:
    from appliance.show.box import BoxConfig


class _Closable(Protocol):
    def close(self) -> None: ...


_Part = TypeVar("_Part", bound=_Closable)


class OwnProcess:
    """A context from start to end; an end by an error counts as a death. Raises RuntimeFolderError.

    stopped: whether a signal asked for the end. Its log goes to standard output, and never waits for it.
    """

    def __init__(self, box: BoxConfig, name: str, known: Iterable[Fallback]) -> None:
        """name: as in PROCESSES; known: the fallbacks that it may report."""
        with ExitStack() as opened:
            self.stopped = opened.enter_context(stop_signals())
            opened.enter_context(process_log())
            self.folder = runtime_folder(box)
            opened.enter_context(closing(Claim(self.folder, name)))
            self.notifier = opened.enter_context(closing(Notifier()))
            self.fallbacks = Fallbacks(known)
            self.health = ProcessHealthWriter(self.folder, name, self.fallbacks)
            opened.callback(self.health.close)
            self.opened = opened.pop_all()

    def keep(self, part: _Part) -> _Part:
        """The part, which is closed at the end."""
        return self.opened.enter_context(closing(part))

    def pulse(self, now: float) -> None:
        """Call it often; monotonic seconds."""
        self.notifier.ping(now)
        self.health.publish_health(now)

    def __enter__(self) -> OwnProcess:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        with self.opened:
            if kind is None:
                self.health.end(time.monotonic())
