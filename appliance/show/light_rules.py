"""Mappings of show.yaml: which reading of the dance drives which attribute of which fixtures, and how."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, field_validator, model_validator

from appliance.show.fixture_profile import DIMMER
from appliance.show.section import Axis, Joint, Section, key, refusal
from appliance.show.venue_lights import Metres

TwoNumbers = Annotated[tuple[float, float], Field(strict=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Colour = Annotated[tuple[Share, Share, Share], Field(strict=False)]
Feature = Literal["qom", "weight_effort", "time_effort", "flow_effort", "space_effort"]
ReadValue = Literal[
    "place", "across", "height", "depth", "speed", "turn", "lean", "answer", "steady", Feature
]
FEATURES: tuple[Feature, ...] = get_args(Feature)
Mover = Literal["hand", "live"]  # what moves and is no puppet

USUAL_RANGES: dict[str, tuple[float, float]] = {
    "across": (-2.0, 2.0),  # metres
    "height": (0.0, 2.0),
    "depth": (-2.0, 2.0),
    "speed": (0.0, 2.0),  # metres a second
    "turn": (-180.0, 180.0),  # degrees
    "lean": (0.0, 90.0),
    "answer": (0.0, 25.0),
    "qom": (0.0, 2.0),  # metres a second
    "weight_effort": (0.0, 4.0),  # (metres a second)^2
    "time_effort": (0.0, 20.0),  # metres a second^2
    "flow_effort": (0.0, 1000.0),  # metres a second^3
    "space_effort": (1.0, 4.0),
}
# A hand's turns are in radians. 95 % of the forearms of recorded dancers stay below these.
HAND_RANGES: dict[str, tuple[float, float]] = {
    "qom": (0.0, 7.0),
    "weight_effort": (0.0, 100.0),
    "time_effort": (0.0, 50.0),
    "flow_effort": (0.0, 2500.0),
    "space_effort": (1.0, 4.0),
}
LIVE_READS = ("speed", "across", "height", "depth", *FEATURES)  # a stream of positions says no more
AIM, COLOUR = "aim", "colour"  # what a rule can drive in addition to attributes
# Dimmers and colours rise by at most 26 of 255 levels in a pass and fall by 8. Faster light flickers.
USUAL_ATTACK_S, USUAL_RELEASE_S = 0.25, 0.8
MAX_RULES = 64


class RuleConfig(Section):
    """One rule: a reading of the dance drives an attribute of some fixtures."""

    fixtures: list[str] = key(
        "Names of the fixtures; []: all that have what `drives` names.", [], length=(0, 512)
    )
    reads: ReadValue = key(
        "place (for aim), across, height and depth in metres, speed in metres a second, turn "
        "about `axis` and lean of `axis` away from its rest direction in degrees, steady (a constant); "
        "answer: how far a hand takes the body from its phrase, in degrees, the mean of the joints that are "
        "not held; of the whole body qom (quantity of motion) and the efforts after Laban."
    )
    joint: Joint | None = key(
        "The joint that is read; default: the root, and for speed the whole body's mean.", None
    )
    puppet: str | None = key(
        "In a show with several puppets, the name of the one that is read; default: the first.",
        None,
        length=(1, 32),
    )
    of: Mover | None = key(
        "hand: reads the hand that holds `joint` (default: the puppet's first), qom and the efforts of its "
        "turns; live: reads the live dancer instead of a puppet. null: the puppet.",
        None,
    )
    drives: str = key(
        "aim (pan and tilt follow the joint), colour, dimmer, or any attribute of the profile.",
        length=(1, 64),
    )
    range: TwoNumbers | None = key(
        "The readings that count as 0 and 1. Defaults: speed 0 to 2, height 0 to 2, across and "
        "depth -2 to 2, turn -180 to 180, lean 0 to 90, answer 0 to 25; qom 0 to 2, weight_effort 0 to 4, "
        "time_effort 0 to 20, flow_effort 0 to 1000, space_effort 1 to 4; of a hand, in radians, qom 0 to 7, "
        "weight_effort 0 to 100, time_effort 0 to 50, flow_effort 0 to 2500.",
        None,
    )
    curve: Literal["linear", "s", "gamma", "points"] = key(
        "Response from 0 to 1: s is gentle at both ends, gamma is slow at first.", "linear"
    )
    gamma: float = key("Exponent of the curve gamma.", 2.2, within=(0.1, 10))
    points: list[TwoNumbers] = key(
        "Breakpoints [in, out] of the curve points, each 0 to 1, in ascending order.", [], length=(0, 32)
    )
    output: TwoNumbers = key(
        "The output at 0 and at 1, as fractions of the attribute's range; [1, 0] inverts it.", (0.0, 1.0)
    )
    value: Share = key("For steady: its value, 0 to 1.", 1.0)
    attack_s: float | None = key(
        "Seconds for a rise from 0 to 1. null: 0.25 for dimmer and colour, else 0.", None, within=(0, 60)
    )
    release_s: float | None = key(
        "Seconds for a fall from 1 to 0. null: 0.8 for dimmer and colour, else 0.", None, within=(0, 60)
    )
    colours: list[Colour] = key(
        "For colour: from 0 to 1 through these, each [red, green, blue] from 0 to 1.", [], length=(0, 16)
    )
    axis: Axis = key(
        "For turn and lean: the axis (x, y, z) in the joint's rest pose; [0, 1, 0] is upwards.",
        (0.0, 1.0, 0.0),
    )
    relative: bool = key("For turn and lean: measured from the parent joint instead of the stage.", False)
    offset: Metres = key("For aim: offset (x, y, z) from the joint, metres.", (0.0, 0.0, 0.0))
    at: Metres | None = key("For aim with steady: the point on the stage (x, y, z), metres.", None)
    mix: Literal["last", "highest", "sum", "product"] = key(
        "When an earlier rule of the set drives the same attribute: the last one wins, the "
        "highest, their sum or their product.",
        "last",
    )

    @field_validator("range")
    @classmethod
    def _has_a_width(cls, given: tuple[float, float] | None) -> tuple[float, float] | None:
        if given is not None and abs(given[1] - given[0]) < 1e-6:
            raise refusal("Both ends of the range are equal.", "Write two different readings.")
        return given

    @field_validator("output")
    @classmethod
    def _shares(cls, given: tuple[float, float]) -> tuple[float, float]:
        if not all(0 <= end <= 1 for end in given):
            raise refusal(f"{list(given)} leaves the attribute's range.", "Write shares from 0 to 1.")
        return given

    @model_validator(mode="after")
    def _consistent(self) -> RuleConfig:
        place, aims = self.reads == "place", self.drives == AIM
        can = {"hand": FEATURES, "live": LIVE_READS}.get(self.of or "")
        if can is not None and self.reads not in can:
            cure = f"Read one of {', '.join(can)}, or remove `of`."
            raise refusal(f"'{self.reads}' cannot be read of '{self.of}'.", cure, "reads")
        if self.of == "live" and self.puppet is not None:
            raise refusal("A live dancer is no puppet.", "Remove `puppet` or `of`.", "puppet")
        if place and not aims:
            cure = "Read across, height or depth for a single attribute."
            raise refusal(f"A place drives the aim, not '{self.drives}'.", cure, "drives")
        if aims and not place and self.reads != "steady":
            cure = "Write `reads: place`, or steady with `at: [x, y, z]`."
            raise refusal(f"'{self.reads}' is a number; aim needs a place.", cure, "reads")
        if aims and self.reads == "steady" and self.at is None:
            raise refusal(
                "A steady aim needs a point.", "Add `at: [x, y, z]` in metres on the stage.", "reads"
            )
        if self.drives == COLOUR and not self.colours:
            cure = "Add `colours:` with at least one [red, green, blue], shares 0 to 1."
            raise refusal("This rule names no colour.", cure, "drives")
        if (self.curve == "points") != bool(self.points):
            cure = "Write both or neither: `curve: points` and `points: [[0, 0], [0.3, 0.8], [1, 1]]`."
            at = "points" if self.points else "curve"
            raise refusal("The curve 'points' and its points belong together.", cure, at)
        if not _growing(self.points):
            cure = "Write [in, out] pairs with growing first numbers."
            raise refusal("The points are not in growing order within 0 to 1.", cure, "points")
        return self

    @property
    def eases_s(self) -> tuple[float, float]:
        """Seconds for a rise from 0 to 1, and for a fall."""
        is_light = self.drives in (DIMMER, COLOUR)
        usual = (USUAL_ATTACK_S, USUAL_RELEASE_S) if is_light else (0.0, 0.0)
        attack_s, release_s = self.attack_s, self.release_s
        return usual[0] if attack_s is None else attack_s, usual[1] if release_s is None else release_s

    @property
    def ends(self) -> tuple[float, float]:
        """The readings that count as 0 and 1; for place and steady of no meaning."""
        usual = HAND_RANGES if self.of == "hand" else USUAL_RANGES
        return self.range or usual.get(self.reads, (0.0, 1.0))


def _growing(points: Sequence[tuple[float, float]]) -> bool:
    inside = all(0 <= part <= 1 for point in points for part in point)
    return inside and all(a[0] < b[0] for a, b in pairwise(points))


class MappingConfig(Section):
    """A set of rules under a name: one is in force at a time; cues and /lights fade from one to the next."""

    name: str = key("Name for cues and /lights.", length=(1, 64))
    rules: list[RuleConfig] = key(
        "Its rules, in order; an attribute that none of them drives stays at the profile's default.",
        [],
        length=(0, MAX_RULES),
    )

    @model_validator(mode="before")
    @classmethod
    def _rules_may_be_missing(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("rules", ()) is None:
            return {**values, "rules": []}
        return values
