"""Carries out commands between two ticks: playback, iterations, joints held by OSC."""

from __future__ import annotations

from appliance.dancer.puppeteers import Remote
from appliance.stage.cast import Cast, Iterations
from appliance.stage.control import Command


def obey(order: Command, cast: Cast, iterations: Iterations, usual_rate: float) -> str:
    """Carry out one command; returns a sentence when it could not be done as asked, else nothing."""
    try:
        if order.name in ("hold", "release"):
            _hold(order, cast)
        elif order.name == "iterations":
            return _iterate(order, iterations)
        else:
            _play(order, cast, usual_rate)
    except ValueError as error:
        return str(error)
    return ""


def _play(order: Command, cast: Cast, usual_rate: float) -> None:
    motion = cast.motion
    if order.name == "start":
        motion.rate = usual_rate or 1.0
    elif order.name == "stop":
        motion.rate = 0.0
    elif order.name == "rate":
        motion.rate = order.values[0]
    elif order.name == "jump":
        motion.jump(order.values[0])
    elif order.name == "excerpt":
        motion.excerpt(*order.values)


def _iterate(order: Command, iterations: Iterations) -> str:
    coding, interaction = (int(value) for value in order.values)
    allowed = min(max(coding, 1), iterations.most)
    iterations.coding = allowed
    iterations.interaction = max(0, min(interaction - max(coding - allowed, 0), allowed))
    if (iterations.coding, iterations.interaction) == (coding, interaction):
        return ""
    return (
        f"{coding} coding and {interaction} interaction iterations were asked for; "
        f"the dancer runs with {iterations.coding} and {iterations.interaction}: "
        f"at most {iterations.most} fit the tick's budget here."
    )


def _hold(order: Command, cast: Cast) -> None:
    name = order.joint
    if isinstance(name, int):
        if not 0 <= name < len(cast.skeleton):
            raise ValueError(
                f"There is no joint {name}: this skeleton has joints 0 to {len(cast.skeleton) - 1}."
            )
        name = cast.skeleton.names[name]
    for puppeteer in cast.hands.puppeteers:
        if isinstance(puppeteer, Remote) and puppeteer.joint == name:
            if order.name == "release":
                puppeteer.release()
            else:
                x, y, z, angle = order.values
                puppeteer.hold_axis_angle((x, y, z), angle)
            return
    raise ValueError(
        f"No hand of this show holds '{name}' by OSC. Add {{osc: true, joint: {name}}} to its hands."
    )
