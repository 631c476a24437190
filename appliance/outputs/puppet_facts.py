"""Facts about the puppets of a show, for readers of the shared frame; without numpy."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from appliance.levers.sources import LIVE
from appliance.outputs.frame_layout import FrameLayout


class HandFacts(NamedTuple):
    """A hand: the joint that it holds, its source (a sensor's name, or its kind), orientation or position."""

    joint: str
    source: str
    by: str = "orientation"


class PuppetFacts(NamedTuple):
    """A puppet. name: "" in a show that has one without a name; is_led: cues and orders lead it."""

    name: str = ""
    hands: tuple[HandFacts, ...] = ()
    is_led: bool = True

    def packed(self) -> dict[str, Any]:
        return self._asdict() | {"hands": [hand._asdict() for hand in self.hands]}


def unpacked(puppets: Iterable[Mapping[str, Any]]) -> tuple[PuppetFacts, ...]:
    """From JSON. Raises ValueError, KeyError or TypeError for foreign data."""
    found = tuple(
        PuppetFacts(one["name"], tuple(HandFacts(**hand) for hand in one["hands"]), one["is_led"])
        for one in puppets
    )
    led_by(found)
    return found


def led_by(puppets: Iterable[PuppetFacts]) -> PuppetFacts:
    """The puppet that cues and orders lead. Raises ValueError where none is led, or several are."""
    (led,) = (one for one in puppets if one.is_led)
    return led


def layout_of(joints: int, puppets: Sequence[PuppetFacts], phrases: Collection[str]) -> FrameLayout:
    """How the frames of a show lie, for its writer and for each reader."""
    hands = sum(len(one.hands) for one in puppets)
    return FrameLayout(joints, len(puppets), hands, joints if LIVE in phrases else 0)
