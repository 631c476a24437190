"""Mappings of show.yaml: which reading of the dance drives which attribute of which fixtures, and how."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from appliance.show.config_error import did_you_mean
from appliance.show.section import Axis, Section, refusal

Metres = Annotated[tuple[float, float, float], Field(strict=False)]
Pair = Annotated[tuple[float, float], Field(strict=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Colour = Annotated[tuple[Share, Share, Share], Field(strict=False)]
Reading = Literal["place", "across", "height", "depth", "speed", "turn", "lean", "steady"]

USUAL_RANGES: dict[str, tuple[float, float]] = {
    "across": (-2.0, 2.0),  # metres
    "height": (0.0, 2.0),
    "depth": (-2.0, 2.0),
    "speed": (0.0, 2.0),  # metres a second
    "turn": (-180.0, 180.0),  # degrees
    "lean": (0.0, 90.0),
}
AIM, COLOUR = "aim", "colour"  # what a rule can drive beside attributes
MAX_RULES = 64


class RuleConfig(Section):
    """One rule: a reading of the dance drives an attribute of some fixtures."""

    fixtures: list[str] = Field(
        default_factory=list,
        max_length=512,
        description="Names of the fixtures; []: all that can do what `drives` says.",
    )
    reads: Reading = Field(
        description="place (for aim), across, height and depth in metres, speed in metres a second, turn "
        "about `axis` and lean of `axis` away from its rest direction in degrees, steady (nothing moves it)."
    )
    joint: str | None = Field(
        default=None,
        description="The joint that is read; left out: the root, and for speed the whole body's mean.",
    )
    drives: str = Field(
        min_length=1,
        max_length=64,
        description="aim (pan and tilt follow the joint), colour, dimmer, or any attribute of the profile.",
    )
    range: Pair | None = Field(
        default=None,
        description="The readings that count as 0 and 1. Left out: speed 0 to 2, height 0 to 2, across and "
        "depth -2 to 2, turn -180 to 180, lean 0 to 90.",
    )
    curve: Literal["linear", "s", "gamma", "points"] = Field(
        default="linear", description="How 0 to 1 is bent: s is gentle at both ends, gamma is slow at first."
    )
    gamma: float = Field(default=2.2, ge=0.1, le=10, description="Exponent of the curve gamma.")
    points: list[Pair] = Field(
        default_factory=list,
        max_length=32,
        description="Corners [in, out] of the curve points, each 0 to 1, in growing order.",
    )
    output: Pair = Field(
        default=(0.0, 1.0),
        description="What 0 and 1 become, as shares of the attribute's range; [1, 0] turns it round.",
    )
    value: Share = Field(default=1.0, description="For steady: what it gives, 0 to 1.")
    attack_s: float = Field(default=0.0, ge=0, le=60, description="Seconds that a rise from 0 to 1 takes.")
    release_s: float = Field(default=0.0, ge=0, le=60, description="Seconds that a fall from 1 to 0 takes.")
    colours: list[Colour] = Field(
        default_factory=list,
        max_length=16,
        description="For colour: from 0 to 1 through these, each [red, green, blue] as shares 0 to 1.",
    )
    axis: Axis = Field(
        default=(0.0, 1.0, 0.0),
        description="For turn and lean: the axis (x, y, z) in the joint's rest pose; [0, 1, 0] is upwards.",
    )
    relative: bool = Field(
        default=False, description="For turn and lean: count from the parent joint instead of the stage."
    )
    offset: Metres = Field(
        default=(0.0, 0.0, 0.0), description="For aim: metres (x, y, z) beside the joint to aim at."
    )
    at: Metres | None = Field(
        default=None, description="For aim with steady: the point on the stage (x, y, z), metres."
    )
    mix: Literal["last", "highest", "sum", "product"] = Field(
        default="last",
        description="When an earlier rule of the set drives the same attribute: the last one counts, the "
        "highest, their sum or their product.",
    )

    @field_validator("joint")
    @classmethod
    def _in_the_skeleton(cls, name: str | None, info: ValidationInfo) -> str | None:
        joints: Sequence[str] | None = (info.context or {}).get("joints")
        if name is not None and joints is not None and name not in joints:
            raise refusal(f"The skeleton has no joint '{name}'.", did_you_mean(name, joints))
        return name

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
        for is_wrong, at, message, cure in self._faults():
            if is_wrong:
                raise refusal(message, cure, at=at)
        return self

    def _faults(self) -> Sequence[tuple[bool, str, str, str]]:
        place, aims = self.reads == "place", self.drives == AIM
        return (
            (
                place and not aims,
                "drives",
                f"A place drives the aim, not '{self.drives}'.",
                "Read across, height or depth for a single attribute.",
            ),
            (
                aims and not place and self.reads != "steady",
                "reads",
                f"'{self.reads}' is a number; aim needs a place.",
                "Write `reads: place`, or steady with `at: [x, y, z]`.",
            ),
            (
                aims and self.reads == "steady" and self.at is None,
                "reads",
                "A steady aim needs a point.",
                "Add `at: [x, y, z]` in metres on the stage.",
            ),
            (
                self.drives == COLOUR and not self.colours,
                "drives",
                "This rule names no colour.",
                "Add `colours:` with at least one [red, green, blue], shares 0 to 1.",
            ),
            (
                (self.curve == "points") != bool(self.points),
                "points" if self.points else "curve",
                "The curve 'points' and its points belong together.",
                "Write both or neither: `curve: points` and `points: [[0, 0], [0.3, 0.8], [1, 1]]`.",
            ),
            (
                not _growing(self.points),
                "points",
                "The points are not in growing order within 0 to 1.",
                "Write [in, out] pairs with growing first numbers.",
            ),
        )

    @property
    def ends(self) -> tuple[float, float]:
        """The readings that count as 0 and 1; for place and steady of no meaning."""
        return self.range or USUAL_RANGES.get(self.reads, (0.0, 1.0))


def _growing(points: Sequence[tuple[float, float]]) -> bool:
    inside = all(0 <= part <= 1 for point in points for part in point)
    return inside and all(a[0] < b[0] for a, b in pairwise(points))


class MappingConfig(Section):
    """A set of rules under a name: one is in force at a time; cues and /lights fade from one to the next."""

    name: str = Field(min_length=1, max_length=64, description="What cues and /lights call it.")
    rules: list[RuleConfig] = Field(
        default_factory=list,
        max_length=MAX_RULES,
        description="Its rules, in this order; what none of them drives stays at the profile's default.",
    )

    @model_validator(mode="before")
    @classmethod
    def _rules_may_be_missing(cls, values: Any) -> Any:
        if isinstance(values, dict) and values.get("rules", ()) is None:
            return {**values, "rules": []}
        return values
