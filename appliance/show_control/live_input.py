"""Live input: a whole dancer's motion capture as OSC, as the AI-Toolbox programs send it, for the stage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from appliance.box.live_pose import MOST_JOINTS, LivePoseWriter
from appliance.outputs.shared_frame import Facts
from appliance.show.sources import LIVE
from appliance.show_control.command import require_read

ROTATIONS, POSITIONS = "/mocap/0/joint/rot_local", "/mocap/0/joint/pos_world"
HEARD = (ROTATIONS, POSITIONS, "/mocap/0/joint/rot_world")  # the last one says nothing new


class LiveInput:
    """Checks what comes, and publishes the newest pose. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._writer = LivePoseWriter(folder)
        self._root = (math.nan, math.nan, math.nan)

    def hear(self, address: str, arguments: Sequence[object], facts: Facts | None, now: float) -> None:
        """One message of HEARD. Raises ValueError with one clear sentence."""
        if facts is None or LIVE not in facts.phrases:
            raise ValueError(
                "No show on this box takes a live dancer: nothing is changed. Write `live: true` under "
                "`motion` in its show.yaml."
            )
        require_read(address, arguments)
        joints = len(facts.skeleton)
        wanted = {ROTATIONS: 4, POSITIONS: 3}.get(address)
        if wanted is None:
            return
        numbers = [float(one) for one in arguments if isinstance(one, int | float)]
        if len(numbers) != len(arguments) or len(numbers) != wanted * joints or joints > MOST_JOINTS:
            raise ValueError(
                f"{address} takes {wanted} numbers for each of the {joints} joints of this show's skeleton, "
                f"in its order; {len(numbers)} came."
            )
        if not all(map(math.isfinite, numbers)):
            raise ValueError(f"{address}: a number is none.")
        if address == POSITIONS:
            self._root = (numbers[0], numbers[1], numbers[2])
        else:
            self._writer.write(now, self._root, numbers)

    def close(self) -> None:
        """Release the file."""
        self._writer.close()
