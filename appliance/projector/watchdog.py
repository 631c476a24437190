"""A display that hangs: waiting for it has no timeout, so the projector ends and is started again."""

from __future__ import annotations

from appliance.box.watchdog import end_process
from appliance.projector.projector_error import GPU_LOST

PATIENCE_S = 5.0
MESSAGE = (
    f"The display has taken no picture for {PATIENCE_S:g} s. The audience sees one that stands still, or "
    "none; the dance goes on. The projector ends so that it can be started again (a supervisor does it by "
    "itself); if it happens often, look at the cable, the projector and the graphics card's driver."
)


def give_up() -> None:
    """End this process, and say why."""
    end_process(MESSAGE, GPU_LOST)
