"""Carries out orders between two ticks, those that follow from the show state as well."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from appliance.box.orders import Order
from appliance.dancer.held_positions import RemotePosition
from appliance.dancer.puppeteers import Remote
from appliance.dancer.springs import Springs
from appliance.levers.lever import Lever
from appliance.levers.table import (
    CONTINUING,
    CUE,
    DELAY,
    FEEDBACK,
    GRAVITY,
    HAND,
    ITERATIONS,
    LIVELINESS,
    PHRASE,
    RATE,
    SEED,
    SPRINGS,
    STIFFNESS,
    STORM,
    WIND,
)
from appliance.pose import quaternion
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorLink
from appliance.show.config_error import did_you_mean
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.stage_parts import StageParts

SENSOR_ORDERS = frozenset(("neutral", "heading", "strobe", "reload"))
STROBE_S = 10.0

Outcome = tuple[bool, str]
Effect = Callable[[Order, StageParts], str | None]  # a sentence, or nothing; raises ValueError


def carry_out(order: Order, parts: StageParts, wearing: SensorFit, now: float) -> Outcome:
    """Carry out any order: whether it was done, and a sentence where there is something to say about it."""
    if order.name in SENSOR_ORDERS:
        return obey_for_sensors(order, parts, wearing, now)
    return obey(order, parts)


def obey(order: Order, parts: StageParts) -> Outcome:
    """Carry out an order that is not about sensors."""
    effect = EFFECTS.get(order.name)
    if effect is None:
        return False, f"The stage knows no order '{order.name}'."
    try:
        return True, effect(order, parts) or ""
    except ValueError as error:
        return False, str(error)


def obey_for_sensors(order: Order, parts: StageParts, wearing: SensorFit, now: float) -> Outcome:
    """Carry out one of SENSOR_ORDERS: whether it was done, and a sentence for the client."""
    sensor = order.text
    try:
        if order.name == "reload":
            return True, _reload_keys(order, parts)
        if order.name == "strobe":
            _require_heard([sensor], parts.link, now)
            parts.link.strobe(sensor, now, STROBE_S)
            return True, f"{sensor} flashes for {STROBE_S:g} s."
        _require_heard(wearing.named(sensor or None), parts.link, now)
    except ValueError as error:
        return False, str(error)
    if order.name == "neutral":
        is_asked = wearing.take_neutral(sensor or None, now)
        message = "The neutral pose is taken at the next stillness: stand still now."
    else:
        is_asked = wearing.reset_heading(sensor or None, now)
        message = "Where the dancer faces now is the front."
    if is_asked:
        return True, message
    names = ", ".join(wearing.named(sensor or None))
    return False, (
        f"Not heard at this moment: {names}. Nothing is changed. Look at its light and battery, ask again."
    )


def _reload_keys(order: Order, parts: StageParts) -> str:
    parts.link.set_keys({name: SensorKey(name, *key) for name, key in order.keys.items()})
    known = f"The box knows {len(order.keys)} sensor{'' if len(order.keys) == 1 else 's'} now"
    missing = [name for name in parts.worn if name not in order.keys and not parts.link.is_foreign(name)]
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


def _iterate(order: Order, parts: StageParts) -> str:
    (coding, interaction), seconds = ITERATIONS.given(order.text, order.values)
    iterations = parts.led.iterations
    message = iterations.ask(coding, interaction, seconds)
    if iterations.asked[1] == 0 and any(puppeteer.enabled for puppeteer in parts.led.hands.puppeteers):
        message = f"{message} None of the iterations is interactive: the hands move nothing.".lstrip()
    return message


def _allow(order: Order, parts: StageParts) -> None:
    for puppet in parts.puppets:
        puppet.iterations.allow(int(order.values[0]))


def _enliven(order: Order, parts: StageParts) -> None:
    parts.liveliness.ask(*LIVELINESS.given(order.text, order.values))


def _change_seed(order: Order, parts: StageParts) -> None:
    parts.liveliness.change_seed(SEED.given(order.text, order.values)[0])


def _play(order: Order, parts: StageParts) -> str:
    return parts.led.play(order.text, *order.values)  # without a fade: the show's


def _set_rate(order: Order, parts: StageParts) -> None:
    for puppet in parts.puppets:
        puppet.motion.rate = order.values[0]


def _jump(order: Order, parts: StageParts) -> None:
    parts.led.motion.jump(order.values[0])


def _excerpt(order: Order, parts: StageParts) -> None:
    parts.led.motion.excerpt(*order.values)


def _note(order: Order, parts: StageParts) -> None:
    """Each part of a cue is an order; the journal notes its name."""


def _enable(order: Order, parts: StageParts) -> None:
    """Let a hand hold or let go; one by OSC that was told nothing yet holds its joint where it is."""
    holds, _ = HAND.given(order.text, order.values)
    for puppeteer in parts.led.hands.puppeteers:
        if puppeteer.joint == order.text:
            puppeteer.enabled = holds
            if puppeteer.enabled and isinstance(puppeteer, Remote):
                puppeteer.hold_here(_orientation(puppeteer.joint, parts).tolist())
            if puppeteer.enabled and isinstance(puppeteer, RemotePosition):
                puppeteer.hold_here(parts.led.frame.positions[puppeteer.number].tolist())


def _dance_made(order: Order, parts: StageParts) -> None:
    """Let the puppet with the number that follows the fade go over to what the generator made for it."""
    fade_s, number = order.values
    parts.puppets[int(number)].play_made(order.text, fade_s)


def _orientation(joint: str, parts: StageParts) -> quaternion.Array:
    """Where a joint is now, local to its parent; before the first tick where the phrase has it."""
    place = parts.skeleton.index(joint)
    parent, world = parts.skeleton.parents[place], parts.led.grounding.figure.world
    here: quaternion.Array = world[place]
    if not here.any():
        here = parts.led.motion.window()[0][place]
    elif parent >= 0:
        here = quaternion.multiply(quaternion.inverse(world[parent]), here)
    return here


def _go_on(lever: Lever[Any]) -> Effect:
    """A number of what goes on by itself, called as the lever is."""
    attribute = {DELAY.name: "delay_s"}.get(lever.name, lever.name)

    def go_on(order: Order, parts: StageParts) -> None:
        if parts.continuing is None:
            raise ValueError("No puppet of this show goes on by itself, and none has a partner.")
        setattr(parts.continuing, attribute, lever.given(order.text, order.values)[0])

    return go_on


def _gate(order: Order, parts: StageParts) -> None:
    """Whether the strings of all puppets drive their joints."""
    opened, seconds = order.values
    for springs in parts.springs:
        springs.turn("gate", (opened,), seconds)


def _call_springs(order: Order, parts: StageParts) -> None:
    springs = _springs(parts)
    setting, seconds = SPRINGS.given(order.text, order.values)
    if setting not in springs.settings:
        raise ValueError(f"There is no setting of springs '{setting}' in this show.")
    springs.call(setting, seconds)


def _turn(knob: Lever[float]) -> Effect:
    def turn(order: Order, parts: StageParts) -> None:
        value, seconds = knob.given(order.text, order.values)
        _springs(parts).turn(knob.name, (value,), seconds)

    return turn


def _blow(order: Order, parts: StageParts) -> None:
    _springs(parts).turn(WIND.name, WIND.given(order.text, order.values)[0])


def _kick(order: Order, parts: StageParts) -> None:
    _springs(parts).kick(order.values)


def _springs(parts: StageParts) -> Springs:
    """Those that orders lead. Raises ValueError where there are none."""
    if parts.led.springs is None:
        raise ValueError("No hand of this show is springs. Add {springs: loose, joint: ...} to its hands.")
    return parts.led.springs


def _lead(order: Order, parts: StageParts) -> None:
    """Give a joint that is held by OSC its orientation or place, or back: of each puppet with such a hand."""
    puppeteers = [one for puppet in parts.puppets for one in puppet.hands.puppeteers]
    led = [one for one in puppeteers if isinstance(one, Remote | RemotePosition) and one.joint == order.text]
    if not led:
        raise ValueError(
            f"No hand of this show holds '{order.text}' by OSC. "
            f"Add {{osc: true, joint: {order.text}}} to its hands."
        )
    if order.name == "release":
        for puppeteer in led:
            puppeteer.let_go()
        return
    wanted = RemotePosition if order.name == "place" else Remote
    led = [one for one in led if isinstance(one, wanted)]
    if not led:
        given, address, cure = (
            ("an orientation", "rot", ", or write by: position in show.yaml")
            if order.name == "place"
            else ("a position", "pos", "")
        )
        raise ValueError(f"The hand on '{order.text}' takes {given}: send /mocap/setjoint{address}{cure}.")
    for puppeteer in led:
        if isinstance(puppeteer, RemotePosition):
            puppeteer.hold(order.values[:3], *order.values[3:])
        else:
            x, y, z, angle = order.values
            puppeteer.hold_axis_angle((x, y, z), angle)


EFFECTS: dict[str, Effect] = {
    PHRASE.name: _play,
    RATE.name: _set_rate,
    HAND.name: _enable,
    ITERATIONS.name: _iterate,
    LIVELINESS.name: _enliven,
    SEED.name: _change_seed,
    SPRINGS.name: _call_springs,
    WIND.name: _blow,
    **{knob.name: _turn(knob) for knob in (STIFFNESS, STORM, FEEDBACK, GRAVITY)},
    **{one.name: _go_on(one) for one in CONTINUING},
    CUE.name: _note,
    "hold": _lead,
    "place": _lead,
    "release": _lead,
    "jump": _jump,
    "excerpt": _excerpt,
    "kick": _kick,
    "gate": _gate,
    "made": _dance_made,
    "allow": _allow,
}
