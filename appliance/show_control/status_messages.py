"""Status messages: answers to questions, and the status that goes out once a second."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from appliance.levers.addresses import LISTS
from appliance.levers.lever import Lever
from appliance.levers.show_state import ShowState
from appliance.levers.table import LIGHTS, LOOK, MADE_NUMBERS
from appliance.pose.foreign_file import plain_json
from appliance.show_control.packet import Message

if TYPE_CHECKING:
    from appliance.show_control.stage_observer import StageObserver

STATUS, END = "/bunraku/status", "/end"
UNKNOWN = -1.0
_LONGEST_WORDS = 1000  # of a sentence in an answer


class Status(NamedTuple):
    """How the box is, as the arguments of `/bunraku/status` in this order; docs/osc.md explains them."""

    state: str  # dancing, stopped, panic, blackout, hung, absent
    show: str
    rate_hz: float
    late: int
    skipped: int
    tick_p50_ms: float
    tick_p99_ms: float
    sensor_age_s: float
    coding: int
    interaction: int
    phrase: str
    position_s: float
    cue: str
    look: str
    lights: str
    level: float
    panic: int
    blackout: int
    temperature_c: float
    uptime_s: float
    refused: int
    strangers: int
    fallbacks: int
    liveliness: float
    seed: int
    live: str = ""


def status(
    show_state: ShowState,
    observer: StageObserver,
    refused: int,
    strangers: int,
    now: float,
    live: str = "",
) -> Status:
    """The stage's last report, and what show control sees of a stage that hangs or is absent."""
    stage, health, facts = observer.state(now), observer.health(), observer.facts
    if stage == "absent":
        health = {}
    return Status(
        state=_state(stage, show_state),
        show=facts.show_name if facts else "",
        rate_hz=float(health.get("rate_hz", 0.0)) if stage in ("dancing", "stopped") else 0.0,
        late=int(health.get("late", 0)),
        skipped=int(health.get("skipped", 0)),
        tick_p50_ms=float(health.get("tick_p50_ms", 0.0)),
        tick_p99_ms=float(health.get("tick_p99_ms", 0.0)),
        sensor_age_s=_known(health.get("sensor_age_s")),
        coding=int(health.get("coding", 0)),
        interaction=int(health.get("interaction", 0)),
        phrase=str(health.get("phrase", "")),
        position_s=_known(health.get("position_s")),
        cue=show_state.cue,
        look=show_state[LOOK].value or (facts.looks[0] if facts and facts.looks else ""),
        lights=show_state[LIGHTS].value or (facts.lights[0] if facts and facts.lights else ""),
        level=show_state.level(now),
        panic=int(show_state.panic),
        blackout=int(show_state.blackout),
        temperature_c=_known(health.get("temperature_c")),
        uptime_s=_known(health.get("uptime_s")),
        refused=refused,
        strangers=strangers,
        fallbacks=sum(one.active for _, one in observer.fallbacks(now)),
        liveliness=_known(health.get("liveliness")),
        seed=int(health.get("seed", -1)),
        live=live,
    )


def told(
    question: str, show_state: ShowState, observer: StageObserver, now_status: Status, now: float
) -> Iterator[Message]:
    """The answer to a question: a message for each thing, and one to end with."""
    if question == "/status":
        answers: list[Message] = [(STATUS, *now_status)]
    elif question in LISTS:
        answers = list(_names(LISTS[question], show_state, observer))
    elif question == "/motion":
        answers = [*_made(now_status, observer), *_declared(show_state, observer)]
    else:
        answers = list(_LISTS[question](now_status, observer, now))
    yield from answers
    yield END, question, len(answers)


def _cues(status: Status, observer: StageObserver, now: float) -> Iterator[Message]:
    for cue in observer.facts.cues if observer.facts else ():
        yield "/cues/cue", str(cue["name"]), int(cue["name"] == status.cue)


def _phrases(status: Status, observer: StageObserver, now: float) -> Iterator[Message]:
    for name in dict.fromkeys((*observer.facts.phrases, *observer.kept())) if observer.facts else ():
        yield "/phrases/phrase", name, int(name == status.phrase)


def _names(lever: Lever[str], show_state: ShowState, observer: StageObserver) -> Iterator[Message]:
    """The names that the show has for a lever; where none is set, the first is in force."""
    attribute, listed = lever.names[0], lever.listed
    names: tuple[str, ...] = getattr(observer.facts, attribute) if observer.facts else ()
    if observer.facts and lever.none:
        names = lever.none, *names
    for name in names:
        yield f"/{attribute}/{listed}", name, int(name == (show_state[lever].value or names[0]))


def _hands(status: Status, observer: StageObserver, now: float) -> Iterator[Message]:
    facts = observer.facts
    if facts is None:
        return
    let_go = observer.health().get("let_go", ())
    for hand, (joint, source) in enumerate(zip(facts.held, facts.hands, strict=True)):
        name = facts.skeleton.names[joint]
        by = "position" if hand in facts.by_position else "orientation"
        yield "/hands/hand", name, source, int(name not in let_go), by


def _fallbacks(status: Status, observer: StageObserver, now: float) -> Iterator[Message]:
    for process, one in observer.fallbacks(now):
        words, about = one.words[:_LONGEST_WORDS], one.about[:_LONGEST_WORDS]
        yield "/fallbacks/fallback", one.name, process, one.times, int(one.active), words, about


def _made(status: Status, observer: StageObserver) -> Iterator[Message]:
    """What was made ahead and is danced, number by number; nothing while a phrase or a live dancer is."""
    recipe = plain_json(str(observer.health().get("made") or "{}"))
    recipe = recipe.get("of", recipe)
    for name, value in recipe.items() if status.phrase else ():
        if name not in ("number", "after", "prompt") and value is not None:
            yield "/motion/is", name, *(value if isinstance(value, list) else (value,))


def _declared(show_state: ShowState, observer: StageObserver) -> Iterator[Message]:
    """Each parameter of the show's sources that are made ahead, with the value that it has or fades to."""
    facts = observer.facts
    is_ours = facts is not None and show_state.show == facts.show_name
    for source, section in facts.motion.items() if facts is not None else ():
        for name, lever in MADE_NUMBERS[source].items():
            is_set = is_ours and lever in show_state
            value = show_state[lever].value if is_set else section[name]
            yield "/motion/parameter", source, name, float(value)


_LISTS = {
    "/cues": _cues,
    "/phrases": _phrases,
    "/hands": _hands,
    "/fallbacks": _fallbacks,
}


def _state(stage: str, show_state: ShowState) -> str:
    """One word: the worst first, as black is what the audience sees of a stage that hangs anyway."""
    if stage in ("hung", "absent"):
        return stage
    if show_state.panic:
        return "panic"
    if show_state.blackout:
        return "blackout"
    return stage if show_state.going else "stopped"


def _known(value: float | None) -> float:
    return UNKNOWN if value is None else float(value)
