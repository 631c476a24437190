"""The stage as show control sees it, in the shared frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from appliance.box.fallback import Fallbacks, Fallen, fallen
from appliance.box.made_motion import SavedNamesReader
from appliance.box.process_health import COMMANDS_DROPPED, STAGE_HUNG, ProcessHealth
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import Facts
from appliance.show_control.fallback import OF_CONTROL
from appliance.show_control.status_messages import StageState


class StageObserver:
    """The stage of a runtime folder, whether it is there or not. own: show control's own fallbacks."""

    def __init__(self, folder: Path) -> None:
        self._reader = FrameReader(folder)
        self._process_health = ProcessHealth(folder)
        self._saved = SavedNamesReader(folder)
        self.own = Fallbacks((STAGE_HUNG, COMMANDS_DROPPED, *OF_CONTROL))

    def state(self, now: float) -> StageState:
        """hung: the process lives, but no frame came for half a second; absent: no process, or none yet."""
        frames = self._reader.state(now)
        is_hung = frames == "stale" and self._reader.is_alive(now)
        self.own.set(STAGE_HUNG.name, is_hung)
        if frames == "fresh":
            return "stopped" if self.health().get("state") == "stopped" else "dancing"
        return "hung" if is_hung else "absent"

    def lives(self, now: float) -> bool:
        """Whether there is a stage at all: one that dances, hangs, or is about to begin."""
        return self._reader.is_alive(now)

    def health(self) -> dict[str, Any]:
        """The stage's last report about itself; empty before the first."""
        return self._reader.health() or {}

    def applied(self) -> tuple[int, str]:
        """The generation of the show state that the dance follows, and what the stage says about it."""
        generation, message = self.health().get("applied", (0, ""))
        return int(generation), str(message)

    def saved(self) -> tuple[str, ...]:
        """Names of motions that were kept: /phrase calls them."""
        return self._saved.read()

    def fallbacks(self, now: float) -> list[tuple[str, Fallen]]:
        """Process and fallback, of all processes of the box, as far as they ever happened."""
        own = [("control", one) for one in self.own.happened(now)]
        stage = fallen(self.health().get("fallbacks")) if self.state(now) != "absent" else ()
        own_names = {(process, one.name) for process, one in own}
        others = self._process_health.fallbacks(now)
        more = [(process, one) for process, one in others if (process, one.name) not in own_names]
        return [*(("stage", one) for one in stage), *own, *more]

    def reported(self, process: str, now: float) -> Mapping[str, Any]:
        """The report of a process beside the stage; empty where it does not live."""
        return self._process_health.reported(process, now)

    def frames(self, count: int, now: float) -> list[JointFrame]:
        """At most so many of the newest frames, newest last."""
        return self._reader.frames(count, now)

    @property
    def facts(self) -> Facts | None:
        """Facts of the newest stage, even if it has ended; None before the first."""
        return self._reader.facts

    @property
    def generation(self) -> int:
        """Another number for each new stage."""
        return self._reader.generation

    def close(self) -> None:
        self._reader.close()
        self._process_health.close()
        self._saved.close()
