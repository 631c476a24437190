"""Springs follow what show control declares of them, and drive no joint while the show is away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.box.orders import Order
from appliance.show.show import load_show
from appliance.show_control.command import Command
from appliance.show_control.show_state_commands import declare
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import write_show
from tests.stage.declared import Commanded, Declared, follow
from tests.stage.shows import BOX, NOW


def test_springs_follow_what_is_declared_also_after_a_restart(tmp_path: Path, declared: Declared) -> None:
    cues = [{"name": "gale", "springs": "storm", "fade_s": 0}]
    show = load_show(write_show(tmp_path / "sprung", [{"springs": "stiff", "joint": "Hips"}], cues=cues))
    parts, again = assemble(show, BOX), assemble(show, BOX)
    facts = facts_of(show, None, Iterations(3, 2, most=8), NOW)
    reconciler = Reconciler("A test", parts, declared)  # type: ignore[arg-type]
    assert parts.led.springs is not None and again.led.springs is not None

    def say(address: str, *values: float, text: str = "") -> None:
        declared.now, _ = declare(declared.now, Command(address, values, text), facts, NOW)
        follow(reconciler)

    say("/springs/wind", 1.0, 2.0, 3.0)
    say("/cue", text="gale")
    assert parts.led.springs.setting == "storm"
    assert parts.led.springs.wind.tolist() == list(
        parts.led.springs.settings["storm"].wind
    )  # the older wind is over
    say("/springs", text="loose")
    say("/springs/wind", 3.0, 0.0, -1.0)
    say("/springs/gravity", 5.0)
    restarted = Reconciler("A test", again, declared)  # type: ignore[arg-type]
    restarted.generation = reconciler.generation  # as its checkpoint says
    follow(restarted)
    assert not restarted.pending(NOW)
    for springs in (parts.led.springs, again.led.springs):
        assert (springs.setting, springs.gravity, springs.wind.tolist()) == ("loose", 5.0, [3.0, 0.0, -1.0])
    with pytest.raises(ValueError, match="Did you mean 'loose'"):
        say("/springs", text="lose")
    parts.close()
    again.close()


@pytest.mark.parametrize("puppets", [1, 2])
def test_strings_drive_no_joint_in_panic_blackout_and_after_a_stop(
    tmp_path: Path, declared: Declared, puppets: int
) -> None:
    strung = [{"springs": "stiff", "joint": "Hips"}]
    settings, two = [{"name": "stiff", "feedback": 1}], [{"name": "left"}, {"name": "right", "hands": strung}]
    first = strung if puppets == 1 else []
    config = {"springs": settings, **({"puppets": two} if puppets == 2 else {})}
    parts = assemble(load_show(write_show(tmp_path / "strung", first, **config)), BOX)
    reconciler = Reconciler("A test", parts, declared)  # type: ignore[arg-type]
    (springs,) = parts.springs
    assert springs.feedback == 1.0
    for away, back in (("/panic", "/go"), ("/stop", "/go"), ("/blackout", "/blackout")):
        for address, values in ((away, (1.0,)), (back, () if back == "/go" else (0.0,))):
            declared.now, _ = declare(declared.now, Command(address, values), None, NOW)
            follow(reconciler)
            assert springs.feedback == 0.0
        gains = []
        for tick in range(60):
            springs.pull(NOW + 0.02 * tick)
            gains.append(springs.feedback)
        assert gains[-1] == 1.0 and max(np.diff(gains)) < 0.05  # and comes back evenly
    parts.close()


def test_springs_of_which_there_are_none_are_refused(command: Commanded, parts: StageParts) -> None:
    with pytest.raises(ValueError, match="No hand of this show is springs"):
        command("/springs/wind", 1.0, 0.0, 0.0)
    done, message = obey(Order("kick", (1.0, 0.0, 0.0)), parts)
    assert not done and "No hand of this show is springs" in message
