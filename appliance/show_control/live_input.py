"""Live input: a whole dancer's motion capture as OSC, as AI-Toolbox and VMC programs send it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from appliance.box.live_pose import MOST_JOINTS, LivePoseWriter
from appliance.dancer.live import SILENT_S
from appliance.levers.sources import LIVE
from appliance.outputs.shared_frame import Facts
from appliance.pose.possible import FARTHEST_M
from appliance.show_control.command import require_read
from appliance.show_control.vmc_input import BONE, ROOT, VmcInput
from appliance.show_control.vmc_input import PREFIX as VMC

ROTATIONS, POSITIONS = "/mocap/0/joint/rot_local", "/mocap/0/joint/pos_world"
_SILENT = "/mocap/0/joint/rot_world"  # says nothing new
_MOST_NAMED = 5  # bones in a sentence
_UNIT = 1.1  # no part of a rotation is larger


def is_live(address: str) -> bool:
    """Whether a message is part of a dancer's stream, and no command."""
    return address in (ROTATIONS, POSITIONS, _SILENT) or address.startswith(VMC)


class LiveInput:
    """Checks what comes, and publishes the newest pose. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._writer = LivePoseWriter(folder)
        self._root = (math.nan, math.nan, math.nan)
        self._vmc: tuple[Facts, VmcInput] | None = None
        self._heard_at = -math.inf
        self._came = ""
        self._newest: VmcInput | None = None  # where the newest pose came bone by bone

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
            x, y, z = numbers[:3]
            if max(abs(x), abs(y), abs(z)) > FARTHEST_M:
                raise ValueError(f"{address}: no root is farther than {FARTHEST_M:g} m from the middle.")
            self._root = x, y, z
            return
        if max(map(abs, numbers)) > _UNIT:
            raise ValueError(f"{address}: a rotation is a quaternion of length 1: w, x, y, z.")
        self._write(now, self._root, numbers)
        self._came, self._newest = f"{joints} of {joints} joints", None

    def _hear_vmc(self, address: str, arguments: Sequence[object], facts: Facts, now: float) -> None:
        if self._vmc is None or self._vmc[0] is not facts:
            self._vmc = facts, VmcInput(facts.skeleton)
        if len(facts.skeleton) > MOST_JOINTS:
            raise ValueError(f"A live dancer has at most {MOST_JOINTS} joints, and this show's has more.")
        vmc = self._vmc[1]
        if (whole := vmc.hear(address, arguments)) is not None:
            self._write(now, *whole)
            self._came, self._newest = f"{len(vmc.known)} of {vmc.bones} bones", vmc

    def _write(self, now: float, root: Sequence[float], rotations: Sequence[float]) -> None:
        self._writer.write(now, root, rotations)
        self._heard_at = now

    def came(self, now: float) -> str:
        """How much of the figure comes, like `17 of 17 bones`; empty: no live dancer is heard."""
        return self._came if now - self._heard_at <= SILENT_S else ""

    def partial(self, now: float) -> str:
        """How much comes and what is missing, where that are bones of the body; else empty."""
        is_partial = self._newest is not None and not self._newest.is_whole
        return self._without() if is_partial and self.came(now) else ""

    def words(self, now: float) -> str:
        """A sentence about it, for the one that lets the show start from it."""
        if not self.came(now):
            return "No live dancer is heard: the phrase plays on until its program sends."
        if without := self._without():
            return f"Of the live dancer {without}: the others stay with the phrase."
        return f"Of the live dancer {self._came} come."

    def _without(self) -> str:
        """How many bones come, and which do not; empty: all do."""
        names = [] if self._newest is None else self._newest.missing
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        return f"{self._came} come, without {', '.join(names[:_MOST_NAMED])}{more}" if names else ""

    def close(self) -> None:
        """Release the file."""
        self._writer.close()
