"""Everything that the page tells about the box, once a second, as one value that JSON takes."""

from __future__ import annotations

import json
import time
from typing import Any

from appliance.box.roster import Roster, RosterLine
from appliance.box.show_state import ShowStateReader
from appliance.console.desk import NO_COMMANDS, SILENT, Desk
from appliance.console.seen_stage import SeenStage
from appliance.console.stage_view import StageView
from appliance.console.verdict import Verdict, verdict
from appliance.levers.addresses import NAMED
from appliance.levers.lever import Lever
from appliance.levers.show_state import ShowState
from appliance.levers.status import Status
from appliance.levers.table import (
    CUE,
    FEEDBACK,
    GOAL,
    MADE_NUMBERS,
    PATH_POINTS,
    SPRINGS,
    STIFFNESS,
    STORM,
    STRINGS,
)
from appliance.show_control.status_messages import hands_of, names_of, status

_NO_BATTERY = 255
_KNOBS = (STIFFNESS, STORM, FEEDBACK)  # knobs of the springs
_SAME_STAGE_S = 5.0  # a stage that seems to have started this much later is another one


class BoxView:
    """Reads what stage, show control and the others share, and remembers what they forget.

    value: the newest. A battery level stays after its sensor is gone; `since`: Unix seconds since when no
    tick was late or skipped. text: the same as JSON.
    """

    def __init__(self, desk: Desk, stage: StageView, seen: SeenStage, show_state: ShowStateReader) -> None:
        self._show_state = show_state
        self._desk, self._stage, self._seen = desk, stage, seen
        self._batteries: dict[str, int] = {}
        self._late: tuple[int, int] | None = None
        self._saw_late = False
        self._since = self._started = time.monotonic()  # the other clock may be set meanwhile
        self.value: dict[str, Any] = {}
        self.text = "{}"

    def refresh(self) -> None:
        """Look once."""
        self.value = self._value(time.monotonic())
        self.text = json.dumps(self.value)

    def _value(self, now: float) -> dict[str, Any]:
        seen, state, members = self._seen, self._show_state.read(), self._seen.members(now)
        control = next((one for one in members if one.process == "control" and one.lives), None)
        trouble = "" if control else SILENT if self._desk.has_control else NO_COMMANDS
        reported = control.reported if control else {}
        counted = int(reported.get("refused", 0)), int(reported.get("strangers", 0))
        known = status(state, seen, *counted, now, str(reported.get("live", ""))) if control else None
        frames = self._stage.state(now)
        roster = Roster.reported(seen.health() if self._stage.lives else {})
        sensors = [self._sensor(line) for line in roster.lines]
        fallbacks = [{"process": process, **one._asdict()} for process, one in seen.fallbacks(now)]
        self._note_late(known, now)
        since = _unix(self._since, now)
        held = self._stage.held() if frames == "fresh" else ()
        hands = [one._asdict() | {"is_held": one.joint in held} for one in hands_of(seen)] if known else []
        judged: Verdict = verdict(frames, known, sensors, fallbacks, since, trouble, self._saw_late)
        return {
            "time": time.time(),
            "trouble": trouble,
            "control": self._desk.has_control,
            "frames": frames,
            "status": None if known is None else known._asdict(),
            "verdict": judged._asdict(),
            "since": since,
            "sensors": sensors,
            "fallbacks": fallbacks,
            "processes": [{"process": one.process, "late": one.late} for one in members],
            "wall": dict(seen.reported("projector", now)),
            "remote": dict(seen.reported("remote", now)),
            "gestures": reported.get("gestures", {}),
            "hands": hands,
            "generation": self._stage.generation,
            **self._declared(now),
            **{
                question.removeprefix("/"): [
                    {"name": name, "now": is_now}
                    for name, is_now in (names_of(question, state, known, seen) if known else ())
                ]
                for question in NAMED
            },
        }

    def _declared(self, now: float) -> dict[str, Any]:
        """The levers as they are declared for the present show. motion: value and fade by `SOURCE NAME`.
        springs: setting, strings, and the knobs that were turned. cue_since: Unix seconds at which the cue in
        force was called. fade: of those that run, the one that ends last: when it began, and its seconds.
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
        fades = [fade for fade in state.settings.values() if fade.since <= now < fade.since + fade.seconds]
        last = max(fades, key=lambda fade: fade.since + fade.seconds, default=None)
        turned = {lever.name: state[lever].value for lever in _KNOBS if lever in state}
        return {
            "motion": motion,
            "goal": list(state[GOAL].value) if GOAL in state else [],
            "cue_since": _unix(state[CUE].since, now) if state.cue and state[CUE].since <= now else None,
            "fade": [_unix(last.since, now), last.seconds] if last else None,
            "springs": turned | {"setting": state[SPRINGS].value, "strings": state[STRINGS].value},
        }

    def _sensor(self, line: RosterLine) -> dict[str, Any]:
        """A sensor with its last known battery; heard: it sends now."""
        if line.battery != _NO_BATTERY:
            self._batteries[line.name] = line.battery
        battery = self._batteries.get(line.name)
        values = line._asdict() | {"battery": battery, "is_worn": bool(line.neutral)}
        return values | {"heard": line.state == "linked"}

    def _note_late(self, status: Status | None, now: float) -> None:
        if status is None or status.uptime_s < 0:
            return
        late, started = (status.late, status.skipped), now - status.uptime_s
        if self._late is None or started > self._started + _SAME_STAGE_S:
            self._saw_late = self._late is not None
            self._started = started
            self._since = started if late == (0, 0) else now
        elif late != self._late:
            self._since, self._saw_late = now, True
        self._late = late


def _unix(monotonic: float, now: float) -> float:
    return time.time() - (now - monotonic)


def _short(lever: Lever[Any]) -> str:
    """`SOURCE NAME` of a lever of the generator's."""
    return lever.name.partition(" ")[2]
