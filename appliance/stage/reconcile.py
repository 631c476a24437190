"""Reconciles the dance with the show state that show control has declared, between two ticks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from appliance.box.orders import Order
from appliance.box.show_state import ShowStateReader
from appliance.dancer.material.material_file import Material
from appliance.levers.fade import Fade
from appliance.levers.lever import AT_ONCE, Lever, at_once
from appliance.levers.show_state import ShowState
from appliance.levers.sources import LIVE, MAIN
from appliance.levers.table import CONTINUING, PHRASE, RATE, SPRINGS, find_lever
from appliance.stage.carry_out import obey
from appliance.stage.made_motions import MELT_S, MadeMotions
from appliance.stage.stage_parts import StageParts

# what a checkpoint knows nothing of
_FROM_STATE = frozenset((SPRINGS.name, *SPRINGS.ends, *(one.name for one in CONTINUING)))
GATE_S = 1.0  # in which strings drive the joints again after panic, blackout and stop


class Reconciler:
    """Compares the show state with what the dance does: once a tick, at the price of a small read.

    generation: of the show state that the dance follows. cue: the newest. rate: of playback while the show
    goes. message: what there was to say about the newest change. source: what the show starts from while
    nothing is declared; wanted: what is to take the phrase's place now, "" for none. motion: names and values
    of what was declared for the generator, also before a power cut.
    """

    def __init__(
        self,
        show: str,
        parts: StageParts,
        reader: ShowStateReader,
        made: Sequence[MadeMotions] = (),
        source: str = MAIN,
    ) -> None:
        """made: what the generator makes for each puppet, in a show that has sources of it. source: it starts
        from that.
        """
        self.parts = parts
        self.generation, self.cue, self.message = 0, "", ""
        self.rate = self._usual_rate = parts.rate
        self._show, self._reader = show, reader
        self._is_first = parts.led.springs is not None or parts.continuing is not None
        self._strings_pull = True
        self._made, self.source, self.wanted = made, source, ""
        self.motion: tuple[tuple[str, tuple[float, ...]], ...] = ()
        self._seen: ShowState | None = None
        self._strings_may_pull = self._is_going = True
        self._declared: Fade[str] | None = None

    def pending(self, now: float) -> Sequence[Order]:
        """Orders that make the dance follow the show state; none in nearly every tick."""
        orders: list[Order] = []
        show_state = self._reader.read()
        if show_state is not self._seen:
            self._see(show_state)
        has_news = self._is_first or show_state.generation != self.generation
        if has_news and show_state.show == self._show:
            before, self.generation = self.generation, show_state.generation
            self.cue = show_state.cue or self.cue
            for name, fade in show_state.settings.items():
                if (one := find_lever(name)) is None:
                    continue
                is_news = fade.generation > before
                if one is RATE and is_news:
                    self.rate = self._usual_rate or 1.0 if fade.value is None else fade.value
                elif one.follower == "generator":
                    self.motion = tuple({**dict(self.motion), name: one.formatted(fade)[1]}.items())
                elif one.follower != "stage" or (one is PHRASE and self._is_made(fade.value)):
                    continue  # others follow it
                elif is_news:
                    orders.append(order_of(one, fade))
                elif self._is_first and name in _FROM_STATE:  # it was in force
                    orders.append(order_of(one, at_once(fade)))
            self._is_first = False
        if self._strings_may_pull != self._strings_pull:
            self._strings_pull = self._strings_may_pull
            if self.parts.springs:
                fade_s = GATE_S if self._strings_pull else 0.0
                orders.append(Order("gate", (float(self._strings_pull), fade_s)))
        live, declared = self.parts.led.live, self._declared
        wanted = declared.value if declared else self.source
        melt_s = declared.seconds if declared else MELT_S
        self.wanted = "" if wanted in self.parts.phrases else wanted
        if wanted == LIVE and live is not None and not (orders or live.is_chosen):
            # After a restart: checkpoints know phrases only.
            orders.append(order_of(PHRASE, declared) if declared else Order(PHRASE.name, (), LIVE))
        for puppet, made in zip(self.parts.puppets, self._made, strict=False):
            source, fade_s = made.source, MELT_S
            if puppet is self.parts.led:
                source, fade_s = wanted if self._is_made(wanted) else "", melt_s
            if (order := made.order(source, fade_s, now)) is not None:
                orders.append(order)
        rate = self.rate if self._is_going or not show_state.stands(now) else 0.0
        if rate != self.parts.rate:
            orders.append(Order("rate", (rate,)))
        return orders

    @property
    def declared(self) -> ShowState:
        """The newest show state, the same object until it changes."""
        return self._reader.read()

    def go_on_after(self, generation: int, now: float) -> None:
        """Another box has led the same dance, and had followed this generation of the same show state."""
        self.generation, self._is_first = 0, False
        self.pending(now)  # cue, rate and source as declared; its orders were carried out there
        self.generation = generation

    def _see(self, show_state: ShowState) -> None:
        """Another show state: what each tick asks of it."""
        self._seen, self._is_going = show_state, show_state.going
        self._strings_may_pull = self._is_going and not (show_state.panic or show_state.blackout)
        is_declared = show_state.show == self._show and PHRASE in show_state
        self._declared = show_state[PHRASE] if is_declared else None

    def _is_made(self, name: str) -> bool:
        """Whether the generator makes it: a source, or a motion that was kept."""
        return bool(self._made) and name != LIVE and name not in self.parts.phrases

    def danced_before(self, *numbers: int) -> list[Material | None]:
        """The motions that the puppets danced before a restart, by number; None: a phrase, or it is not there
        any more.
        """
        if not self._made:
            return [None] * len(numbers)
        known = zip(self._made, numbers, strict=False)
        return [made.danced_before(number) if number else None for made, number in known]

    def stands(self, now: float) -> bool:
        """Whether the phrase has to stand still, because the show is stopped and dark."""
        return self._reader.read().stands(now)

    def begin(self, now: float) -> str:
        """Before the first tick: begin with what is declared, without fades; a sentence about it, or ""."""
        messages: list[str] = []
        for order in self.pending(now):
            if order.name == "phrase" and order.text in self.parts.phrases:
                self.parts.led.motion.start_with(order.text)
                continue
            messages.append(obey(without_fade(order), self.parts)[1])
        cue = f"The show goes on in the cue '{self.cue}'." if self.cue else ""
        return " ".join(filter(None, (cue, *messages)))


def order_of(lever: Lever[Any], fade: Fade[Any]) -> Order:
    """The order to go to a value, as the journal notes it."""
    text, numbers = lever.formatted(fade)
    return Order(lever.family, numbers, text)


def without_fade(order: Order) -> Order:
    """The same, at once."""
    one = find_lever(order.name)
    if one is None or one.fade_s is AT_ONCE:
        return order
    return order_of(one, at_once(Fade(one.given(order.text, order.values)[0], one.default)))
