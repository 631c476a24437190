"""Reconciles the dance with the show state that show control has declared, between two ticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from appliance.box.show_state import ShowStateReader
from appliance.show.sources import LIVE
from appliance.show_control.orders import Order
from appliance.stage.carry_out import SPRINGS_ORDERS, obey
from appliance.stage.iterations import Iterations
from appliance.stage.stage_parts import StageParts


class Reconciler:
    """Compares the show state with what the dance does: once a tick, at the price of a small read.

    generation: of the show state that the dance follows. cue: the newest. rate: of playback while the show
    goes. words: what there was to say about the newest change.
    """

    def __init__(self, show: str, parts: StageParts, iterations: Iterations, reader: ShowStateReader) -> None:
        self.parts, self.iterations = parts, iterations
        self.generation, self.cue, self.words = 0, "", ""
        self.rate = self._usual_rate = parts.motion.rate
        self._show, self._reader = show, reader
        self._is_first = parts.springs is not None  # a checkpoint knows nothing of the springs' setting

    def pending(self, now: float) -> Sequence[Order]:
        """Orders that make the dance follow the show state; none in nearly every tick."""
        orders: list[Order] = []
        show_state = self._reader.read()
        is_news = self._is_first or show_state.generation != self.generation
        if is_news and show_state.show == self._show:
            before, self.generation = self.generation, show_state.generation
            self.cue = show_state.cue or self.cue
            for name, (number, text, values) in show_state.dance.items():
                if number > before and name == "rate":
                    self.rate = values[0] if values else self._usual_rate or 1.0
                elif number > before or (self._is_first and name in SPRINGS_ORDERS):
                    orders.append(Order(name.partition(" ")[0], values, text))
            self._is_first = False
        wanted, live = show_state.dance.get("phrase"), self.parts.live
        if wanted and wanted[1] == LIVE and live is not None and not (orders or live.is_chosen):
            orders.append(Order("phrase", wanted[2], LIVE))  # after a restart: checkpoints know phrases only
        rate = 0.0 if show_state.stands(now) else self.rate
        if rate != self.parts.motion.rate:
            orders.append(Order("rate", (rate,)))
        return orders

    def stands(self, now: float) -> bool:
        """Whether the phrase has to stand still, because the show is stopped and dark."""
        return self._reader.read().stands(now)

    def begin(self, now: float) -> str:
        """Before the first tick: begin with what is declared, without fades; a sentence about it, or ""."""
        words: list[str] = []
        for order in self.pending(now):
            if order.name == "phrase" and order.text in self.parts.motion.phrases:
                self.parts.motion.start_with(order.text)
                continue
            if order.name == "iterations":
                order = replace(order, values=order.values[:2])
            words.append(obey(order, self.parts, self.iterations)[1])
        cue = f"The show goes on in the cue '{self.cue}'." if self.cue else ""
        return " ".join(filter(None, (cue, *words)))
