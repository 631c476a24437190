"""Names in commands: those that the show on stage has, or a sentence about the nearest one."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.outputs.shared_frame import Facts
from appliance.show.config_error import did_you_mean


def joint_name(joint: str | int, facts: Facts | None) -> str:
    """A joint's name; commands may give its number in the skeleton. Raises ValueError."""
    if isinstance(joint, str):
        return joint
    names = danced(facts).skeleton.names
    if not 0 <= joint < len(names):
        raise ValueError(f"There is no joint {joint}: this skeleton has joints 0 to {len(names) - 1}.")
    return names[joint]


def danced(facts: Facts | None) -> Facts:
    """The facts, where a stage has danced. Raises ValueError."""
    if facts is None:
        raise ValueError("No stage has danced on this box yet: nothing is changed. Start it: bunraku play.")
    return facts


def held(facts: Facts) -> list[str]:
    """Names of the joints that hands hold of the puppet that cues lead."""
    return [hand.joint for hand in facts.led.hands]


def known(kind: str, name: str | int, names: Sequence[str] | None) -> str:
    """The name, if the show has it. Raises ValueError with the nearest one; `names` None: no stage so far."""
    if names is None:
        raise ValueError(
            f"No stage has danced on this box yet: whether there is a {kind} '{name}' is unknown."
        )
    if name not in names:
        cure = did_you_mean(name, names) if names else "It has none at all: show.yaml names them."
        raise ValueError(f"This show has no {kind} '{name}'. {cure}")
    return str(name)


def next_cue(cue: str, names: Sequence[str]) -> str:
    """The one after this cue in show.yaml; the first one at the beginning. Raises ValueError."""
    if not names:
        raise ValueError("This show has no cues: show.yaml names them.")
    place = names.index(cue) + 1 if cue in names else 0
    if place == len(names):
        raise ValueError(f"{cue} was the last cue. Name one, like /cue {names[0]}.")
    return names[place]
