"""State that a run leaves in the runtime folder: a show that ended properly leaves none for the next one."""

from __future__ import annotations

from pathlib import Path

from appliance.box.live_pose import forget_live_pose
from appliance.box.made_motion import forget_made_motion
from appliance.box.show_state import forget_show_state


def forget_run(folder: Path) -> None:
    """The declared state, the live dancer's pose, and motion made ahead."""
    forget_show_state(folder)
    forget_live_pose(folder)
    forget_made_motion(folder)
