"""Reconciles the dance with the show state that show control has declared, between two ticks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from appliance.box.show_state import ShowState, ShowStateReader
from appliance.dancer.puppeteers import Remote
from appliance.pose import quaternion
from appliance.stage.iterations import Iterations
from appliance.stage.stage_parts import StageParts


@dataclass(frozen=True, slots=True)
class Change:
    """What the dance changes to at one moment; None leaves a part as it is.

    phrase: name, fade in seconds; iterations: coding, interaction, fade in seconds; hands: number of the hand
    in the show, whether it holds; rate: of playback, 0 standing.
    """

    phrase: tuple[str, float] | None = None
    iterations: tuple[int, int, float] | None = None
    hands: tuple[tuple[int, bool], ...] = ()
    rate: float | None = None

    def noted(self) -> dict[str, Any]:
        """For the journal: what changes."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: value for name, value in values.items() if value is not None and value != ()}

    @classmethod
    def from_journal(cls, noted: Mapping[str, Any]) -> Change:
        """From what `noted` gave, read back. Raises ValueError, TypeError, LookupError for anything else."""
        phrase, iterations, rate = noted.get("phrase"), noted.get("iterations"), noted.get("rate")
        return cls(
            None if phrase is None else (str(phrase[0]), float(phrase[1])),
            None if iterations is None else (int(iterations[0]), int(iterations[1]), float(iterations[2])),
            tuple((int(number), bool(holds)) for number, holds in noted.get("hands", ())),
            None if rate is None else float(rate),
        )


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

    def pending(self, now: float) -> Change | None:
        """What has been declared and is to be applied now; None in nearly every tick."""
        show_state = self._reader.read()
        is_new = show_state.generation != self.generation and show_state.show == self._show
        change = self._declared(show_state) if is_new else Change()
        rate = 0.0 if show_state.stands(now) else self.rate
        if rate != self.parts.motion.rate:
            return replace(change, rate=rate)
        return change if is_new else None

    def apply(self, change: Change) -> str:
        """Change the dance; a sentence where there is something to say about it."""
        self.words = apply(change, self.parts, self.iterations)
        return self.words

    def stands(self, now: float) -> bool:
        """Whether the phrase has to stand still, because the show is stopped and dark."""
        return self._reader.read().stands(now)

    def begin(self, now: float) -> str:
        """Before the first tick: begin with what is declared, without fades; a sentence about it, or ""."""
        change = self.pending(now)
        if change is None:
            return ""
        if change.phrase is not None and change.phrase[0] in self.parts.motion.phrases:
            self.parts.motion.start_with(change.phrase[0])
            change = replace(change, phrase=None)
        if change.iterations is not None:
            change = replace(change, iterations=(*change.iterations[:2], 0.0))
        words = self.apply(change)
        return f"The show goes on in the cue '{self.cue}'. {words}".rstrip() if self.cue else words

    def _declared(self, show_state: ShowState) -> Change:
        """What was declared since the generation that the dance follows; it follows this one now."""
        before, self.generation = self.generation, show_state.generation
        self.cue = show_state.cue or self.cue
        phrase = iterations = None
        if show_state.phrase_set > before:
            phrase = show_state.phrase, show_state.phrase_fade_s
        if show_state.iterations_set > before:
            iterations = show_state.coding, show_state.interaction, show_state.iterations_fade_s
        if show_state.rate_set > before:
            self.rate = (self._usual_rate or 1.0) if show_state.rate is None else show_state.rate
        hands = tuple(
            (number, show_state.hands[puppeteer.joint][0])
            for number, puppeteer in enumerate(self.parts.hands.puppeteers)
            if show_state.hands.get(puppeteer.joint, (False, 0))[1] > before
        )
        return Change(phrase, iterations, hands)


def apply(change: Change, parts: StageParts, iterations: Iterations) -> str:
    """Change the dance. A sentence where there is something to say about it."""
    words: list[str] = []
    if change.rate is not None:
        parts.motion.rate = change.rate
    try:
        if change.phrase is not None and not parts.motion.play(*change.phrase):
            words.append(f"The phrase '{change.phrase[0]}' plays already, and goes on.")
    except ValueError as error:  # the show was exchanged for another one of the same name
        words.append(str(error))
    for number, holds in change.hands:
        _enable(number, holds, parts)
    if change.iterations is not None:
        words.append(iterations.ask(*change.iterations))
        if iterations.asked[1] == 0 and any(puppeteer.enabled for puppeteer in parts.hands.puppeteers):
            words.append("None of the iterations is interactive: the hands move nothing.")
    return " ".join(filter(None, words))


def _enable(number: int, holds: bool, parts: StageParts) -> None:
    """Let a hand hold or let go; one by OSC without an orientation yet holds its joint where it is."""
    puppeteer = parts.hands.puppeteers[number]
    puppeteer.enabled = holds
    if holds and isinstance(puppeteer, Remote):
        puppeteer.hold_here(_orientation(puppeteer.joint, parts).tolist())


def _orientation(joint: str, parts: StageParts) -> quaternion.Array:
    """Where a joint is now, local to its parent; before the first tick where the phrase has it."""
    place = parts.skeleton.index(joint)
    parent, world = parts.skeleton.parents[place], parts.grounding.figure.world
    here: quaternion.Array = world[place]
    if not here.any():
        here = parts.motion.window()[0][place]
    elif parent >= 0:
        here = quaternion.multiply(quaternion.inverse(world[parent]), here)
    return here
