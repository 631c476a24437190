"""Standstill: the phrase stands while the show is stopped and dark, also when the stage was started anew."""

from __future__ import annotations

from appliance.box.show_state import ShowState
from appliance.show_control.order_dispatch import OrderDispatch
from appliance.show_control.orders import Order
from appliance.show_control.stage_observer import StageObserver

_AGAIN_S = 1.0  # when the stage did not answer


class Standstill:
    """Orders the stage to stop and to start, until it has done so."""

    def __init__(self, sight: StageObserver, errands: OrderDispatch) -> None:
        self._sight, self._errands = sight, errands
        self._generation = -1
        self._stands: bool | None = False  # by our order; None: one was given, and nobody has answered yet
        self._next_try = 0.0

    def go(self, show_state: ShowState, now: float) -> None:
        """The show is about to go on: the stage is asked first, if it may stand."""
        if self._stands is not False or not show_state.going or self._sight.state(now) == "stopped":
            self._order("start", now)

    def look(self, show_state: ShowState, now: float) -> None:
        """See to it; call it often."""
        if self._sight.generation != self._generation and (told := self._sight.health()):
            self._generation, self._next_try = self._sight.generation, now
            if told.get("state") != "stopped":  # else it goes on as it was: standing
                self._stands = False
        if now < self._next_try:
            return
        if show_state.going and self._stands is not False:
            self._order("start", now)
        elif not show_state.going and not self._stands and show_state.going_level(now) <= 0.0:
            self._order("stop", now)

    def leave(self) -> None:
        """Somebody plays and stops the phrase by hand: an order that nobody has answered is not repeated."""
        if self._stands is None:
            self._stands = False

    def _order(self, name: str, now: float) -> None:
        self._next_try = now + _AGAIN_S
        self._stands = None

        def then(done: bool, words: str) -> None:
            if done:
                self._stands = name == "stop"

        self._errands.begin("stage", Order(name), now, then, first=True)
