"""Live input: a whole dancer's motion capture as OSC, as AI-Toolbox and VMC programs send it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from appliance.box.live_pose import MOST_JOINTS, LivePoseWriter
from appliance.outputs.shared_frame import Facts
from appliance.show.sources import LIVE
from appliance.show_control.command import require_read
from appliance.show_control.vmc_input import BONE, ROOT, VmcInput
from appliance.show_control.vmc_input import PREFIX as VMC

ROTATIONS, POSITIONS = "/mocap/0/joint/rot_local", "/mocap/0/joint/pos_world"
_SILENT = "/mocap/0/joint/rot_world"  # says nothing new


def is_live(address: str) -> bool:
    """Whether a message is part of a dancer's stream, and no command."""
    return address in (ROTATIONS, POSITIONS, _SILENT) or address.startswith(VMC)


class LiveInput:
    """Checks what comes, and publishes the newest pose. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._writer = LivePoseWriter(folder)
        self._root = (math.nan, math.nan, math.nan)
        self._vmc: tuple[Facts, VmcInput] | None = None

    def hear(self, address: str, arguments: Sequence[object], facts: Facts | None, now: float) -> None:
        """One message that `is_live`. Raises ValueError with one clear sentence."""
        if address.startswith(VMC) and address not in (BONE, ROOT):
            return  # faces, cameras, states: nothing of the figure
        if facts is None or LIVE not in facts.phrases:
            raise ValueError(
                "No show on this box takes a live dancer: nothing is changed. Write `live: true` under "
                "`motion` in its show.yaml."
            )
        require_read(address, arguments)
        if address.startswith(VMC):
            self._hear_vmc(address, arguments, facts, now)
            return
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

    def _hear_vmc(self, address: str, arguments: Sequence[object], facts: Facts, now: float) -> None:
        if self._vmc is None or self._vmc[0] is not facts:
            self._vmc = facts, VmcInput(facts.skeleton)
        if len(facts.skeleton) > MOST_JOINTS:
            raise ValueError(f"A live dancer has at most {MOST_JOINTS} joints, and this show's has more.")
        if (whole := self._vmc[1].hear(address, arguments)) is not None:
            self._writer.write(now, *whole)

    def close(self) -> None:
        """Release the file."""
        self._writer.close()
