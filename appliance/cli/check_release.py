"""`bunraku preflight --check-release`: can this release dance on this machine? Before it is switched to."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from appliance.box.realtime import prepare_environment
from appliance.release.choice import ShowAndBox

prepare_environment()

import numpy as np  # noqa: E402  (it must find the environment prepared)

_TICKS = 100
_LEFT_OUT = ("appliance.studio",)  # the workstation's
_MAY_MISS = ("appliance.projector",)  # a machine without a graphics driver still dances


def check_release(data: Path) -> int:
    """0: it can; 1: it cannot, and stderr says why. Opens no port and writes nothing."""
    problems = list(_missing())
    if not problems:
        from appliance.release.adoption import read_choice

        for pair in (ShowAndBox(), *read_choice(data).pairs[:1]):
            problems += _undanced(pair)
    for message in problems:
        print(message, file=sys.stderr)
    print("This release can dance here." if not problems else "This release cannot dance here.")
    return 1 if problems else 0


def _missing() -> Iterator[str]:
    """Modules of the box that cannot be imported: a wheel that is missing, or one for another machine."""
    import appliance

    for found in pkgutil.walk_packages(appliance.__path__, "appliance.", onerror=lambda _: None):
        if found.name.startswith(_LEFT_OUT) or found.name.endswith("__main__"):
            continue
        try:
            importlib.import_module(found.name)
        except Exception as error:
            if not found.name.startswith(_MAY_MISS):
                yield f"{found.name} cannot be imported ({error}). The release is not whole: copy it again."
            else:
                print(f"{found.name} cannot be imported ({error}): no picture on this machine.")


def _undanced(pair: ShowAndBox) -> list[str]:
    """Why this release does not dance a show in time; empty if it does."""
    try:
        usual_ms, budget_ms = _danced(pair)
    except Exception as error:
        return [f"{pair.source}: this release does not dance it. {error}"]
    print(f"{pair.source}: {_TICKS} ticks, {usual_ms:.1f} ms each, of a budget of {budget_ms:g} ms.")
    if usual_ms > budget_ms:
        return [f"{pair.source}: a tick takes {usual_ms:.1f} ms here, more than {budget_ms:g} ms. Too slow."]
    return []


def _danced(pair: ShowAndBox) -> tuple[float, float]:
    """The usual cost of a tick in processor time, and its budget, ms: the stage's own tick, without ports."""
    from appliance.box.clock import TICK_S, Slot
    from appliance.cli.check import verified_parts, without_ports
    from appliance.show.box import load_box
    from appliance.show.show import load_show
    from appliance.stage.sensor_fit import SensorFit
    from appliance.stage.sensor_memory import SensorMemory
    from appliance.stage.stage_parts import assemble
    from appliance.stage.tick import Tick

    verdict = verified_parts(pair.show, pair.box)[1]
    box = load_box(pair.box)
    parts, memory = assemble(load_show(pair.show), without_ports(box)), SensorMemory(None)
    parts.run_with(verdict)
    tick = Tick(parts, SensorFit(parts, memory), latest_start_s=TICK_S)
    costs_ms: list[float] = []
    for number in range(_TICKS):
        started, begun = time.monotonic(), time.thread_time()
        slot = Slot(number, started, started, 0)
        tick.run(slot)
        tick.after(slot)
        costs_ms.append(1000.0 * (time.thread_time() - begun))
        if not all(np.isfinite(frame.pose).all() for frame in tick.frame.puppets):
            raise ValueError("The poses are not numbers.")
    parts.close()
    memory.close()
    return sorted(costs_ms)[_TICKS // 2], box.limits.tick_budget_ms
