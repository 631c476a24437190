"""Status messages: answers to questions, and the status that goes out once a second."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Protocol

from appliance.box.fallback import Fallen
from appliance.levers.addresses import LISTS, NAMED
from appliance.levers.show_state import ShowState
from appliance.levers.status import Status
from appliance.levers.table import LIGHTS, LOOK, MADE_NUMBERS
from appliance.outputs.puppet_facts import PuppetFacts, led_by
from appliance.pose.foreign_file import plain_json
from appliance.show_control.packet import Message

StageState = Literal["dancing", "stopped", "hung", "absent"]
END = "/end"
_LONGEST_TEXT = 1000  # longest sentence in an answer


class SeenFacts(Protocol):
    """The facts of a stage that answers need; Facts is one."""

    @property
    def show_name(self) -> str: ...
    @property
    def looks(self) -> Sequence[str]: ...
    @property
    def lights(self) -> Sequence[str]: ...
    @property
    def phrases(self) -> Sequence[str]: ...
    @property
    def cues(self) -> Sequence[Mapping[str, Any]]: ...
    @property
    def puppets(self) -> Sequence[PuppetFacts]: ...
    @property
    def motion(self) -> Mapping[str, Any]: ...


class Seen(Protocol):
    """The stage as show control and the page see it, each with its reader."""

    @property
    def facts(self) -> SeenFacts | None: ...
    def state(self, now: float) -> StageState: ...
    def health(self) -> dict[str, Any]: ...
    def saved(self) -> tuple[str, ...]: ...
    def reported(self, process: str, now: float) -> Mapping[str, Any]: ...
    def fallbacks(self, now: float) -> Sequence[tuple[str, Fallen]]: ...


class HandLine(NamedTuple):
    """A hand: its joint, what holds it, whether it holds, and what it gives."""

    joint: str
    source: str
    holds: bool
    by: str


def status(
    show_state: ShowState,
    observer: Seen,
    refused: int,
    strangers: int,
    now: float,
    live: str = "",
) -> Status:
    """The stage's last report, and what show control sees of a stage that hangs or is absent."""
    stage, facts = observer.state(now), observer.facts
    seen = Status.reported({} if stage == "absent" else observer.health() | led(observer))
    return seen._replace(
        state=_state(stage, show_state),
        show=facts.show_name if facts else "",
        rate_hz=seen.rate_hz if stage in ("dancing", "stopped") else 0.0,
        cue=show_state.cue,
        look=show_state[LOOK].value or (facts.looks[0] if facts and facts.looks else ""),
        lights=show_state[LIGHTS].value or (facts.lights[0] if facts and facts.lights else ""),
        level=show_state.level(now),
        panic=int(show_state.panic),
        blackout=int(show_state.blackout),
        refused=refused,
        strangers=strangers,
        fallbacks=sum(one.active for _, one in observer.fallbacks(now)),
        timecode=str(observer.reported("remote", now).get("timecode", "")),
        live=live,
    )


def answer_to(
    question: str, show_state: ShowState, observer: Seen, now_status: Status, now: float
) -> Iterator[Message]:
    """The answer to a question: a message for each thing, and one to end with."""
    if question == "/status":
        answers: list[Message] = [*now_status.messages()]
    elif question in NAMED:
        names = names_of(question, show_state, now_status, observer)
        answers = [(NAMED[question], name, int(is_now)) for name, is_now in names]
    elif question == "/hands":
        answers = [
            ("/hands/hand", one.joint, one.source, int(one.holds), one.by) for one in hands_of(observer)
        ]
    elif question == "/motion":
        answers = [*_made(now_status, observer), *_declared(show_state, observer)]
    else:
        answers = list(_fallbacks(observer, now))
    yield from answers
    yield END, question, len(answers)


def names_of(
    question: str, show_state: ShowState, now_status: Status, observer: Seen
) -> list[tuple[str, bool]]:
    """The names that a question of NAMED asks for, and which is in force."""
    facts = observer.facts
    if facts is None:
        return []
    if question == "/cues":
        return [(str(cue["name"]), cue["name"] == now_status.cue) for cue in facts.cues]
    if question == "/phrases":
        names = dict.fromkeys((*facts.phrases, *observer.saved()))
        return [(name, name == now_status.phrase) for name in names]
    lever = LISTS[question]
    shown = (*([lever.none] if lever.none else ()), *getattr(facts, lever.names[0]))
    return [(name, name == (show_state[lever].value or shown[0])) for name in shown]


def led(observer: Seen) -> dict[str, Any]:
    """The stage's report on the puppet that cues and orders lead; empty before the first."""
    puppets = observer.health().get("puppets", ())
    return dict(next((puppet for puppet in puppets if puppet.get("is_led")), {}))


def hands_of(observer: Seen) -> Iterator[HandLine]:
    """The hands of the puppet that cues and orders lead."""
    if (facts := observer.facts) is None:
        return
    let_go = led(observer).get("let_go", ())
    for hand in led_by(facts.puppets).hands:
        yield HandLine(hand.joint, hand.source, hand.joint not in let_go, hand.by)


def _fallbacks(observer: Seen, now: float) -> Iterator[Message]:
    for process, one in observer.fallbacks(now):
        message, about = one.message[:_LONGEST_TEXT], one.about[:_LONGEST_TEXT]
        yield "/fallbacks/fallback", one.name, process, one.times, int(one.active), message, about


def _made(status: Status, observer: Seen) -> Iterator[Message]:
    """The recipe of the motion that is danced, number by number; nothing while it is a phrase or live."""
    recipe = plain_json(str(led(observer).get("made") or "{}"))
    recipe = recipe.get("of", recipe)
    for name, value in recipe.items() if status.phrase else ():
        if name not in ("number", "after", "prompt") and value is not None:
            yield "/motion/is", name, *(value if isinstance(value, list) else (value,))


def _declared(show_state: ShowState, observer: Seen) -> Iterator[Message]:
    """Each parameter of the show's sources that are made ahead, with the value that it has or fades to."""
    facts = observer.facts
    is_ours = facts is not None and show_state.show == facts.show_name
    for source, section in facts.motion.items() if facts is not None else ():
        for name, lever in MADE_NUMBERS[source].items():
            is_set = is_ours and lever in show_state
            value = show_state[lever].value if is_set else section[name]
            yield "/motion/parameter", source, name, float(value)


def _state(stage: str, show_state: ShowState) -> str:
    """One word: the worst first, as black is what the audience sees of a stage that hangs anyway."""
    if stage in ("hung", "absent"):
        return stage
    if show_state.panic:
        return "panic"
    if show_state.blackout:
        return "blackout"
    return stage if show_state.going else "stopped"
