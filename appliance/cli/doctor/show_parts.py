"""Each sensor, receiver and wire of the show that dances here: one line for each, and a lost one is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from appliance.box.roster import Roster, RosterLine
from appliance.cli.doctor.finding import Finding, better, ok, wrong
from appliance.cli.doctor.host_view import HostView
from appliance.cli.sensors.table import HIGH_LOSS, duration
from appliance.sensor.state import LOW_BATTERY
from appliance.sensor.wire import BATTERY_UNKNOWN
from appliance.show.config_error import ConfigError
from appliance.show.programs import SOURCES
from appliance.show.show import load_show

_SPARE = "Or put a spare in its place: `bunraku sensors replace {name} SPARE`."
_PROGRAM = "Start the program that sends it; for a phone, open the page there. It is under sensors: foreign."
_STATES = {  # a sensor that does not send: what happened, what to do
    "greeted": ("It greets the box, and sends nothing yet", "Wait for a breath, then switch it off and on."),
    "lost": ("It is lost{ago}", "Check its battery, switch it on, and look at its network."),
    "absent": ("It was not heard since the box was switched on", "Charge it, and switch it on."),
}


def sensors(host: HostView) -> Iterator[Finding]:
    """Those that the show wears: by name, whether they send."""
    if host.stage is None:
        return
    for line in Roster.reported(host.stage.health).lines:
        if line.neutral:
            yield _sensor(line)
    for name in host.stage.health.get("not_let_in") or ():
        yield wrong(
            f"sensor {name}",
            "The show wears it, and it has no key here: it is not let in, and its joint moves freely.",
            f"`bunraku provision --name {name}`, or `bunraku sensors rename SPARE {name}`.",
        )


def _sensor(line: RosterLine) -> Finding:
    what = f"sensor {line.name}"
    if line.state in _STATES:
        message, cure = _STATES[line.state]
        ago = f", last heard {duration(line.age_s)} ago" if line.age_s >= 0 else ""
        if line.way in SOURCES:
            cure = _PROGRAM
        else:
            cure = line.complaint or f"{cure} {_SPARE.format(name=line.name)}"
        return wrong(what, f"{message.format(ago=ago)}: its joint moves freely.", cure)
    known = line.battery != BATTERY_UNKNOWN
    battery = f"its battery is at {line.battery} %" if known else "its battery is not known"
    if known and line.battery_left_s >= 0:
        battery += f" and lasts about {duration(line.battery_left_s)} yet"
    message = f"It sends {line.rate_hz:.0f} readings a second; {100 * line.loss:.1f} % are lost; {battery}."
    if line.complaint:
        return better(what, f"{message} {line.complaint}", "See to that before the doors open.")
    if line.battery < LOW_BATTERY:
        return better(what, message, "Charge it, or wear a spare.")
    if line.loss > HIGH_LOSS:
        return better(what, message, "Another channel of the Wi-Fi, or the router nearer to the stage.")
    return ok(what, message)


def receivers(host: HostView) -> Iterator[Finding]:
    """Where the dance goes: by address, whether it leaves for there."""
    for one in (host.stage.health.get("receivers") or ()) if host.stage is not None else ():
        what, error = f"receiver {one.get('name')}", one.get("error") or "it was dropped"
        if one.get("gone"):
            yield wrong(
                what,
                f"It does not get the dance: {error}. The others do, and it is tried again each second.",
                "Start it, or check its address in the box file.",
            )
        elif not one.get("asked_for", True):
            yield ok(what, "The box file names no receiver: this is the usual one, for a trial.")
        else:
            yield ok(what, "The dance leaves for it.")


def wires(host: HostView) -> Iterator[Finding]:
    """How the lights are reached: by wire, whether the light leaves."""
    if host.stage is None or not host.box.outputs.dmx:
        return
    lights = next((one for one in host.stage.members if one.process == "lights"), None)
    if lights is None and not _has_fixtures(host.stage.show):
        yield ok("lights", "This show has no lamps: the wires of the box file rest.")
        return
    if lights is None or lights.late:
        yield wrong(
            "lights",
            "The box file names wires to the lights, and no process lights them: they stay as they are.",
            "`journalctl -b -u bunraku-lights` says why.",
        )
        return
    for name, trouble in lights.parts.items():
        if trouble:
            yield wrong(name, f"{trouble.removeprefix(f'{name}: ')}", "Plug it in, or switch its node on.")
        else:
            yield ok(name, "The light leaves by it.")


def _has_fixtures(show: Path | None) -> bool:
    """Also where the show cannot be read: then its lamps are missed."""
    try:
        return show is None or bool(load_show(show).config.lights.fixtures)
    except (ConfigError, OSError):
        return True
