"""A pose to model a body in, for skeletons with limbs that intersect at rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from appliance.pose.anatomy import Anatomy
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.pose.t_pose import aimed

CROWDED_SHARE = 0.3  # share of a limb's points that may be inside another part of the body
CLEARANCE = 0.01  # gap between the surfaces of two limbs, as a share of the height
_UP = np.array([0.0, 1.0, 0.0])
_DOWNWARDS = 0.35  # how steeply feet point to the floor


def anatomy_of(skeleton: Skeleton) -> Anatomy:
    """The parts of a skeleton as it stands; with spread limbs where the pose leaves them no room.

    Some recordings have all bones along one axis at rest, and only their motion says how a body stands: that
    pose is the skeleton's stance, and the limbs are spread from there.
    """
    at_rest = Anatomy(skeleton)
    if skeleton.stance is None and not is_crowded(at_rest):
        return at_rest
    upright = Anatomy(skeleton, aimed(at_rest, _spine_aims(at_rest)))
    return Anatomy(skeleton, aimed(at_rest, {**_spine_aims(at_rest), **_limb_aims(upright)}))


def is_crowded(anatomy: Anatomy) -> bool:
    """Whether a good part of a limb is inside another limb or the trunk."""
    chains = [anatomy.chain(first) for _, first in anatomy.limbs()]
    beyond = [chain[anatomy.limb_start(chain) + 1 :] for chain in chains]
    spine = [*anatomy.trunk, *anatomy.neck]
    for number, limb in enumerate(beyond):
        others = [spine, *beyond[:number], *beyond[number + 1 :]]
        near = [any(_touches(anatomy, joint, other) for other in others) for joint in limb]
        if near and np.mean(near) > CROWDED_SHARE:
            return True
    return False


def _touches(anatomy: Anatomy, joint: int, others: Sequence[int]) -> bool:
    """Whether a joint lies within the flesh of a chain of others."""
    place = anatomy.positions[joint]
    for start, end in zip(others, [*others[1:], *others[-1:]], strict=True):
        bone = anatomy.positions[end] - anatomy.positions[start]
        along = float((place - anatomy.positions[start]) @ bone) / max(float(bone @ bone), 1e-12)
        away = place - anatomy.positions[start] - min(max(along, 0.0), 1.0) * bone
        flesh = anatomy.thickness(joint) + anatomy.thickness(end) + CLEARANCE * anatomy.height
        if float(np.linalg.norm(away)) < flesh:
            return True
    return False


def _spine_aims(anatomy: Anatomy) -> dict[tuple[int, int], Array]:
    """The spine and the neck upwards: for each bone (joint, child) where it should point."""
    spine = [*anatomy.trunk, *anatomy.neck]
    return {(spine[place - 1], spine[place]): _UP for place in range(1, len(spine))}


def _limb_aims(anatomy: Anatomy) -> dict[tuple[int, int], Array]:
    """Legs downwards, their feet to the front, arms to their sides; the spine is upright already."""
    aims = {}
    front = np.cross(anatomy.across, _UP)
    for trunk, first in anatomy.limbs():
        chain = anatomy.chain(first)
        begin = anatomy.limb_start(chain)
        start = anatomy.positions[chain[begin]] - anatomy.positions[trunk]
        is_leg = trunk == anatomy.trunk[0] and len(anatomy.trunk) > 1
        side = anatomy.across if float(start @ anatomy.across) >= 0.0 else -anatomy.across
        for joint, child in zip(chain[begin:], chain[begin + 1 :], strict=False):
            is_foot = is_leg and joint in anatomy.skeleton.feet
            ahead = front - _DOWNWARDS * _UP
            aims[joint, child] = ahead if is_foot else -_UP if is_leg else side
    return aims
