"""The stage as the page sees it: the same as show control sees, read without numpy."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from appliance.box.fallback import Fallen, fallen
from appliance.box.made_motion import SavedNamesReader
from appliance.box.process_health import Member, ProcessHealth
from appliance.console.stage_view import StageView
from appliance.show_control.status_messages import SeenFacts, StageState


class SeenStage:
    """The stage and the other processes of a runtime folder; never waits, never raises."""

    def __init__(self, folder: Path, view: StageView) -> None:
        self._view, self._processes, self._saved = view, ProcessHealth(folder), SavedNamesReader(folder)

    @property
    def facts(self) -> SeenFacts | None:
        """The newest stage's; None before the first."""
        return self._view.seen_facts

    def state(self, now: float) -> StageState:
        """hung: the process lives, but no frame came for half a second."""
        frames = self._view.state(now)
        if frames == "fresh":
            return "stopped" if self.health().get("state") == "stopped" else "dancing"
        return "hung" if frames == "stale" and self._view.lives else "absent"

    def health(self) -> dict[str, Any]:
        """The stage's last report; empty before the first."""
        return self._view.health()

    def saved(self) -> tuple[str, ...]:
        """Names of motions that were kept."""
        return self._saved.read()

    def fallbacks(self, now: float) -> list[tuple[str, Fallen]]:
        """Process and fallback, of all processes of the box, as far as they ever happened."""
        stage = fallen(self.health().get("fallbacks")) if self.state(now) != "absent" else ()
        return [*(("stage", one) for one in stage), *self._processes.fallbacks(now)]

    def reported(self, process: str, now: float) -> Mapping[str, Any]:
        """The report of a process beside the stage; empty where it does not live."""
        return self._processes.reported(process, now)

    def members(self, now: float) -> list[Member]:
        """The processes beside the stage."""
        return self._processes.members(now)

    def close(self) -> None:
        self._processes.close()
        self._saved.close()
