"""Spread and energy of a dance, limb by limb: legs, trunk, free arms and the limb that a hand holds.

A mean over all joints hides a restless arm that pays for still legs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from appliance.pose import quaternion
from appliance.pose.joint_names import FINGERS, JointRole
from appliance.pose.quaternion import Array
from appliance.pose.roles import places_of
from appliance.studio.evaluation.dance_figures import energy

LIMBS = ("legs", "trunk", "arms", "held_limb")


def limbs_of(joints: Sequence[str], held: str | None = None) -> dict[str, list[int]]:
    """Places of the joints in each of LIMBS that has any; the held joint is in none of them.

    held_limb: the other joints of the arm or leg that the hand holds; the trunk is no limb. legs and arms are
    those that no hand holds; the trunk has neck and head. Joints of unknown names are in no limb.
    """
    places = places_of(joints)
    own = None if held is None else _limb(places[joints.index(held)])
    found: dict[str, list[int]] = {name: [] for name in LIMBS}
    for joint, place in enumerate(places):
        limb = _limb(place)
        if limb is None or joints[joint] == held:
            continue
        is_held = own is not None and own[0] != "trunk" and limb == own
        found["held_limb" if is_held else limb[0]].append(joint)
    return {name: members for name, members in found.items() if members}


def limb_figures(danced: Array, phrase: Array, limbs: Mapping[str, Sequence[int]]) -> dict[str, float]:
    """spread_LIMB and energy_LIMB of a dance (T, M, 4), headings removed, against the phrase's own."""
    found = {}
    for name, joints in limbs.items():
        places = list(joints)
        found[f"spread_{name}"] = _ratio(spread(danced[:, places]), spread(phrase[:, places]))
        found[f"energy_{name}"] = _ratio(energy(danced[:, places]), energy(phrase[:, places]))
    return found


def spread(poses: Array) -> float:
    """Standard deviation of each joint's orientation over poses (T, M, 4), degrees; mean over joints."""
    middle = quaternion.normalize(quaternion.aligned(poses, poses[len(poses) // 2]).mean(axis=0))
    degrees = np.degrees(quaternion.angle_between(poses, middle))
    return float(np.sqrt((degrees**2).mean(axis=0)).mean())


def _limb(place: JointRole | None) -> tuple[str, int] | None:
    """('legs', 'arms' or 'trunk', side); None for an unknown name."""
    if place is None:
        return None
    if place.chain == "leg":
        return "legs", place.side
    if place.chain == "arm" or place.chain in (*FINGERS, "finger"):
        return "arms", place.side
    return "trunk", 0


def _ratio(value: float, own: float) -> float:
    """Against the phrase's own; NaN if the phrase stands still."""
    return value / own if own > 1e-6 else float("nan")
