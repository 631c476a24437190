"""Carries out orders between two ticks: phrases, cues, playback, iterations, hands, sensors."""

from __future__ import annotations

from appliance.dancer.puppeteers import Puppeteer, Remote
from appliance.pose import quaternion
from appliance.sensor.link import SensorLink
from appliance.show.config_error import did_you_mean
from appliance.show.cues import CueConfig
from appliance.show_control.orders import Order
from appliance.stage.iterations import Iterations
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.stage_parts import StageParts

SENSOR_ORDERS = frozenset(("neutral", "heading", "strobe", "reload"))
STROBE_S = 10.0

Outcome = tuple[bool, str]


def carry_out(
    order: Order, cast: StageParts, iterations: Iterations, wearing: SensorFit, usual_rate: float, now: float
) -> Outcome:
    """Carry out any order: whether it was done, and a sentence where there is something to say about it."""
    if order.name in SENSOR_ORDERS:
        return obey_for_sensors(order, cast, wearing, now)
    return obey(order, cast, iterations, usual_rate)


def obey(order: Order, cast: StageParts, iterations: Iterations, usual_rate: float) -> Outcome:
    """Carry out one order: whether it was done, and a sentence where there is something to say about it."""
    try:
        if order.name in ("hold", "release"):
            _turn(order, cast)
        elif order.name == "hand":
            return True, _hold(order, cast)
        elif order.name == "iterations":
            coding, interaction = (int(value) for value in order.values)
            words = iterations.ask(coding, interaction)
            if iterations.asked[1] == 0 and any(puppeteer.enabled for puppeteer in cast.hands.puppeteers):
                words = f"{words} None of the iterations is interactive: the hands move nothing.".lstrip()
            return True, words
        elif order.name == "phrase":
            name = str(order.text)
            goes_over = cast.motion.play(name, *order.values)
            return True, "" if goes_over else f"The phrase '{name}' plays already, and goes on."
        elif order.name == "cue":
            cue = _cue(str(order.text), cast)
            return True, _fire(cue, cast, iterations, cue.fade_s)
        else:
            _play(order, cast, usual_rate)
    except ValueError as error:
        return False, str(error)
    return True, ""


def resume(name: str, cast: StageParts, iterations: Iterations) -> str:
    """Before the first tick: begin in the cue that was in force; a sentence about it, "" for no such cue."""
    cue = cast.cues.get(name)
    if cue is None:
        return ""
    if cue.phrase is not None:
        cast.motion.start_with(cue.phrase)
    return f"The show goes on in the cue '{name}'. {_fire(cue, cast, iterations, 0.0)}".rstrip()


def obey_for_sensors(order: Order, cast: StageParts, wearing: SensorFit, now: float) -> Outcome:
    """Carry out one of SENSOR_ORDERS: whether it was done, and a sentence for who asked."""
    sensor = str(order.text)
    try:
        if order.name == "reload":
            return True, _admit(order, cast)
        if order.name == "strobe":
            _require_heard([sensor], cast.link, now)
            cast.link.strobe(sensor, now, STROBE_S)
            return True, f"{sensor} flashes for {STROBE_S:g} s."
        _require_heard(wearing.named(sensor or None), cast.link, now)
    except ValueError as error:
        return False, str(error)
    if order.name == "neutral":
        is_asked = wearing.take_neutral(sensor or None, now)
        words = "The neutral pose is taken at the next stillness: stand still now."
    else:
        is_asked = wearing.reset_heading(sensor or None, now)
        words = "Where the dancer faces now is the front."
    if is_asked:
        return True, words
    names = ", ".join(wearing.named(sensor or None))
    return False, (
        f"Not heard at this moment: {names}. Nothing is changed. Look at its light and battery, ask again."
    )


def _admit(order: Order, cast: StageParts) -> str:
    cast.link.set_keys(order.keys)
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


def _play(order: Order, cast: StageParts, usual_rate: float) -> None:
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
    else:
        raise ValueError(f"The stage knows no order '{order.name}'.")


def _cue(name: str, cast: StageParts) -> CueConfig:
    if name not in cast.cues:
        if not cast.cues:
            raise ValueError("This show has no cues. Write some under `cues` in its show.yaml.")
        raise ValueError(f"This show has no cue '{name}'. {did_you_mean(name, list(cast.cues))}")
    return cast.cues[name]


def _fire(cue: CueConfig, cast: StageParts, iterations: Iterations, fade_s: float) -> str:
    """What of a cue concerns the dance; its names were checked when the show was read."""
    words = ""
    if cue.phrase is not None:
        cast.motion.play(cue.phrase, fade_s)
    if cue.iterations is not None:
        words = iterations.ask(*cue.iterations, fade_s)
    if cue.hands is not None:
        for puppeteer in cast.hands.puppeteers:
            _enable(puppeteer, puppeteer.joint in cue.hands, cast)
    cast.cue = cue.name
    return words


def _hold(order: Order, cast: StageParts) -> str:
    """Let the hand of a joint hold or let go; says which joint, where it was asked for by its number."""
    name, holds = _joint(order.text, cast), bool(order.values[0])
    for puppeteer in cast.hands.puppeteers:
        if puppeteer.joint == name:
            _enable(puppeteer, holds, cast)
            return f"The hand of {name} {'holds' if holds else 'lets go'}."
    held = [puppeteer.joint for puppeteer in cast.hands.puppeteers]
    cure = did_you_mean(name, held) if held else "Give it some under `hands` in its show.yaml."
    raise ValueError(f"No hand of this show holds '{name}'. {cure}")


def _enable(puppeteer: Puppeteer, holds: bool, cast: StageParts) -> None:
    puppeteer.enabled = holds
    if holds and isinstance(puppeteer, Remote):
        puppeteer.hold_here(_orientation(puppeteer.joint, cast).tolist())


def _orientation(joint: str, cast: StageParts) -> quaternion.Array:
    """Where a joint is now, local to its parent; before the first tick where the phrase has it."""
    place = cast.skeleton.index(joint)
    parent, world = cast.skeleton.parents[place], cast.grounding.figure.world
    here: quaternion.Array = world[place]
    if not here.any():
        here = cast.motion.window()[0][place]
    elif parent >= 0:
        here = quaternion.multiply(quaternion.inverse(world[parent]), here)
    return here


def _turn(order: Order, cast: StageParts) -> None:
    """Give a joint that is held by OSC its orientation, or back to the puppet."""
    name = _joint(order.text, cast)
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


def _joint(joint: str | int, cast: StageParts) -> str:
    """A joint's name; it may be asked for by its number in the skeleton."""
    if isinstance(joint, str):
        return joint
    if not 0 <= joint < len(cast.skeleton):
        raise ValueError(
            f"There is no joint {joint}: this skeleton has joints 0 to {len(cast.skeleton) - 1}."
        )
    return cast.skeleton.names[joint]
