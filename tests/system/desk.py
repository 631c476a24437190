"""A desk at a real box: its show control awaited and asked, and what is in force read."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from appliance.box.show_state import ShowStateReader
from appliance.levers.show_state import ShowState
from tests.show_control.doubles import Asker
from tests.system.box import Box
from tests.system.processes import BUNRAKU, children_running, wait_until

CONTROL = (*BUNRAKU, "control", "--box")


def show_state(box: Box) -> ShowState:
    with contextlib.closing(ShowStateReader(box.runtime)) as reader:
        return reader.read()


@contextlib.contextmanager
def asking(box: Box) -> Iterator[Asker]:
    """A client of show control, once it answers: it starts after the first tick."""
    wait_until(lambda: answers(box.control))
    with contextlib.closing(Asker(box.control)) as asker:
        yield asker


def answers(port: int) -> bool:
    """Whether a ping is answered: a flood may drop one, and before the start the port is closed."""
    with contextlib.closing(Asker(port)) as asker, contextlib.suppress(ConnectionRefusedError):
        asker.tell("/ping")
        return asker.hear(0.5) == ["/pong"]
    return False


def status(asker: Asker) -> dict[str, Any]:
    """The status by name, its level rounded."""
    now = asker.status()
    return now._asdict() | {"level": round(now.level, 3)}


def await_status(asker: Asker, **wanted: Any) -> None:
    """Wait until all of it holds at once: a stage delayed by half a second is reported as hung meanwhile."""
    wait_until(lambda: wanted.items() <= status(asker).items())


def control_of(pid: int) -> int:
    """The process id of a box's show control."""
    [found] = children_running(pid, "appliance.show_control")
    return found
