"""The puppeteers of a show: one for each hand of a puppet."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.dancer.grounding import Grounding
from appliance.dancer.held_positions import FixedPosition, HeldPosition, RemotePosition
from appliance.dancer.motion_source import Playback
from appliance.dancer.puppet import Puppet
from appliance.dancer.puppeteers import FixedOrientation, Kept, Puppeteer, Remote, TurningAxis, WornSensor
from appliance.dancer.reach import reach_in
from appliance.dancer.springs import Springs
from appliance.pose.skeleton import Skeleton
from appliance.sensor.neutral import Mounting, joint_from_reading
from appliance.show.hand import HandConfig
from appliance.show.show import Show
from appliance.show.springs import springs_by_name
from appliance.stage.stage_error import StageError


def puppeteers_of(
    show: Show, hands: Sequence[HandConfig], puppet: Puppet, grounding: Grounding, motion: Playback
) -> list[Puppeteer]:
    """The hands of one puppet in their order; springs know the others, whose joints they leave alone, and
    hands by place where its phrases take their joints.
    """
    made = {
        place: _puppeteer(hand, show.skeleton) for place, hand in enumerate(hands) if hand.springs is None
    }
    others, settings = tuple(made.values()), springs_by_name(show.config.springs)
    for place, hand in enumerate(hands):
        if hand.springs is not None:
            facts = hand.joint, show.skeleton, grounding.figure, puppet.joints, settings
            try:
                made[place] = Springs(*facts, hand.springs, hand.weight, others, show.config.strings)
            except ValueError as error:
                raise StageError(f"{show.file.path}: {error}") from error
    for one in others:
        if isinstance(one, HeldPosition) and not one.is_root:
            phrases = [motion.loop_of(name).poses for name in motion.phrases]
            one.habitual = reach_in(phrases, show.skeleton, one.number)
    for place, hand in enumerate(hands):
        made[place].enabled = hand.from_start
    return [made[place] for place in range(len(hands))]


def _puppeteer(hand: HandConfig, skeleton: Skeleton) -> Puppeteer:
    if hand.by == "position":
        if hand.fixed is not None and hand.fixed.position is not None:
            return FixedPosition(hand.joint, skeleton, hand.fixed.position, hand.weight)
        return RemotePosition(hand.joint, skeleton, hand.weight)
    if hand.sensor is not None:
        mounting = mounting_of(hand)
        return WornSensor(hand.joint, hand.weight, joint_from_reading(mounting.assumed_pose, mounting))
    if hand.turning is not None:
        return TurningAxis(hand.joint, hand.turning.axis, hand.turning.seconds_per_turn, hand.weight)
    if hand.fixed is not None:
        return FixedOrientation(hand.joint, hand.fixed.orientation, hand.weight)
    if hand.kept:
        return Kept(hand.joint, hand.weight)
    return Remote(hand.joint, hand.weight)


def mounting_of(hand: HandConfig) -> Mounting:
    """How the sensor of a hand is worn."""
    return Mounting(hand.facing, hand.at_neutral, hand.neutral)
