"""show.yaml's section about hands: what holds a joint, and how firmly."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from appliance.show.section import Axis, Joint, Orientation, Section, key, refusal

LONGEST_SENSOR_NAME = 24  # as in the key file (appliance/sensor/keys.py) and the wearable's flash
KINDS = ("sensor", "turning", "fixed", "kept", "osc", "springs")
SENSOR_KEYS = ("facing", "at_neutral", "neutral", "primary")  # only for a worn sensor
BY_POSITION = ("osc", "fixed")  # kinds that may give a position instead of an orientation
FARTHEST_M = 100.0  # metres from the middle of the stage: beyond is a mistake

Metres = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Position = Annotated[tuple[Metres, Metres, Metres], Field(strict=False)]


class TurningConfig(Section):
    """A hand that turns its joint at a constant rate."""

    axis: Axis = key("Axis (x, y, z) in the parent's frame, any length.", (0.0, 1.0, 0.0))
    seconds_per_turn: float = key("Seconds for one turn.", 5.0, within=(0.1, 3600))


class FixedConfig(Section):
    """A hand that holds its joint still."""

    orientation: Orientation = key("Local to the parent joint.", (1.0, 0.0, 0.0, 0.0))
    position: Position | None = key(
        "In the room, metres: x, y upwards, z. Only for `by: position`, which needs it.", None
    )


class HandConfig(Section):
    """A puppeteer's hold on one joint. Exactly one of sensor, turning, fixed, kept, osc, springs holds it."""

    sensor: str | None = key(
        "Name of the worn sensor that holds it, as in the key file.", None, length=(1, LONGEST_SENSOR_NAME)
    )
    turning: TurningConfig | None = key("The joint turns at a constant rate.", None)
    fixed: FixedConfig | None = key("The joint is held still.", None)
    kept: Literal[True] | None = key(
        "The joint is kept where the phrase has it, pose by pose; with equal interaction and "
        "coding iterations it stays there exactly.",
        None,
    )
    osc: Literal[True] | None = key("Messages to the control port hold the joint.", None)
    springs: str | None = key(
        "Springs hold the joint and everything below it that no other hand holds. The setting "
        "at the start: one under `springs`, or loose, stiff or storm.",
        None,
        length=(1, 64),
    )
    joint: Joint = key("Name of the held joint, which the network must move.", length=(1, None))
    by: Literal["orientation", "position"] = key(
        "Whether the hand gives an orientation of the joint or its position in the room. `position`: for osc "
        "and fixed. A joint may have one hand of each. The position of the root joint moves the whole figure "
        "there, its feet on the floor.",
        "orientation",
    )
    tracker: str | None = key(
        "For osc by position: name of the VMC tracker (`/VMC/Ext/Tra/Pos`) that moves it.",
        None,
        length=(1, 64),
    )
    weight: float = key(
        "How firmly it is held: how far all interactions together move the joint to the hand; 0: not at all.",
        1.0,
        within=(0, 1),
    )
    from_start: bool = key("Whether it holds from the start; otherwise a cue or `/hold` starts it.", True)
    facing: Axis = key(
        "For sensors: the axis of the sensor (x, y, z; x is the arrow on its case, z comes out "
        "of its lid) that points to the front in the neutral pose.",
        (1.0, 0.0, 0.0),
    )
    at_neutral: Orientation = key(
        "For sensors: the joint's orientation, local to its parent, in the "
        "neutral pose; [1, 0, 0, 0] is the skeleton's rest pose.",
        (1.0, 0.0, 0.0, 0.0),
    )
    neutral: Orientation = key(
        "For sensors: the sensor's own orientation (in its axes: z up) that counts as "
        "the neutral pose until the dancer has stood still for one.",
        (1.0, 0.0, 0.0, 0.0),
    )
    primary: bool = key("For sensors: the tick's phase follows this one; otherwise the first one.", False)

    @model_validator(mode="before")
    @classmethod
    def _one_kind(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        given = [kind for kind in KINDS if values.get(kind) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none of them"
            raise refusal(
                f"A hand has exactly one of {', '.join(KINDS)}; this one has {found}.",
                "Name one puppeteer, and write a second hand for a second one.",
                at=given[1] if given else None,
            )
        for name in SENSOR_KEYS:
            if name in values and given != ["sensor"]:
                message = f"'{name}' belongs to a sensor, and this hand is {given[0]}."
                raise refusal(message, "Remove it.", at=name)
        return values

    @model_validator(mode="after")
    def _position_where_it_can_be(self) -> Self:
        by_position = self.by == "position"
        if by_position and self.kind not in BY_POSITION:
            raise refusal(
                f"A hand by position is {' or '.join(BY_POSITION)}, and this hand is {self.kind}.",
                "Write osc: true and send /mocap/setjointpos, or remove `by`.",
                at="by",
            )
        if self.fixed is not None and (self.fixed.position is not None) != by_position:
            if by_position:
                message, cure = (
                    "A fixed hand by position needs one.",
                    "Write fixed: {position: [0.3, 1.4, 0.2]}.",
                )
            else:
                message, cure = "This hand has a position, but holds by orientation.", "Write by: position."
            raise refusal(message, cure, at="fixed")
        if self.fixed is not None and by_position and "orientation" in self.fixed.model_fields_set:
            message = "A hand holds by orientation or by position, and this one has both."
            raise refusal(message, "Remove one of them.", at=("fixed", "orientation"))
        if self.tracker is not None and not (by_position and self.osc):
            message = "A tracker gives a position: 'tracker' belongs to {osc: true, by: position}."
            raise refusal(message, "Add what is missing, or remove it.", at="tracker")
        return self

    @property
    def points_a_joint(self) -> bool:
        """Whether it gives one joint an orientation."""
        return self.springs is None and self.by == "orientation"

    @property
    def kind(self) -> str:
        """sensor, turning, fixed, kept, osc or springs."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)
