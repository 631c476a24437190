"""Acknowledgements: replies to declarations for the dance, sent once the stage reports that it follows."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from appliance.show_control import order_dispatch
from appliance.show_control.stage_observer import StageObserver

EVERY_S = 0.005  # how often the report is read while a client waits for it

_SILENT = (
    "The stage does not answer. The dance follows as soon as it is back; a stage that hangs is restarted by "
    "itself or with: bunraku play."
)
_ABSENT = "No stage dances on this box now. The dance begins with this when it starts: bunraku play."
_TOO_MANY = "Too many commands came at once: this one gets no answer, and the newest of them is in force."

Reply = Callable[[bool, str], None]  # whether the dance follows, and a sentence


class _Waiting(NamedTuple):
    generation: int
    message: str
    until: float
    reply: Reply


class Acknowledgements:
    """Compares the generation that was declared with the one that the stage reports."""

    def __init__(self, observer: StageObserver) -> None:
        self._observer = observer
        self._waiting: deque[_Waiting] = deque()

    def expect(self, generation: int, message: str, now: float, reply: Reply) -> None:
        """Reply once the stage follows this generation, or after 0.6 s that it does not yet."""
        if not self._observer.lives(now):
            reply(False, _ABSENT)
            return
        if len(self._waiting) == order_dispatch.WAITING:
            self._waiting.popleft().reply(False, _TOO_MANY)
        until = now + order_dispatch.PATIENCE_S + order_dispatch.ANSWER_S
        self._waiting.append(_Waiting(generation, message, until, reply))

    def send_due(self, now: float) -> None:
        """Reply to what the stage follows by now, and to what has waited for too long."""
        if not self._waiting:
            return
        applied, remark = self._observer.applied()
        while self._waiting and self._waiting[0].generation <= applied:
            one = self._waiting.popleft()
            one.reply(True, f"{one.message} {remark if one.generation == applied else ''}".strip())
        while self._waiting and self._waiting[0].until < now:
            self._waiting.popleft().reply(False, _SILENT)

    def due(self, now: float) -> float:
        """Monotonic seconds at which send_due has something to do; infinite: nothing."""
        return now + EVERY_S if self._waiting else float("inf")
