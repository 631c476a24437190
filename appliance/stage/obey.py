"""Carries out commands between two ticks: playback, iterations, joints held by OSC, sensors."""

from __future__ import annotations

from appliance.dancer.puppeteers import Remote
from appliance.sensor.link import SensorLink
from appliance.show.config_error import did_you_mean
from appliance.stage.cast import Cast, Iterations
from appliance.stage.control import Command
from appliance.stage.wearing import Wearing

SENSOR_COMMANDS = frozenset(("neutral", "heading", "strobe", "reload"))
STROBE_S = 10.0


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


def obey_for_sensors(order: Command, cast: Cast, wearing: Wearing, now: float) -> tuple[bool, str]:
    """Carry out one of SENSOR_COMMANDS: whether it was done, and a sentence for who asked."""
    try:
        if order.name == "reload":
            return True, _admit(order, cast)
        if order.name == "strobe":
            _require_heard([order.sensor], cast.link, now)
            cast.link.strobe(order.sensor, now, STROBE_S)
            return True, f"{order.sensor} flashes for {STROBE_S:g} s."
        _require_heard(wearing.named(order.sensor or None), cast.link, now)
    except ValueError as error:
        return False, str(error)
    if order.name == "neutral":
        wearing.take_neutral(order.sensor or None, now)
        return True, "The neutral pose is taken at the next stillness: stand still now."
    wearing.reset_heading(order.sensor or None, now)
    return True, "Where the dancer faces now is the front."


def _admit(order: Command, cast: Cast) -> str:
    cast.link.admit(order.keys)
    known = f"The box knows {len(order.keys)} sensor{'' if len(order.keys) == 1 else 's'} now"
    missing = [name for name in cast.worn if name not in order.keys]
    if not missing:
        return f"{known}."
    return f"{known}, but not {', '.join(missing)} of this show: the dancer moves freely there."


def _require_heard(names: list[str], link: SensorLink, now: float) -> None:
    """At least one of them must be here to be asked."""
    states = {state.name: state.state for state in link.states(now)}
    for name in names:
        if name not in states:
            raise ValueError(f"The box knows no sensor '{name}'. {did_you_mean(name, list(states))}")
    if not any(states[name] in ("linked", "greeted") for name in names):
        raise ValueError(f"Sensor {', '.join(names)} is silent. Switch it on, and look at its battery.")


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
