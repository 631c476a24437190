"""Which point hangs on which, from their names, and where the bones of a figure at rest point."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from appliance.pose.joint_names import CHAINS
from appliance.pose.quaternion import Array
from appliance.pose.roles import places_of

_CHEST = 4  # the place on the spine up to which arms may hang
_AT_REST: dict[str, tuple[float, float, float]] = {
    "spine": (0.0, 1.0, 0.0),
    "arm": (1.0, 0.0, 0.0),
    "leg": (0.0, -1.0, 0.0),
    "eye": (0.3, 0.6, 0.7),
}
_FOOT_AT_REST, _ANKLE, _TOES = (0.0, -0.4, 0.9), 3, 5
_HAND, _HEAD = 5, 6


def parents_by_name(names: Sequence[str]) -> list[int] | str:
    """Each joint's parent, or why it cannot be known, in words."""
    roles = places_of(names)
    unknown = [name for name, role in zip(names, roles, strict=True) if role is None]
    if unknown:
        return f"unknown: {', '.join(unknown[:5])}"
    known = {joint: role for joint, role in enumerate(roles) if role is not None}
    spine = sorted((j for j in known if known[j].chain == "spine"), key=lambda j: known[j][2:])
    if not spine or known[spine[0]].place:
        return "no joint is called hips, pelvis or root"
    chest = [joint for joint in spine if known[joint].place <= _CHEST][-1]
    parents = [-1] * len(names)
    for above, joint in pairwise(spine):
        parents[joint] = above
    head = [joint for joint in spine if known[joint].place <= _HEAD][-1]
    for side in (1, -1):
        hand = chest
        for chain in CHAINS:
            limb = sorted((j for j in known if known[j][:2] == (chain, side)), key=lambda j: known[j][2:])
            start = {"arm": chest, "leg": spine[0], "eye": head}.get(chain, hand)
            for above, joint in pairwise([start, *limb]):
                parents[joint] = above
            if chain == "arm":
                hand = [chest, *(joint for joint in limb if known[joint].place <= _HAND)][-1]
    return parents


def directions_at_rest(names: Sequence[str], parents: Sequence[int]) -> Array | None:
    """(J, 3): where the bone to each joint points in a figure that stands with spread arms, left is +x.

    None where a name says nothing.
    """
    found: Array = np.zeros((len(names), 3))
    places = places_of(names)
    for joint, role in enumerate(places):
        if role is None:
            return None
        if parents[joint] < 0:
            continue
        above = places[parents[joint]]
        x, y, z = _AT_REST.get(role.chain, _AT_REST["arm"])
        on_ankle = above is not None and (above.chain, above.place) == ("leg", _ANKLE)
        if role.chain == "leg" and (role.place >= _TOES or on_ankle):
            x, y, z = _FOOT_AT_REST
        if role.chain == "leg" and above is not None and above.chain != "leg":
            x, y = 1.0, -0.3
        if role.chain == "arm" and above is not None and above.chain != "arm":
            x, y = (0.3, 1.0) if role.place == 0 else (1.0, 0.3)
        found[joint] = np.array([x * (role.side or 1), y, z]) / np.linalg.norm([x, y, z])
    return found
