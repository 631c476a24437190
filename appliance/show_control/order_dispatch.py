"""OrderDispatch: orders on their way to stage, projector and lights, and who waits for what came of them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import get_args

from appliance.show_control.orders import Answer, Order, OrderSender, Place

PATIENCE_S = 0.5  # as long an order may wait to be carried out
ANSWER_S = 0.1  # what was carried out at the last moment is answered within this
LATE_S = 10.0  # as long it may still turn out that what was told as not done was carried out
WAITING = 64  # orders that may wait for a place; then the oldest gives way
AT_ONCE, EVERY_S = 4, 0.02  # four orders a tick at most: a flood cannot touch the tick

Then = Callable[[bool, str], None]  # what to do when it is known whether it was done, and in what words

_SILENT = {
    "stage": "The stage does not answer, and nothing is changed. If it hangs, it is started anew by itself "
    "or with: bunraku play.",
    "projector": "The projector does not answer, and nothing is changed.",
    "lights": "The lights do not answer, and nothing is changed.",
}
_ABSENT = {
    "stage": "No stage dances on this box: nothing is changed. Start it: bunraku play.",
    "projector": "No projector runs on this box: nothing is changed. Start it: bunraku project.",
    "lights": "No lights run on this box: nothing is changed. Start them: bunraku lights.",
}
_TOO_MANY = "Too many commands came at once: this one gave way, and nothing is changed."


@dataclass(slots=True)
class _Errand:
    place: Place
    order: Order
    then: Then


@dataclass(slots=True)
class _Way:
    """To one place: what waits, what goes before it, and how much may still be sent until when."""

    first: _Errand | None = None
    waiting: deque[_Errand] = field(default_factory=deque)
    left: int = AT_ONCE
    fills_at: float = 0.0  # monotonic seconds

    def next(self) -> _Errand | None:
        """What is sent next; it stays until it is removed."""
        return self.first or (self.waiting[0] if self.waiting else None)

    def remove_next(self) -> None:
        """It went, or nobody waits for it any more."""
        if self.first:
            self.first = None
        else:
            self.waiting.popleft()

    def remove_late(self, now: float) -> list[_Errand]:
        """What is older than anyone waits for."""
        late = [self.first] if self.first and self.first.order.until < now else []
        self.first = None if late else self.first
        while self.waiting and self.waiting[0].order.until < now:
            late.append(self.waiting.popleft())
        return late


class OrderDispatch:
    """Sends orders at a bounded pace, and tells what came of each once; of quiet ones, refusals alone.

    Who was held up in the middle of an order answers too late: that it was done then corrects what was told.
    """

    def __init__(self, sender: OrderSender) -> None:
        self._sender = sender
        self._ways: dict[Place, _Way] = {place: _Way() for place in get_args(Place)}
        self._sent: dict[int, _Errand] = {}
        self._given_up: dict[int, _Errand] = {}
        self._asks = int.from_bytes(os.urandom(6), "little")  # answers to an earlier process are none of ours

    def begin(self, place: Place, order: Order, now: float, then: Then, first: bool = False) -> None:
        """Have an order carried out within PATIENCE_S; `then` hears of it, later or at once.

        first: before all that wait, in the place of the one that went first until now.
        """
        self._asks += 1
        errand = _Errand(place, replace(order, ask=self._asks, until=now + PATIENCE_S), then)
        way = self._ways[place]
        if first:
            given_way, way.first = way.first, errand
        else:
            given_way = way.waiting.popleft() if len(way.waiting) >= WAITING else None
            way.waiting.append(errand)
        if given_way is not None:
            given_way.then(False, _TOO_MANY)
        self._send(place, now)

    def go_on(self, now: float) -> None:
        """Take answers, send what waits, and end what nobody answered."""
        while (answer := self._sender.take()) is not None:
            self._hear(answer)
        for place in self._ways:
            self._send(place, now)
        self._give_up(now)

    def due(self, now: float) -> float:
        """Monotonic seconds at which go_on has something to do without any answer; infinite: nothing."""
        times = [errand.order.until + ANSWER_S for errand in self._sent.values()]
        times += [max(way.fills_at, now) for way in self._ways.values() if way.next()]
        return min(times, default=float("inf"))

    def _hear(self, answer: Answer) -> None:
        if (errand := self._sent.pop(answer.ask, None)) is not None:
            if not (answer.done and errand.order.quiet):
                errand.then(answer.done, answer.words)
        elif (late := self._given_up.pop(answer.ask, None)) is not None and answer.done:
            late.then(True, answer.words)

    def _send(self, place: Place, now: float) -> None:
        way = self._ways[place]
        if now >= way.fills_at:
            way.left, way.fills_at = AT_ONCE, now + EVERY_S
        while way.left and (errand := way.next()):
            delivery = self._sender.send(place, errand.order)
            if delivery == "full":
                way.left = 0
                return
            way.remove_next()
            way.left -= 1
            if delivery == "sent":
                self._sent[errand.order.ask] = errand
            else:
                errand.then(False, _ABSENT[place])

    def _give_up(self, now: float) -> None:
        """End what is older than anyone waits for."""
        for way in self._ways.values():
            for errand in way.remove_late(now):
                errand.then(False, _SILENT[errand.place])
        for ask in [ask for ask, errand in self._sent.items() if errand.order.until + ANSWER_S < now]:
            errand = self._given_up[ask] = self._sent.pop(ask)
            errand.then(False, _SILENT[errand.place])
        for ask in [ask for ask, errand in self._given_up.items() if errand.order.until + LATE_S < now]:
            del self._given_up[ask]
