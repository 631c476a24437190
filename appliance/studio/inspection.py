"""Describes a recording's file: joints and their roles, lengths, axes, rate, capture errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from appliance.pose.body_facts import (
    SMALLEST_M,
    TALLEST_M,
    floor_m,
    fronts,
    height_m,
    rest_positions,
    sampled_positions,
    stands,
)
from appliance.pose.roles import SIDES, missing_roles, places_of, trunk_of
from appliance.pose.skeleton import Skeleton
from appliance.studio.data.takes import Take
from appliance.studio.evaluation.masked import masked_stretches

FLAT, STEEP = 0.35, 0.85  # sine of the arms' slope in a T-pose, and with hanging arms
USUAL_HEIGHT_M = 1.7
_FACTORS = (("metres", 100.0), ("inches", 2.54), ("CMU's units", 5.64), ("millimetres", 0.1))


@dataclass(frozen=True)
class Inspection:
    """A recording as it is read, for people (`lines`) and for programs (`as_json`)."""

    take: Take
    facts: dict[str, Any]

    @property
    def skeleton(self) -> Skeleton:
        return self.take.recording.skeleton

    def as_json(self) -> dict[str, Any]:
        return self.facts

    def lines(self, joints: bool = True) -> list[str]:
        """The findings, a fact a line, each guess with the option that overrides it."""
        f = self.facts
        rate = f"{f['fps']:g} poses a second"
        if abs(f["fps"] - f["header_fps"]) > 0.01:
            rate += f" (the header says {f['header_fps']:g})"
        found = [
            f"{f['name']}: {f['seconds']:.1f} s, {rate} (--true-fps), {len(f['joints'])} joints, root "
            f"{f['root']} (--root)",
            f"  body: {f['height_m']:.2f} m tall (--metres-per-unit), {f['zero_pose']} at rest",
            f"  faces {_facing_text(f['facing_degrees'], f['facing_share'])} (--facing), floor at "
            f"{f['floor_m']:.2f} m",
        ]
        found += [f"  changed: {note}" for note in f["changed"]] or [
            "  read as it is: Y up (--up), no change"
        ]
        found += [f"  masked: {message}" for message in f["masked"]]
        if f["masked_frames"]:
            found.append(f"  {f['masked_frames']} of {f['frames']} frames are masked (none: --all-frames)")
        found += [f"  ? {doubt}" for doubt in f["doubts"]]
        return found + (joint_lines(f["joints"]) if joints else [])


def inspect(take: Take) -> Inspection:
    """The facts of a take as training reads it."""
    recording, skeleton = take.recording, take.recording.skeleton
    positions = sampled_positions(recording)
    height = height_m(skeleton, positions)
    front = fronts(skeleton, positions)
    mean = np.zeros(2) if front is None else front.mean(axis=0)
    facts = {
        "name": take.name,
        "seconds": round(recording.seconds, 3),
        "frames": len(recording),
        "fps": take.true_fps,
        "header_fps": round(take.header_fps, 4),
        "root": skeleton.names[0],
        "height_m": round(height, 3),
        "zero_pose": zero_pose(skeleton),
        "facing_degrees": round(float(np.degrees(np.arctan2(mean[0], mean[1])))),
        "facing_share": round(float(np.linalg.norm(mean)), 2),
        "floor_m": round(floor_m(skeleton, positions), 3),
        "changed": list(take.notes),
        "masked": [stretch.sentence() for stretch in masked_stretches([take])],
        "masked_frames": int(np.count_nonzero(~take.sound)),
        "doubts": doubts(skeleton, height),
        "joints": joint_facts(skeleton),
    }
    return Inspection(take, facts)


def joint_facts(skeleton: Skeleton) -> list[dict[str, Any]]:
    """Each joint's name, parent, what it was taken for ('': nothing), and its bone's length in metres."""
    called = {joint: role for role, joint in skeleton.roles.items()}
    places = places_of(skeleton.names)
    for joint, place in enumerate(places):  # beyond the roles: fingers, eyes, more of the trunk
        if place is not None and (place.chain not in ("arm", "leg", "spine") or joint in trunk_of(places)):
            called.setdefault(joint, f"{SIDES.get(place.side, '')} {place.chain}".strip())
    return [
        {
            "name": name,
            "parent": skeleton.names[parent] if parent >= 0 else "",
            "taken_for": called.get(joint, ""),
            "bone_m": round(float(np.linalg.norm(skeleton.offsets[joint])), 4),
        }
        for joint, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents, strict=True))
    ]


def joint_lines(joints: Sequence[dict[str, Any]]) -> list[str]:
    """A table: name, what it was taken for, metres from its parent."""
    width = max(len(joint["name"]) for joint in joints)
    return [
        f"  {joint['name']:{width}}  {joint['taken_for'] or '-':15}  {joint['bone_m']:6.3f} m"
        + (f" from {joint['parent']}" if joint["parent"] else "")
        for joint in joints
    ]


def zero_pose(skeleton: Skeleton) -> str:
    """'T-pose', 'A-pose', 'standing with hanging arms' or 'no figure'."""
    places, roles = rest_positions(skeleton), skeleton.roles
    if not stands(skeleton, places):
        return "no figure"
    slopes = []
    for side in ("left", "right"):
        upper, hand = roles.get(f"{side} upper arm"), roles.get(f"{side} hand", roles.get(f"{side} forearm"))
        if upper is not None and hand is not None:
            arm = places[0, hand] - places[0, upper]
            slopes.append(-float(arm[1]) / max(float(np.linalg.norm(arm)), 1e-9))
    if not slopes:
        return "a figure without named arms"
    slope = float(np.mean(slopes))
    return "a T-pose" if abs(slope) < FLAT else "standing with hanging arms" if slope > STEEP else "an A-pose"


def doubts(skeleton: Skeleton, height: float) -> list[str]:
    """The question to ask: a body of no dancer's size, parts without a known name."""
    asked = []
    if not SMALLEST_M <= height <= TALLEST_M:
        times = USUAL_HEIGHT_M / max(height, 1e-6)
        likely = [unit for unit, factor in _FACTORS if SMALLEST_M <= height * factor <= TALLEST_M]
        asked.append(
            f"The body is {height:.2f} m tall, a dancer has 1.2 to 2.2 m. If the unit is wrong, give it with "
            f"--metres-per-unit: {times:.3g} times the present one makes {USUAL_HEIGHT_M} m"
            + (f", as if {likely[0]} had been taken for centimetres." if likely else ".")
        )
    missing = missing_roles(skeleton.roles)
    if missing:
        asked.append(
            f"No joint has a name that is known for: {', '.join(missing)}. Hands, mirror images, feet and "
            "avatars go by such names: rename joints, or name the hands' joints in show.yaml."
        )
    return asked


def _facing_text(degrees: int, share: float) -> str:
    if share < 0.5:
        return "all around"
    side = (
        "the audience"
        if abs(degrees) <= 45
        else "away from the audience"
        if abs(degrees) >= 135
        else "sideways"
    )
    return f"{side} ({degrees:+d} degrees)"
