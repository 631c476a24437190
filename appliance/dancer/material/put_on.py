"""A network's change of a motion, put on the phrase that the motion was decoded from.

A network blurs what it decodes. The difference between two of its motions has none of that: on the phrase,
whatever the network does not know of it stays.
"""

from __future__ import annotations

import numpy as np

from appliance.dancer.loop import turns_about_y
from appliance.dancer.material.motion_network import Poses
from appliance.pose import quaternion

SMOOTH_FRAMES = 25  # the change is smoothed: 12.3 of 12.7 degrees stay, trembling goes


def put_on(poses: Poses, before: Poses, after: Poses, round_yaw: float | None = None) -> Poses:
    """Poses (T, M, 4), the root first, turned as a motion is turned that goes from `before` to `after`.

    round_yaw: of a cycle, radians by which the root has turned in each round; None: it has ends.
    """
    change = quaternion.multiply(after, quaternion.inverse(before))
    change = quaternion.continuous(np.where(change[:1, :, :1] < 0, -change, change))
    at, count = np.arange(-(SMOOTH_FRAMES // 2), len(change) + SMOOTH_FRAMES // 2), len(change)
    if round_yaw is None:
        padded = change[np.clip(at, 0, count - 1)]
    else:
        padded = change[at % count]
        turns = turns_about_y(round_yaw * (at // count))
        turned = quaternion.multiply(turns, quaternion.multiply(padded[:, 0], quaternion.inverse(turns)))
        padded[:, 0] = turned
        padded = quaternion.continuous(padded)
    weights = np.hanning(SMOOTH_FRAMES + 2)[1:-1]
    smooth = sum(w * padded[row : row + count] for row, w in enumerate(weights / weights.sum()))
    turned_on: Poses = quaternion.multiply(quaternion.normalize(smooth), poses).astype(np.float32)
    return turned_on
