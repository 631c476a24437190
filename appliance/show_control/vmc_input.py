"""The Virtual Motion Capture protocol (protocol.vmc.info): a dancer, bone by bone, and trackers of hands."""

from __future__ import annotations

import math
from collections.abc import Sequence

from appliance.box.orders import Order
from appliance.outputs.shared_frame import Facts
from appliance.pose.possible import FARTHEST_M
from appliance.pose.turns import UNTURNED, Quaternion, Vector, multiplied, rotated
from appliance.show_control.command import require_read
from appliance.show_control.figure_pose import BONES, HIPS, FigurePose, in_room

PREFIX = "/VMC/Ext/"
BONE, ROOT = f"{PREFIX}Bone/Pos", f"{PREFIX}Root/Pos"
TRACKERS = frozenset(f"{PREFIX}{kind}/Pos" for kind in ("Tra", "Con", "Hmd"))  # tracker, controller, headset
EVERY_S = 0.018  # a tracker may send 250 times a second: one place a tick is enough
SILENT_S = 0.5  # after which its joints are given back
_UNIT = 0.1  # a rotation this far from unit length is invalid


class VmcInput:
    """Collects the bones of a frame; what comes of them is a pose of the figure.

    Unity's axes are left-handed: X is mirrored, so (x, y, z, w) becomes (w, x, -y, -z). Rotations count from
    a T-pose, whatever the skeleton's zero pose is, and are relative to the next bone above: joints between
    two bones stay as in that T-pose where the lower one comes. Bones that come neither in this frame nor in
    the one before are unknown; those that this figure lacks turn what hangs on them. Nothing in the protocol
    ends a frame: it is whole when all bones of the frame before have come, or one of them comes again.
    """

    def __init__(self, figure: FigurePose) -> None:
        self._figure = figure
        self._turns: dict[str, Quaternion] = {}
        self._root: tuple[Vector, Quaternion] = (0.0, 0.0, 0.0), UNTURNED
        self._hips: Vector = (0.0, 0.0, 0.0)
        self._came: set[str] = set()
        self._whole: set[str] = set()

    @property
    def known(self) -> frozenset[str]:
        """Bones of this figure that came in the last two frames."""
        return self._figure.known(self._came | self._whole)

    def hear(self, address: str, arguments: Sequence[object]) -> tuple[Vector, list[float]] | None:
        """One message; the hips' place in metres and all joints' w, x, y, z in the skeleton's order once a
        frame is whole, else None. An unknown value is not a number. Raises ValueError with one clear
        sentence.
        """
        if address not in (BONE, ROOT):
            return None
        name, place, rotation = parsed(address, arguments)
        if address == BONE and name not in BONES:
            return None  # a name from outside never stays in memory
        if (address == ROOT or name == HIPS) and max(map(abs, place)) > FARTHEST_M:
            raise ValueError(f"{address} {name}: no place is farther than {FARTHEST_M:g} m from the middle.")
        if not any(rotation):
            return None  # so some programs send what they do not track
        length = math.hypot(*rotation)
        if not abs(length - 1.0) < _UNIT:
            raise ValueError(f"{address} {name}: a rotation has the length 1, and {length:.3g} came.")
        w, x, y, z = (part / length for part in rotation)
        turned = w, x, y, z
        if address == ROOT:
            self._root = place, turned
            return None
        whole = None
        if name in self._came:  # the next frame has begun
            whole = None if self._came == self._whole else self._pose()
            self._whole, self._came = self._came, set()
        self._came.add(name)
        self._turns[name] = turned
        if name == HIPS:
            self._hips = place
        return self._pose() if self._came == self._whole else whole

    def _pose(self) -> tuple[Vector, list[float]] | None:
        if not (known := self.known):
            return None
        (root, root_turned), came = self._root, self._came | self._whole
        turns = {bone: self._turns[bone] for bone in came}
        turns[HIPS] = multiplied(root_turned, self._turns.get(HIPS, UNTURNED))
        reach = rotated(root_turned, self._hips)
        place = (root[0] + reach[0], root[1] + reach[1], root[2] + reach[2])
        rotations = self._figure.rotations(in_room(turns), known)
        return place if HIPS in known else (math.nan,) * 3, rotations


def parsed(address: str, arguments: Sequence[object]) -> tuple[str, Vector, Quaternion]:
    """Name, position and rotation in the box's axes. A root may have scale and offset behind them."""
    name, *numbers = arguments or ("",)
    values = [float(one) for one in numbers[:7] if isinstance(one, int | float)]
    if not isinstance(name, str) or len(values) != 7 or not all(map(math.isfinite, values)):
        raise ValueError(f"{address} takes a name and seven numbers: x, y, z, and a rotation as x, y, z, w.")
    x, y, z, turn_x, turn_y, turn_z, w = values
    return name[:1].upper() + name[1:], (-x, y, z), (w, turn_x, -turn_y, -turn_z)


class Trackers:
    """Makes orders of what trackers send; those that no hand names are passed over."""

    def __init__(self) -> None:
        self._sent_at: dict[str, float] = {}

    def orders(
        self, address: str, arguments: Sequence[object], facts: Facts | None, now: float
    ) -> list[Order]:
        """The places of one message of TRACKERS. Raises ValueError with one clear sentence."""
        name = arguments[0] if arguments else None
        if facts is None or not isinstance(name, str) or name not in facts.trackers:
            return []
        require_read(address, arguments)
        _, place, _ = parsed(address, arguments)
        if now - self._sent_at.get(name, -EVERY_S) < EVERY_S:
            return []
        self._sent_at[name] = now
        return [Order("place", (*place, SILENT_S), joint, quiet=True) for joint in facts.trackers[name]]
