"""Order dispatch: sends orders to stage, projector and lights, and reports what came of each."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import get_args

from appliance.box.orders import Answer, Order, OrderSender
from appliance.levers.addresses import Receiver

PATIENCE_S = 0.5  # after which an order is not carried out any more
ANSWER_S = 0.1  # within which an order carried out at the last moment is answered
LATE_S = 10.0  # within which a late answer still corrects that an order was reported as not done
WAITING = 64  # orders that may wait for a place; then the oldest gives way
AT_ONCE, EVERY_S = 4, 0.02  # four orders a tick at most: a flood cannot touch the tick

Then = Callable[[bool, str], None]  # gets whether an order was done, and a sentence

_SILENT = {
    "stage": "The stage does not answer, and nothing is changed. If it hangs, it restarts by itself "
    "or with: bunraku play.",
    "projector": "The projector does not answer, and nothing is changed.",
    "lights": "The lights do not answer, and nothing is changed.",
    "generator": "The generator does not answer, and nothing is changed.",
}
_ABSENT = {
    "stage": "No stage dances on this box: nothing is changed. Start it: bunraku play.",
    "projector": "No projector runs on this box: nothing is changed. Start it: bunraku project.",
    "lights": "No lights run on this box: nothing is changed. Start them: bunraku lights.",
    "generator": "No generator runs on this box: nothing is changed. Start it: bunraku generate.",
}
_TOO_MANY = "Too many commands came at once: this one gave way, and nothing is changed."


@dataclass(slots=True)
class _Dispatched:
    place: Receiver
    order: Order
    then: Then


@dataclass(slots=True)
class _Way:
    """To one place: what waits, and how much may still be sent until when."""

    waiting: deque[_Dispatched] = field(default_factory=deque)
    left: int = AT_ONCE
    fills_at: float = 0.0  # monotonic seconds

    def remove_late(self, now: float) -> list[_Dispatched]:
        """Orders that have waited for longer than their sender does."""
        late = []
        while self.waiting and self.waiting[0].order.until < now:
            late.append(self.waiting.popleft())
        return late


class OrderDispatch:
    """Sends orders at a bounded pace, and reports the result of each once; for quiet ones, only refusals.

    A receiver that was held up in the middle of an order answers too late: if it was done, a second report
    corrects the first.
    """

    def __init__(self, sender: OrderSender) -> None:
        self._sender = sender
        self._ways: dict[Receiver, _Way] = {place: _Way() for place in get_args(Receiver)}
        self._sent: dict[int, _Dispatched] = {}
        self._given_up: dict[int, _Dispatched] = {}
        self._asks = int.from_bytes(os.urandom(6), "little")  # answers to an earlier process are none of ours

    def dispatch_order(self, place: Receiver, order: Order, now: float, then: Then) -> None:
        """Have an order carried out within PATIENCE_S; `then` gets the result, at once or later."""
        self._asks += 1
        waiting = self._ways[place].waiting
        if len(waiting) == WAITING:
            waiting.popleft().then(False, _TOO_MANY)
        waiting.append(_Dispatched(place, replace(order, ask=self._asks, until=now + PATIENCE_S), then))
        self._send(place, now)

    def exchange(self, now: float) -> None:
        """Take answers, send what waits, and end what got no answer."""
        while (answer := self._sender.take()) is not None:
            self._report(answer)
        for place in self._ways:
            self._send(place, now)
        self._give_up(now)

    def due(self, now: float) -> float:
        """Monotonic seconds at which `exchange` has something to do without any answer; infinite: nothing."""
        times = [one.order.until + ANSWER_S for one in self._sent.values()]
        times += [max(way.fills_at, now) for way in self._ways.values() if way.waiting]
        return min(times, default=float("inf"))

    def _report(self, answer: Answer) -> None:
        if (one := self._sent.pop(answer.ask, None)) is not None:
            if not (answer.done and one.order.quiet):
                one.then(answer.done, answer.message)
        elif (late := self._given_up.pop(answer.ask, None)) is not None and answer.done:
            late.then(True, answer.message)

    def _send(self, place: Receiver, now: float) -> None:
        way = self._ways[place]
        if now >= way.fills_at:
            way.left, way.fills_at = AT_ONCE, now + EVERY_S
        while way.left and way.waiting:
            one = way.waiting[0]
            delivery = self._sender.send(place, one.order)
            if delivery == "full":
                way.left = 0
                return
            way.waiting.popleft()
            way.left -= 1
            if delivery == "sent":
                self._sent[one.order.ask] = one
            else:
                one.then(False, _ABSENT[place])

    def _give_up(self, now: float) -> None:
        """End what is older than its sender waits for."""
        for way in self._ways.values():
            for one in way.remove_late(now):
                one.then(False, _SILENT[one.place])
        for ask in [ask for ask, one in self._sent.items() if one.order.until + ANSWER_S < now]:
            one = self._given_up[ask] = self._sent.pop(ask)
            one.then(False, _SILENT[one.place])
        for ask in [ask for ask, one in self._given_up.items() if one.order.until + LATE_S < now]:
            del self._given_up[ask]
