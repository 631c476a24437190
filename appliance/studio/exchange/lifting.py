"""Landmarks of a picture lifted into the room by the lengths of the limbs (Taylor 2000).

A bone that looks shorter than it is points towards the camera or away from it. Which of the two is found for
each limb over all frames: limbs move evenly, and knees and elbows bend one way only.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from appliance.pose.point_fit import rest_points
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton

_ZOOM_FRAMES = 51  # over which the size in the picture is smoothed: nobody comes nearer more quickly
_LIMBS = tuple(
    (side, chain)
    for side in ("left", "right")
    for chain in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "toe"))
)
_BENDS_WRONG = 4.0  # cost of an elbow or a knee that bends the wrong way, for each metre
_BEHIND = 0.15  # cost of a hand behind the chest, for each metre: arms are mostly in front
_MOVES = 1.0  # cost of each metre that a joint moves in a frame
_FACING_FRAMES = 25
_SHORTENED = 0.92  # fraction of a squared length: the rest is perspective and noise


def lifted(parts: Sequence[str], picture: Array, skeleton: Skeleton) -> tuple[Array, Array]:
    """Landmarks (N, P, 3) in a picture, x to the right and y down -> metres, +Y up, +Z to the camera.

    And the hips' way to the side (N,), metres. Landmarks that are nowhere stay not a number.
    """
    rest = rest_points(skeleton)
    flat = picture[..., :2] * np.array([1.0, -1.0])
    zoom = _zoom(parts, flat, rest)
    flat = flat / zoom[:, None, None]
    at = {part: place for place, part in enumerate(parts) if part}
    found = np.concatenate([flat, np.full((*flat.shape[:2], 1), np.nan)], axis=-1)
    hips = (flat[:, at["left hip"]] + flat[:, at["right hip"]]) / 2
    found[..., :2] -= hips[:, None]
    front = _facing(found, at)
    _lift_trunk(found, at, rest, front)
    for side, chain in _LIMBS:
        joints = [at[f"{side} {part}"] for part in chain if f"{side} {part}" in at]
        if len(joints) == len(chain) and not np.isnan(found[:, joints, 0]).any():
            lengths = [
                float(np.linalg.norm(np.subtract(rest[f"{side} {end}"], rest[f"{side} {start}"])))
                for start, end in pairwise(chain)
            ]
            found[:, joints] = _lift_limb(found[:, joints], lengths, front, chain[0] == "shoulder")
    _lift_face(found, at, front)
    return found, hips[:, 0] - hips[0, 0]


def _zoom(parts: Sequence[str], flat: Array, rest: dict[str, tuple[float, float, float]]) -> Array:
    """(N,): how long a metre is in the picture: as the least foreshortened bones of a second have it."""
    ratios = []
    pairs = [
        ("shoulder", "elbow"),
        ("elbow", "wrist"),
        ("hip", "knee"),
        ("knee", "ankle"),
        ("shoulder", "hip"),
    ]
    for side in ("left", "right"):
        for start, end in pairs:
            a, b = f"{side} {start}", f"{side} {end}"
            if a in parts and b in parts:
                long = float(np.linalg.norm(np.subtract(rest[a], rest[b])))
                seen = np.linalg.norm(flat[:, parts.index(a)] - flat[:, parts.index(b)], axis=-1)
                ratios.append(seen / long)
    each = np.percentile(np.nan_to_num(np.array(ratios)), 85, axis=0)
    reach = min(_ZOOM_FRAMES, max(1, len(each) // 2 * 2 - 1))
    padded = np.pad(each, reach // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, reach)
    zoom: Array = np.maximum(np.percentile(windows, 75, axis=-1), 1e-6)
    return zoom


def _facing(found: Array, at: dict[str, int]) -> Array:
    """(N, 3): where the chest looks, level. Its side is what the shoulders' order says, the rest the nose."""
    across = found[:, at["left shoulder"], 0] - found[:, at["right shoulder"], 0]
    width = max(float(np.percentile(np.abs(across), 90)), 1e-6)
    towards = np.clip(across / width, -1.0, 1.0)
    if "nose" in at:
        middle = (found[:, at["left shoulder"], 0] + found[:, at["right shoulder"], 0]) / 2
        side = np.sign(_mean(found[:, at["nose"], 0] - middle, _FACING_FRAMES))
    else:
        side = np.ones(len(found))
    away = side * np.sqrt(1.0 - towards**2)
    return np.stack([away, np.zeros(len(found)), towards], axis=-1)


def _mean(values: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    padded = np.pad(np.nan_to_num(values), frames // 2, mode="edge")
    return np.convolve(padded, np.ones(frames) / frames, mode="valid")


def _lift_trunk(
    found: Array, at: dict[str, int], rest: dict[str, tuple[float, float, float]], front: Array
) -> None:
    """Hips and shoulders: the lines between them stand across the front; the trunk leans no further."""
    for part in ("hip", "shoulder"):
        left, right = at[f"left {part}"], at[f"right {part}"]
        half = float(np.linalg.norm(np.subtract(rest[f"left {part}"], rest[f"right {part}"]))) / 2
        seen = np.linalg.norm(found[:, left, :2] - found[:, right, :2], axis=-1) / 2
        deep = np.sqrt(np.maximum(half**2 - seen**2, 0.0)) * -np.sign(front[:, 0])
        found[:, left, 2], found[:, right, 2] = deep, -deep


def _lift_limb(limb: Array, lengths: Sequence[float], front: Array, is_arm: bool) -> Array:
    """(N, L, 3): depths of a limb's joints, of which the first has its own, by the cheapest way (Viterbi)."""
    signs = np.array(list(product((1.0, -1.0), repeat=len(lengths))))
    flat = np.linalg.norm(np.diff(limb[..., :2], axis=1), axis=-1)
    deep = np.sqrt(np.maximum(_SHORTENED * np.array(lengths) ** 2 - flat**2, 0.0))
    ways = np.repeat(limb[:, None], len(signs), axis=1)
    ways[:, :, 1:, 2] = limb[:, None, :1, 2] + np.cumsum(signs[None] * deep[:, None], axis=-1)
    cost = _unlikely(ways, front, is_arm)
    total, back = cost[0], np.zeros(cost.shape, dtype=int)
    for frame in range(1, len(limb)):
        moved = np.linalg.norm(ways[frame][None] - ways[frame - 1][:, None], axis=-1).sum(axis=-1)
        through = total[:, None] + _MOVES * moved
        back[frame] = through.argmin(axis=0)
        total = through.min(axis=0) + cost[frame]
    best, state = np.empty(limb.shape), int(total.argmin())
    for frame in range(len(limb) - 1, -1, -1):
        best[frame] = ways[frame, state]
        state = int(back[frame, state])
    return best


def _unlikely(ways: Array, front: Array, is_arm: bool) -> Array:
    """(N, ways): what nobody's arms and legs do costs most."""
    middle = (ways[:, :, 0] + ways[:, :, 2]) / 2
    bent = ((ways[:, :, 1] - middle) * front[:, None]).sum(axis=-1)  # how far elbow or knee is in front
    wrong: Array = _BENDS_WRONG * np.maximum(bent if is_arm else -bent, 0.0) / 50
    if is_arm:
        hand = ((ways[:, :, 2] - ways[:, :, 0]) * front[:, None]).sum(axis=-1)
        wrong += _BEHIND * np.maximum(-hand, 0.0) / 50
    elif ways.shape[2] > 3:
        toe = ((ways[:, :, 3] - ways[:, :, 2]) * front[:, None]).sum(axis=-1)
        wrong += _BENDS_WRONG * np.maximum(-toe, 0.0) / 50
    return wrong


def _lift_face(found: Array, at: dict[str, int], front: Array) -> None:
    """Ears beside the head, nose and eyes in front of it."""
    for part, ahead in (
        ("nose", 0.1),
        ("left eye", 0.08),
        ("right eye", 0.08),
        ("left ear", 0.0),
        ("right ear", 0.0),
    ):
        if part in at:
            sign = {"left": 1.0, "right": -1.0}.get(part.partition(" ")[0], 0.0)
            found[:, at[part], 2] = ahead * front[:, 2] - sign * 0.07 * front[:, 0]
