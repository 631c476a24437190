"""Whether a show is on: nothing may cost it time then."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

from appliance.box.show_state import ShowStateReader
from appliance.console.stage_view import StageView


def show_goes(runtime: Path) -> bool:
    """Whether a dance is on: a stage that lives, and a show that was not stopped."""
    with closing(StageView(runtime)) as stage, closing(ShowStateReader(runtime)) as state:
        now = time.monotonic()
        return stage.state(now) == "fresh" and not state.read().stands(now)
