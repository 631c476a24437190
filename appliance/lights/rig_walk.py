"""`bunraku lights test`: a walk through the rig on the wires of a box, while no show runs."""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack
from pathlib import Path

from appliance.box.log import process_log
from appliance.box.runtime_folder import Claim, runtime_folder
from appliance.box.stop_signals import stop_signals
from appliance.lights.patch import Patch
from appliance.lights.run import require_wires, rig_here, wired
from appliance.lights.unknown_name import UnknownNameError
from appliance.lights.walk import steps, walk
from appliance.show.box import load_box
from appliance.show.bundle import default_show_path
from appliance.show.config_error import did_you_mean
from appliance.show.lights import drivable
from appliance.show.show import Show, load_show
from appliance.show.venue_rig import unwired

_log = logging.getLogger(__name__)


def walk_rig(
    directory: Path | None, box_file: Path | None, fixtures: list[str], attribute: str | None, step_s: float
) -> None:
    """Take every step, then send zeros.

    Raises ConfigError, UnknownNameError, or AlreadyHereError while the lights run.
    """
    show, box = load_show(directory or default_show_path()), load_box(box_file)
    require_wires(box)
    config = rig_here(show, box)
    _require_known(show, fixtures, attribute)
    patch = Patch(config.fixtures, show.directory)
    to_see = list(steps(patch, fixtures, attribute))
    with ExitStack() as opened:
        opened.enter_context(process_log())
        stopped = opened.enter_context(stop_signals())
        opened.callback(Claim(runtime_folder(box), "lights").close)
        universes = wired(patch, box)
        for universe in universes:
            opened.callback(lambda one: one.close(time.monotonic()), universe)

        def send_levels(levels: dict[int, bytes]) -> float:
            for universe in universes:
                universe.offer(levels[universe.number], time.monotonic())
            time.sleep(1.0 / box.lights.rate_hz)
            return time.monotonic()

        for sentence in unwired(show.config, box):
            _log.info(sentence)
        _log.info(f"{len(to_see)} steps of {step_s:g} s or more; Ctrl-C ends the walk, and all goes dark.")
        walk(patch, to_see, step_s, box.lights.rate_hz, send_levels, stopped)
        for universe in universes:
            for message in filter(None, (universe.wire.trouble, universe.wire.remark)):
                _log.warning(message)


def _require_known(show: Show, fixtures: list[str], attribute: str | None) -> None:
    """Raises UnknownNameError for names that the rig does not have."""
    rig = show.config.lights.fixtures
    names = [fixture.name for fixture in rig]
    for name in fixtures:
        if name not in names:
            raise UnknownNameError(
                "--fixture", f"The show has no fixture '{name}'. {did_you_mean(name, names)}"
            )
    known = sorted({word for fixture in rig for word in drivable(fixture, show.directory)})
    if attribute is not None and attribute not in known:
        raise UnknownNameError(
            "--attribute", f"No fixture has '{attribute}'. {did_you_mean(attribute, known)}"
        )
