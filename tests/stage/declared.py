"""A show state that tests declare, and the dance that follows it."""

from __future__ import annotations

from collections.abc import Callable

from appliance.levers.show_state import ShowState
from appliance.stage.carry_out import obey
from appliance.stage.reconcile import Reconciler
from appliance.stage.stage_parts import StageParts
from tests.stage.shows import NOW

Commanded = Callable[..., str]


class Declared:
    """The show state as a test declares it."""

    def __init__(self) -> None:
        self.now = ShowState(show="A test")

    def read(self) -> ShowState:
        return self.now


def follow(reconciler: Reconciler, now: float = NOW) -> str:
    """Let the dance follow what is declared; gives what it says about it."""
    orders = reconciler.pending(now)
    return " ".join(filter(None, (obey(one, reconciler.parts)[1] for one in orders)))


def enabled(parts: StageParts) -> dict[str, bool]:
    return {puppeteer.joint: puppeteer.enabled for puppeteer in parts.led.hands.puppeteers}
