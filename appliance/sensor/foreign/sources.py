"""Datagrams of programs as orientations of one sensor: OSC of any address, bones of VMC, bones of mocopi."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from appliance.pose.turns import UNTURNED, multiplied
from appliance.sensor.foreign.mocopi import MOCOPI_PARENTS
from appliance.sensor.foreign.orientations import (
    CONVENTIONS,
    facing_front,
    read_orientation,
)
from appliance.sensor.state import Orientation
from appliance.show.programs import PROGRAMS

Messages = Iterable[tuple[str, Sequence[object]]]
BONE, ROOT = "/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"
_WHOLE = (BONE, *(f"/VMC/Ext/{kind}/Pos" for kind in ("Tra", "Con", "Hmd")))
_FRESH_S = 0.5  # a bone above that did not come for longer counts as upright
_SIDES = ("Left", "Right")
_VMC_PARENTS = {
    "Spine": "Hips",
    "Chest": "Spine",
    "UpperChest": "Chest",
    "Neck": "UpperChest",
    "Head": "Neck",
    **{f"{side}Shoulder": "UpperChest" for side in _SIDES},
    **{f"{side}UpperArm": f"{side}Shoulder" for side in _SIDES},
    **{f"{side}LowerArm": f"{side}UpperArm" for side in _SIDES},
    **{f"{side}Hand": f"{side}LowerArm" for side in _SIDES},
    **{f"{side}UpperLeg": "Hips" for side in _SIDES},
    **{f"{side}LowerLeg": f"{side}UpperLeg" for side in _SIDES},
    **{f"{side}Foot": f"{side}LowerLeg" for side in _SIDES},
    **{f"{side}Toes": f"{side}Foot" for side in _SIDES},
    "Hips": ROOT,
}


class OscSource:
    """The numbers behind one OSC address (`*` and `?` stand for any letters)."""

    def __init__(self, address: str, values: str, axes: str, facing: str) -> None:
        self._address, self._values, self._axes = address, values, CONVENTIONS[axes]
        self._front = facing_front(self._axes.direction(facing or self._axes.front))

    def hear(self, messages: Messages, now: float) -> Orientation | None:
        """The newest orientation in a datagram; None: it holds none. Raises ValueError with a sentence."""
        found = None
        for address, arguments in messages:
            if fnmatchcase(address, self._address):
                try:
                    found = read_orientation(self._values, arguments)
                except ValueError as error:
                    raise ValueError(f"{address}: {error}") from None
        return None if found is None else multiplied(self._axes.to_sensor(found), self._front)


class BoneSource:
    """One bone of a figure, or one tracker, by VMC's addresses.

    Bones turn against the bone above. The orientation in the room is the product over all bones above it that
    came within half a second; a bone that does not come counts as upright. Names match in any case.
    """

    def __init__(self, bone: str, axes: str, facing: str, parents: dict[str, str] | None = None) -> None:
        self._bone = bone.casefold()
        self._axes = CONVENTIONS[axes]
        self._front = facing_front(self._axes.direction(facing or self._axes.front))
        above = {name.casefold(): up.casefold() for name, up in (parents or _VMC_PARENTS).items()}
        self._chain = [self._bone]
        while (up := above.get(self._chain[-1])) is not None:
            self._chain.append(up)
        self._known: dict[str, tuple[float, Orientation]] = {}

    def hear(self, messages: Messages, now: float) -> Orientation | None:
        """The bone's newest orientation in a datagram; the same as OscSource."""
        whole: Orientation | None = None
        came = False
        for address, arguments in messages:
            name = str(arguments[0]).casefold() if arguments else ""
            if address == ROOT:
                name = ROOT.casefold()
            elif address not in _WHOLE:
                continue
            if name not in self._chain or (name != self._bone and address not in (BONE, ROOT)):
                continue
            try:
                turned = read_orientation("xyzw", arguments[1:8])
            except ValueError as error:
                raise ValueError(f"{address} {arguments[0] if arguments else ''}: {error}") from None
            if address in (BONE, ROOT):
                self._known[name] = now, turned
                came |= name == self._bone
            else:
                whole = turned
        if whole is None and came:
            whole = UNTURNED
            for name in reversed(self._chain):
                at, turned = self._known.get(name, (-math.inf, UNTURNED))
                if now - at <= _FRESH_S:
                    whole = multiplied(whole, turned)
        return None if whole is None else multiplied(self._axes.to_sensor(whole), self._front)


@dataclass(frozen=True)
class SourceSettings:
    """A foreign sensor as the box file has it; an empty text means the program's usual value."""

    name: str
    program: str
    address: str = ""
    values: str = ""
    axes: str = ""
    facing: str = ""
    bone: str = ""
    drifts: bool = True

    def source(self) -> OscSource | BoneSource:
        usual = PROGRAMS[self.program]
        axes = self.axes or usual.axes
        if usual.has_bones:
            parents = MOCOPI_PARENTS if self.program == "mocopi" else None
            return BoneSource(self.bone, axes, self.facing, parents)
        return OscSource(self.address or usual.address, self.values or usual.values, axes, self.facing)
