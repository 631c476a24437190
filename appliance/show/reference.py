"""docs/configuration.md from the models: `python -m appliance.show.reference > docs/configuration.md`."""

from __future__ import annotations

from inspect import cleandoc
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from appliance.show import describe
from appliance.show.box import BoxConfig
from appliance.show.hand import HandConfig
from appliance.show.section import Section
from appliance.show.show import ShowConfig

_INTRODUCTION = """\
# Configuration

<!-- Made by `python -m appliance.show.reference > docs/configuration.md`; edit the models instead. -->

Two YAML files. `show.yaml` belongs to the artist and is part of the show bundle; `box.yaml` belongs to the
venue and is given with `--box`. Every key may be left out unless it is marked **needed**. An unknown key, a
word in place of a number or a value out of bounds is refused with file, line, the nearest known key and what
to do; all faults of a file are listed at once. `bunraku check SHOW --box FILE` tells without dancing.

Numbers are written without quotes and without an exponent (`0.001`). Axes are right-handed
with Y up, lengths in metres. Addresses are IPv4 in numbers, because looking up a name could hold up the show.

An orientation is a unit quaternion, `[w, x, y, z]`, or is written in degrees: `{euler: {x: 90, z: -30}}`
turns about x, then about y, then about z, axes that stay where they are (one that is left out has no turn);
`{axis: [0, 1, 0], angle: 90}` turns about one axis, by the right-hand rule.
"""

_SHOW_EXAMPLE = """\
```yaml
name: An evening with one sensor
dancer:
  coding_iterations: 10       # more: away from the phrase, towards the dancer's habits
  interaction_iterations: 9   # the last pass is free, so nothing mirrors the hand
motion:
  phrase: phrase.bvh          # the show starts with it; cues call it main
  phrases:
    quiet: quiet.bvh
hands:
  - sensor: left-wrist
    joint: lShldr
  - turning: {axis: [0, 1, 0], seconds_per_turn: 5}
    joint: head
    weight: 0.5
looks:                        # the first one is shown at the start
  - name: marble
    style: plaster
    figure: '#f2e6d8'
    camera: {move: orbit, period_s: 120}
  - {name: wires, style: lines}
lights:
  fixtures:
    - {name: spot left, profile: moving-spot, universe: 1, address: 1, place: [2, 4, 3]}
    - {name: wash, profile: led-par, universe: 1, address: 101, place: [0, 4, 2]}
  mappings:                   # the first set is in force at the start
    - name: warm
      rules:
        - {reads: place, joint: lShldr, drives: aim, fixtures: [spot left]}
        - {reads: qom, drives: dimmer, output: [0.1, 0.5], attack_s: 1.5, release_s: 3}
        - {reads: speed, joint: lShldr, drives: dimmer, mix: highest}
cues:                         # /cue storm, or /cue alone for the next one
  - name: storm
    phrase: main
    iterations: [10, 9]
    hands: [lShldr]           # its hand holds; the other one lets go
    look: wires
    lights: warm
    fade_s: 4
  - {name: end, phrase: quiet, hands: [], master: 0.2, fade_s: 10}
```
"""

_BOX_EXAMPLE = """\
```yaml
sensors:
  udp: {host: 0.0.0.0, port: 9750}
  keys: sensors.keys
outputs:
  osc:
    - {host: 192.168.0.20, port: 9004, dialect: ai-toolbox}
    - {host: 192.168.0.21, port: 39539, dialect: vmc}
  posistagenet:
    - {interface: 192.168.0.10, joints: [head, lHand, rHand]}
  dmx:
    - {universe: 1, wire: sacn, interface: 192.168.0.10}
    - {universe: 2, wire: usb-pro, device: /dev/ttyUSB0}
control:
  host: 0.0.0.0
  senders: [192.168.0.30]     # the lighting desk; beside it, only this machine is heard
  heartbeat: [{host: 192.168.0.30}]
projector:
  mirror: true                # it stands behind the screen
```
"""


def reference() -> str:
    """The whole page."""
    parts = [
        _INTRODUCTION,
        "## show.yaml\n",
        _SHOW_EXAMPLE,
        *_tables(ShowConfig, ""),
        "## box.yaml\n",
        "Without a box file everything is at its default: only this machine.\n",
        _BOX_EXAMPLE,
        *_tables(BoxConfig, ""),
    ]
    return "\n".join(parts)


def _tables(model: type[Section], path: str) -> list[str]:
    """This section's table and those of the sections in it."""
    parts = [f"### {path}\n\n{cleandoc(model.__doc__ or '')}\n"] if path else []
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    rows += [_row(key, field) for key, field in describe.keys(model).items()]
    parts.append("\n".join(rows) + "\n")
    for name, field in describe.keys(model).items():
        below = describe.section(field.annotation)
        if below:
            place = f"{path}.{name}" if path else name
            if path and below is HandConfig:
                parts.append(f"### {place}[ ]\n\nAs [hands[ ]](#hands-) of the show.\n")
                continue
            parts += _tables(below, f"{place}[ ]" if describe.is_list(field.annotation) else place)
    return parts


def _row(name: str, field: FieldInfo) -> str:
    limits = describe.bounds(field)
    value = describe.kind(field.annotation) + (f", {limits}" if limits else "")
    meaning = cleandoc(field.description or "").partition("\n\n")[0].replace("\n", " ")
    return f"| `{name}` | {value} | {_default(field)} | {meaning} |"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**needed**"
    return _shown(field.get_default(call_default_factory=True, validated_data={}))


def _shown(value: Any) -> str:
    if isinstance(value, BaseModel):
        return "its own defaults"
    if isinstance(value, list) and value and isinstance(value[0], BaseModel):
        return "one receiver with the defaults below"
    if isinstance(value, tuple | list):
        return f"`{_listed(value)}`"
    if isinstance(value, str) and value.startswith("#"):  # without quotes YAML takes it for a comment
        return f"`'{value}'`"
    words = {None: "null", True: "true", False: "false", "": '""'}
    return f"`{words[value] if isinstance(value, bool) or value in (None, '') else value}`"


def _listed(value: Any) -> str:
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_listed, value))}]"
    return value if isinstance(value, str) else f"{value:g}"


if __name__ == "__main__":
    print(reference(), end="")
