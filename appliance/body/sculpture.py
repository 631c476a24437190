"""A figure modelled around a skeleton of any kind: chest, pelvis, tapered limbs, head, hands and feet."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from appliance.body.extremities import foot, hand, head
from appliance.body.volumes import Group, Slab
from appliance.pose.anatomy import LONG_BONE, Anatomy
from appliance.pose.quaternion import Array

# Along the spine from the pelvis (0) to the neck (1): half the width as a share of the hips' and of the
# shoulders' half width; flesh beside it, half the depth, and how far before the bones, in heights.
_SPINE = np.array([0.0, 0.18, 0.42, 0.64, 0.82, 1.0])
_OF_HIPS = np.array([0.80, 0.80, 0.52, 0.10, 0.0, 0.0])
_OF_SHOULDERS = np.array([0.0, 0.0, 0.35, 0.80, 0.85, 0.20])
_FLESH = np.array([0.032, 0.032, 0.020, 0.023, 0.027, 0.018])
_DEPTH = np.array([0.045, 0.048, 0.047, 0.057, 0.052, 0.034])
_AHEAD = np.array([-0.004, -0.002, 0.004, 0.010, 0.009, 0.0])


def sculpture(anatomy: Anatomy) -> tuple[Group, list[Group]]:
    """The trunk and the limbs that grow out of it, in the skeleton's rest pose."""
    limbs = [_limb(anatomy, trunk, first) for trunk, first in anatomy.limbs()]
    if anatomy.head is not None:
        limbs.append(Group((*_neck(anatomy), *head(anatomy)), 0.022 * anatomy.height))
    trunk = Group(tuple(_trunk(anatomy)), 0.0)
    covered = {slab.owner for group in limbs for slab in group.movers}
    covered |= {slab.owner for slab in trunk.slabs if slab.start is not slab.end}
    return trunk, [*limbs, *_twigs(anatomy, covered)]


def cone(
    anatomy: Anatomy, owner: int, start: Array, end: Array, radii: tuple[float, float], softness: float
) -> Slab:
    """A rounded cone; the softness counts in heights, the radii in metres."""
    return Slab(owner, start, end, *radii, softness * anatomy.height, anatomy.across)


def _trunk(anatomy: Anatomy) -> list[Slab]:
    """Slabs along the spine; a single ball where nothing branches."""
    places, height = anatomy.positions, anatomy.height
    spine = _spine(anatomy)
    if len(spine) < 2:
        ball = min(anatomy.thickness(spine[0]), 0.045 * height)
        return [cone(anatomy, spine[0], places[spine[0]], places[spine[0]], (ball, ball), 0.0)]
    ends = [places[joint] for joint in spine]
    lengths = [float(np.linalg.norm(b - a)) for a, b in pairwise(ends)]
    whole = sum(lengths) or 1.0
    hips, shoulders = _half_width(anatomy, spine[0]), _half_width(anatomy, spine[-2])
    slabs, before = [], 0.0
    for owner, start, end, length in zip(spine, ends, ends[1:], lengths, strict=False):
        pieces = max(1, round(length / (0.012 * height)))
        for piece in range(pieces):
            shares = np.array([piece, piece + 1]) / pieces
            along = (before + shares * length) / whole
            flesh, depth, ahead = (_at(along, table) * height for table in (_FLESH, _DEPTH, _AHEAD))
            half = _at(along, _OF_HIPS) * hips + _at(along, _OF_SHOULDERS) * shoulders + flesh - depth
            low, high = (
                start + share * (end - start) + shift * anatomy.forward
                for share, shift in zip(shares, ahead, strict=True)
            )
            slabs.append(
                Slab(
                    owner, low, high, float(depth[0]), float(depth[1]), 0.0, anatomy.across,
                    max(float(half[0]), 0.0), max(float(half[1]), 0.0),
                )
            )  # fmt: skip
        before += length
    return slabs


def _at(along: Array, table: Array) -> Array:
    """The table's smooth curve (a polynomial through all its values) at places along the spine, 0 to 1."""
    curve: Array = np.polyval(np.polyfit(_SPINE, table, len(_SPINE) - 1), along)
    return curve


def _spine(anatomy: Anatomy) -> list[int]:
    """Trunk joints from the pelvis to the furthest one, then the first joint of the neck."""
    last = anatomy.trunk[-1]
    spine = [last]
    while spine[0] != anatomy.trunk[0]:
        spine.insert(0, anatomy.skeleton.parents[spine[0]])
    if anatomy.neck and anatomy.skeleton.parents[anatomy.neck[0]] == last:
        spine.append(anatomy.neck[0])
    return spine


def _half_width(anatomy: Anatomy, joint: int) -> float:
    """How far to the side the limbs of a trunk joint begin, metres."""
    sides = []
    for trunk, first in anatomy.limbs():
        if trunk == joint:
            chain = anatomy.chain(first)
            start = anatomy.positions[chain[anatomy.limb_start(chain)]]
            sides.append(abs(float((start - anatomy.positions[joint]) @ anatomy.across)))
    return max(sides, default=0.03 * anatomy.height)


def _limb(anatomy: Anatomy, trunk: int, first: int) -> Group:
    """From the trunk to the finger tips or toes."""
    chain = anatomy.chain(first)
    begin, last = anatomy.limb_start(chain), _extremity(anatomy, chain)
    is_leg = _is_leg(anatomy, chain, last)
    steps, bones = (foot(anatomy, chain[last]), []) if is_leg else hand(anatomy, chain[last])
    for place in reversed(range(begin, last)):
        steps += _bone(anatomy, chain[place], chain[place + 1], is_leg)
    steps += _root_of_limb(anatomy, trunk, chain[: begin + 1], is_leg)
    return Group(tuple(steps), (0.050 if is_leg else 0.026) * anatomy.height, tuple(bones))


def _bone(anatomy: Anatomy, joint: int, child: int, is_leg: bool) -> list[Slab]:
    """A muscle from the joint to below its middle, and the taper to the next joint."""
    start, end = anatomy.positions[joint], anatomy.positions[child]
    first, last = anatomy.thickness(joint), anatomy.thickness(child)
    belly = start + 0.32 * (end - start)
    if is_leg and anatomy.reach[child] < 0.5 * anatomy.reach[joint]:
        belly = belly - 0.010 * anatomy.height * anatomy.forward  # the calf is behind the bone
    first = 0.9 * first if is_leg else first
    full = (first + 0.32 * (last - first)) * (1.18 if is_leg else 1.12)
    return [
        cone(anatomy, joint, belly, end, (full, last), 0.0),
        cone(anatomy, joint, start, belly, (first, full), 0.0),
    ]


def _root_of_limb(anatomy: Anatomy, trunk: int, chain: Sequence[int], is_leg: bool) -> list[Slab]:
    """The parts that join a limb to the trunk: shoulder girdle and chest muscle, or hip and seat."""
    places, height = anatomy.positions, anatomy.height
    start = places[chain[-1]]
    thick = anatomy.thickness(chain[-1])
    owner = chain[-2] if len(chain) > 1 else trunk
    inner = start - anatomy.across * 0.6 * float((start - places[trunk]) @ anatomy.across)
    if is_leg:
        seat = start - 0.022 * height * anatomy.forward + 0.4 * (inner - start)
        return [
            cone(anatomy, trunk, seat, start, (0.92 * thick, 0.85 * thick), 0.02),
            cone(anatomy, trunk, inner, start, (0.8 * thick, 0.85 * thick), 0.02),
        ]
    middle = inner + 0.45 * (places[trunk] - inner)
    middle = middle - anatomy.across * float((middle - inner) @ anatomy.across)
    girdle = [
        cone(anatomy, a, places[a], places[b], (0.030 * height, 0.030 * height), 0.01)
        for a, b in pairwise([trunk, *chain])
    ]
    return [
        *girdle,
        cone(anatomy, owner, inner, start, (0.030 * height, thick), 0.015),
        cone(anatomy, trunk, middle, start, (0.034 * height, 0.8 * thick), 0.02),
    ]


def _neck(anatomy: Anatomy) -> list[Slab]:
    """From the trunk to the head."""
    height, places = anatomy.height, anatomy.positions
    joints = anatomy.neck
    above = [anatomy.skeleton.parents[joints[0]], *joints]
    slabs = [
        cone(anatomy, a, places[a], places[b], (0.027 * height, 0.027 * height), 0.01)
        for a, b in pairwise(joints)
    ]
    base = above[0]
    if base >= 0:
        low = places[joints[0]] + 0.35 * (places[base] - places[joints[0]])
        slabs.insert(0, cone(anatomy, base, low, places[joints[0]], (0.034 * height, 0.028 * height), 0.01))
    return slabs


def _twigs(anatomy: Anatomy, covered: set[int]) -> list[Group]:
    """Everything else that has bones: tails, ears, wings."""
    face = set(anatomy.below(anatomy.head)) if anatomy.head is not None else set()
    left = [joint for joint in range(len(anatomy.skeleton)) if joint not in covered | face]
    bones = [(*bone, anatomy.thickness(bone[0])) for bone in anatomy.bones(left)]
    for joint in sorted({bone[0] for bone in bones}):
        parent = anatomy.skeleton.parents[joint]
        if parent in covered:
            start, end = anatomy.positions[parent], anatomy.positions[joint]
            bones.append((parent, start, end, anatomy.thickness(joint)))
    return [
        Group((cone(anatomy, owner, start, end, (thick, 0.8 * thick), 0.0),), 0.015 * anatomy.height)
        for owner, start, end, thick in bones
    ]


def _extremity(anatomy: Anatomy, chain: Sequence[int]) -> int:
    """The place in a limb's chain of its hand or foot: behind its last long bone."""
    long = [p for p in range(1, len(chain)) if anatomy.length(chain[p]) > LONG_BONE * anatomy.height]
    return long[-1] if long else len(chain) - 1


def _is_leg(anatomy: Anatomy, chain: Sequence[int], last: int) -> bool:
    if any(joint in anatomy.skeleton.feet for joint in chain):
        return True
    drop = anatomy.positions[chain[0]] - anatomy.positions[chain[last]]
    return not anatomy.skeleton.feet and float(drop[1]) > 0.8 * float(np.linalg.norm(drop))
