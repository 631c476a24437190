"""The map of a show's poses as the page draws it: the phrase's own path, and the figure of some places."""

from __future__ import annotations

from typing import Any

import numpy as np

from appliance.dancer.material.motion_network import MotionNetwork
from appliance.dancer.phrase_cache import PhraseCache
from appliance.levers.sources import MAIN, PATH
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.skeleton import Skeleton
from appliance.show.show import Show

ACROSS = 5  # figures
EVERY_S = 0.2  # between two places of the path
_SHORTEST_M = 0.04  # the shortest bone that is drawn
_SIZE = 0.75  # fraction of a figure's cell


def pose_map(show: Show) -> dict[str, Any]:
    """For JSON. path: x, y of the phrase, 0 to 1 as `/motion/path` takes them; figures: where each stands,
    and its bones seen from the front, in metres from its middle; scale: of a metre, in widths of the map.

    Raises LookupError for a show without a map.
    """
    if PATH not in show.motion_networks:
        raise LookupError("This show has no map: `path` is not under motion in its show.yaml.")
    network = MotionNetwork(show.motion_networks[PATH], show.skeleton.names)
    found = PhraseCache(show.directory, None).phrase(show.phrases[MAIN], show.skeleton, False)
    if network.ground is None or found is None:
        raise LookupError("The show's network of poses has no map. Export it again with this release.")
    middle, directions, low, high = network.ground
    phrase = found[0]
    poses = phrase.poses[:: max(1, round(EVERY_S * phrase.fps))]
    latents, _ = network.encode(poses[:, None, network.places])
    path = ((latents - middle) @ np.linalg.pinv(directions) - low) / (high - low)
    steps = (np.arange(ACROSS) + 0.5) / ACROSS
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    decoded = network.decode((middle + (low + (high - low) * places) @ directions).astype(np.float32))[:, 0]
    bones = [_bones(show.skeleton, network, pose) for pose in decoded]
    tallest = max(float(np.ptp(one[..., 1])) for one in bones)
    return {
        "path": np.round(path, 3).tolist(),
        "figures": [
            {"at": np.round(place, 3).tolist(), "bones": np.round(one, 2).tolist()}
            for place, one in zip(places, bones, strict=True)
        ],
        "scale": round(_SIZE / ACROSS / max(tallest, 0.1), 4),
    }


def _bones(skeleton: Skeleton, network: MotionNetwork, moving: Array) -> Array:
    """From the front, (B, 2, 2): x to the right and y up of both ends."""
    pose = np.tile(quaternion.IDENTITY, (len(skeleton), 1)).astype(np.float64)
    pose[network.places] = quaternion.normalize(moving.astype(np.float64))
    positions, world = skeleton.forward_kinematics(pose, np.zeros(3))
    bones = [
        (positions[parent], positions[joint])
        for joint, parent in enumerate(skeleton.parents)
        if parent >= 0 and np.linalg.norm(skeleton.offsets[joint]) >= _SHORTEST_M
    ]
    for joint, offset in skeleton.ends:
        if np.linalg.norm(offset) >= _SHORTEST_M:
            end = positions[joint] + quaternion.rotate(world[joint], np.array(offset))
            bones.append((positions[joint], end))
    seen = np.array(bones)[..., :2]
    low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    middled: Array = seen - (low + high) / 2
    return middled
