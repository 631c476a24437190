"""Everything that the page tells about the box, once a second, as one value that JSON takes."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from typing import Any

from appliance.box.process_health import ProcessHealth
from appliance.box.show_state import ShowStateReader
from appliance.console.desk import Answer, Desk, NoAnswerError
from appliance.console.stage_view import StageView
from appliance.console.verdict import Verdict, verdict
from appliance.levers.lever import Lever
from appliance.levers.show_state import ShowState
from appliance.levers.table import FEEDBACK, MADE_NUMBERS, PATH_POINTS, SPRINGS, STIFFNESS, STORM, STRINGS
from appliance.show_control.sensor_roster import RosterLine
from appliance.show_control.status_messages import STATUS, Status

_NO_BATTERY = 255
_KNOBS = (STIFFNESS, STORM, FEEDBACK)  # of the springs
_SAME_STAGE_S = 5.0  # a stage that seems to have started this much later is another one
_LISTS = {"/cues/cue": "cues", "/phrases/phrase": "phrases", "/looks/look": "looks", "/cards/card": "cards"}


class BoxView:
    """Asks show control, looks at the shared frame, and remembers what the two forget.

    value: the newest answer. A battery level stays after its sensor is gone; `since`: Unix seconds since
    when no tick was late or skipped. words: the same as JSON.
    """

    def __init__(
        self, desk: Desk, stage: StageView, processes: ProcessHealth, show_state: ShowStateReader
    ) -> None:
        self._show_state = show_state
        self._desk, self._stage, self._processes = desk, stage, processes
        self._batteries: dict[str, int] = {}
        self._late: tuple[int, int] | None = None
        self._since = self._started = time.time()
        self.value: dict[str, Any] = {}
        self.words = "{}"

    async def refresh(self) -> None:
        """Ask once; takes as long as show control takes to answer, two seconds at most."""
        trouble = ""
        try:
            answers = await self._desk.ask_all()
        except NoAnswerError as error:
            trouble, answers = str(error), []
        self.value = self._value(answers, trouble, time.monotonic())
        self.words = json.dumps(self.value)

    def _value(self, answers: Sequence[Answer], trouble: str, now: float) -> dict[str, Any]:
        status = next((_status(values) for address, values in answers if address == STATUS), None)
        sensors = [self._sensor(line) for line in _roster(answers)]
        fallbacks = [_fallback(values) for address, values in answers if address == "/fallbacks/fallback"]
        if trouble:
            fallbacks = [
                _fallback((one.name, process, one.times, one.active, one.words))
                for process, one in self._processes.fallbacks(now)
            ]
        frames = self._stage.state(now)
        lists: dict[str, list[dict[str, Any]]] = {name: [] for name in _LISTS.values()}
        for address, values in answers:
            if address in _LISTS and len(values) == 2:
                lists[_LISTS[address]].append({"name": values[0], "now": bool(values[1])})
        hands = [values for address, values in answers if address == "/hands/hand" and len(values) == 4]
        self._note_late(status)
        judged: Verdict = verdict(frames, status, sensors, fallbacks, self._since, trouble)
        return {
            "time": time.time(),
            "trouble": trouble,
            "control": self._desk.has_control,
            "frames": frames,
            "status": None if status is None else status._asdict(),
            "verdict": judged._asdict(),
            "since": self._since,
            "sensors": sensors,
            "fallbacks": fallbacks,
            "processes": [{"process": one.process, "late": one.late} for one in self._processes.members(now)],
            "hands": [
                {"joint": joint, "source": source, "holds": bool(holds), "by": by}
                for joint, source, holds, by in hands
            ],
            "generation": self._stage.generation,
            **self._declared(),
            **lists,
        }

    def _declared(self) -> dict[str, Any]:
        """What was declared for the show of now. motion: of what is made ahead, by `SOURCE NAME`, the value
        and its fade. springs: of springs and strings; a knob that nobody turned is left out.
        """
        state: ShowState = self._show_state.read()
        if state.show != self._stage.facts.get("show"):
            state = state.for_show("")
        made = [lever for levers in MADE_NUMBERS.values() for lever in levers.values()]
        motion: dict[str, list[float]] = {
            _short(lever): [state[lever].value, state[lever].seconds] for lever in made if lever in state
        }
        if PATH_POINTS in state:
            motion[_short(PATH_POINTS)] = list(state[PATH_POINTS].value)
        turned = {lever.name: state[lever].value for lever in _KNOBS if lever in state}
        return {
            "motion": motion,
            "springs": turned | {"setting": state[SPRINGS].value, "strings": state[STRINGS].value},
        }

    def _sensor(self, line: RosterLine) -> dict[str, Any]:
        """A sensor with its last known battery; heard: it sends now."""
        if line.battery != _NO_BATTERY:
            self._batteries[line.name] = line.battery
        battery = self._batteries.get(line.name)
        values = line._asdict() | {"battery": battery, "is_worn": bool(line.neutral)}
        return values | {"heard": line.state == "linked"}

    def _note_late(self, status: Status | None) -> None:
        if status is None or status.uptime_s < 0:
            return
        late, started = (status.late, status.skipped), time.time() - status.uptime_s
        if self._late is None or started > self._started + _SAME_STAGE_S:
            self._started = started
            self._since = started if late == (0, 0) else time.time()
        elif late != self._late:
            self._since = time.time()
        self._late = late


def _short(lever: Lever[Any]) -> str:
    """`SOURCE NAME` of a lever of the generator's."""
    return lever.name.partition(" ")[2]


def _status(values: Sequence[Any]) -> Status | None:
    """None from a show control of another release."""
    return Status(*values) if len(values) == len(Status._fields) else None


def _roster(answers: Sequence[Answer]) -> list[RosterLine]:
    fields = len(RosterLine._fields)
    lines = [values for address, values in answers if address == "/sensors/sensor"]
    return [RosterLine(*values) for values in lines if len(values) == fields]


def _fallback(values: Sequence[Any]) -> dict[str, Any]:
    name, process, times, active, words, about = (*values, "")[:6]  # none from an earlier release
    told = {"name": name, "process": process, "times": times, "active": bool(active)}
    return told | {"words": words, "about": about}
