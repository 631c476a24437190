"""show.yaml's section about hands: what holds a joint, and how firmly."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import model_validator

from appliance.show.section import Axis, Joint, Orientation, Section, key, refusal

LONGEST_SENSOR_NAME = 24  # as in the key file (appliance/sensor/keys.py) and the wearable's flash
KINDS = ("sensor", "turning", "fixed", "kept", "osc", "springs")
SENSOR_KEYS = ("facing", "at_neutral", "neutral", "primary")  # of a hand, for a worn sensor alone


class TurningConfig(Section):
    """A hand that turns its joint at a constant rate."""

    axis: Axis = key("Axis (x, y, z) in the parent's frame, any length.", (0.0, 1.0, 0.0))
    seconds_per_turn: float = key("Seconds for one turn.", 5.0, within=(0.1, 3600))


class FixedConfig(Section):
    """A hand that holds its joint still."""

    orientation: Orientation = key("Local to the parent joint.", (1.0, 0.0, 0.0, 0.0))


class HandConfig(Section):
    """A puppeteer's hold on one joint. Exactly one of sensor, turning, fixed, kept, osc, springs holds it."""

    sensor: str | None = key(
        "Name of the worn sensor that holds it, as in the key file.", None, length=(1, LONGEST_SENSOR_NAME)
    )
    turning: TurningConfig | None = key("The joint turns at a constant rate.", None)
    fixed: FixedConfig | None = key("The joint is held still.", None)
    kept: Literal[True] | None = key(
        "The joint is kept where the phrase has it, pose by pose; with as many interaction as "
        "coding iterations it stays there exactly.",
        None,
    )
    osc: Literal[True] | None = key("Messages to the control port hold the joint.", None)
    springs: str | None = key(
        "Springs hold the joint and all below it that no other hand holds. The name of the setting that is "
        "in force at the start: one under `springs`, or else loose, stiff or storm.",
        None,
        length=(1, 64),
    )
    joint: Joint = key("Name of the held joint, one that the network moves.", length=(1, None))
    weight: float = key(
        "How firmly it is held: how far all interactions together bring the joint to the hand; 0 not at all.",
        1.0,
        within=(0, 1),
    )
    from_start: bool = key("Whether it holds from the start on; else a cue or `/hold` lets it.", True)
    facing: Axis = key(
        "For sensors: the axis of the sensor (x, y, z; x is the arrow on its case, z comes out "
        "of its lid) that points to the front while the dancer stands in the neutral pose.",
        (1.0, 0.0, 0.0),
    )
    at_neutral: Orientation = key(
        "For sensors: the joint's orientation, local to its parent, while the "
        "dancer stands in the neutral pose; [1, 0, 0, 0] is the skeleton's rest pose.",
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

    @property
    def kind(self) -> str:
        """sensor, turning, fixed, kept, osc or springs."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)
