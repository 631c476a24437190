"""Live input: a whole dancer, by the motion capture or camera program that sends it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from appliance.box.live_pose import MOST_JOINTS, LivePoseWriter
from appliance.dancer.live import SILENT_S
from appliance.levers.sources import LIVE
from appliance.outputs.shared_frame import Facts
from appliance.pose.point_layouts import LAYOUTS
from appliance.pose.possible import FARTHEST_M
from appliance.show_control.command import require_read
from appliance.show_control.figure_datagram import DATAGRAM, turns_in
from appliance.show_control.figure_pose import OF_BODY, FigurePose
from appliance.show_control.points_input import PointsInput, layout_named
from appliance.show_control.vmc_input import BONE, ROOT, VmcInput
from appliance.show_control.vmc_input import PREFIX as VMC

ROTATIONS, POSITIONS = "/mocap/0/joint/rot_local", "/mocap/0/joint/pos_world"
_SILENT = ("/mocap/0/joint/rot_world", "/mocap/0/joint/pos_local")  # say nothing new
_MOST_NAMED = 5  # bones in a sentence
_UNIT = 1.1  # no part of a rotation is larger


def is_live(address: str) -> bool:
    """Whether a message is part of a dancer's stream, and no command."""
    return address in (ROTATIONS, POSITIONS, DATAGRAM, *_SILENT) or address.startswith(VMC)


class _Guest:
    """This show's figure, and the ways in which a dancer comes to it."""

    def __init__(self, facts: Facts) -> None:
        self.facts = facts
        self.figure = FigurePose(facts.skeleton)
        self.vmc = VmcInput(self.figure)
        self.points: dict[str, PointsInput] = {}


class LiveInput:
    """Checks what comes, and publishes the newest pose. Raises OSError where the folder takes no file."""

    def __init__(self, folder: Path) -> None:
        self._writer = LivePoseWriter(folder)
        self._root = (math.nan, math.nan, math.nan)
        self._guest: _Guest | None = None
        self._heard_at = self._points_at = -math.inf
        self._came = ""
        self._missing: list[str] = []  # bones that the newest pose came without

    def hear(self, address: str, arguments: Sequence[object], facts: Facts | None, now: float) -> None:
        """One message that `is_live`. Raises ValueError with one clear sentence."""
        if address == DATAGRAM:
            self._hear_figure(arguments[0], self._guest_of(facts), now)
            return
        if address in _SILENT or (address.startswith(VMC) and address not in (BONE, ROOT)):
            return  # faces, cameras, states: nothing of the figure
        guest = self._guest_of(facts)
        require_read(address, arguments)
        if address.startswith(VMC):
            if (whole := guest.vmc.hear(address, arguments)) is not None:
                self._write(now, *whole)
                self._note(guest.figure, guest.vmc.known)
            return
        name, *numbers = arguments if arguments and isinstance(arguments[0], str) else ("", *arguments)
        values = [float(one) for one in numbers if isinstance(one, int | float)]
        is_points = address == POSITIONS and len(values) == len(numbers)
        if not (is_points and self._hear_points(str(name), values, guest, now)):
            self._hear_joints(address, values, len(arguments), guest, now)

    def _hear_joints(
        self, address: str, values: Sequence[float], count: int, guest: _Guest, now: float
    ) -> None:
        """All joints of this show's figure, in its order. count: arguments that came, numbers or not."""
        joints, wanted = len(guest.facts.skeleton), 4 if address == ROTATIONS else 3
        if address == ROTATIONS and len(values) != 4 * joints and now - self._points_at <= SILENT_S:
            return  # the points of the same program are taken
        if len(values) != count or count != wanted * joints:
            layouts = f", or the points of {', '.join(LAYOUTS)}" if address == POSITIONS else ""
            raise ValueError(
                f"{address} takes {wanted} numbers for each of the {joints} joints of this show's skeleton, "
                f"in its order{layouts}; {len(values)} came."
            )
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{address}: a value is not a finite number.")
        if address == POSITIONS:
            x, y, z = values[:3]
            if max(abs(x), abs(y), abs(z)) > FARTHEST_M:
                raise ValueError(f"{address}: no root is farther than {FARTHEST_M:g} m from the middle.")
            self._root = x, y, z
            return
        if max(map(abs, values)) > _UNIT:
            raise ValueError(f"{address}: a rotation is a quaternion of length 1: w, x, y, z.")
        self._write(now, self._root, values)
        self._came, self._missing = f"{joints} of {joints} joints", []

    def _hear_figure(self, received: object, guest: _Guest, now: float) -> None:
        if not isinstance(received, bytes) or (whole := turns_in(received)) is None:
            return
        known = guest.figure.known(whole.turns)
        self._write(now, whole.hips, guest.figure.rotations(whole.turns, known))
        self._note(guest.figure, known, whole.program)

    def _guest_of(self, facts: Facts | None) -> _Guest:
        if facts is None or LIVE not in facts.phrases:
            raise ValueError(
                "No show on this box takes a live dancer: nothing is changed. Write `live: true` under "
                "`motion` in its show.yaml."
            )
        if len(facts.skeleton) > MOST_JOINTS:
            raise ValueError(f"A live dancer has at most {MOST_JOINTS} joints, and this show's has more.")
        if self._guest is None or self._guest.facts is not facts:
            self._guest = _Guest(facts)
        return self._guest

    def _hear_points(self, name: str, values: Sequence[float], guest: _Guest, now: float) -> bool:
        """Points of a camera program; False: these are positions of this show's joints."""
        count, rest = divmod(len(values), 3)
        if rest or (not name and count == len(guest.facts.skeleton)):
            return False
        if not (name := layout_named(name, count)):
            return False
        if name not in guest.points:
            guest.points[name] = PointsInput(guest.facts.skeleton, guest.figure, name)
        points = guest.points[name]
        self._points_at = now
        if (whole := points.hear(values, now)) is not None:
            self._write(now, *whole)
            self._note(guest.figure, points.known, f"{points.layout.program}'s {count} points")
        return True

    def _note(self, figure: FigurePose, known: frozenset[str], program: str = "") -> None:
        bones = f"{len(known)} of {len(figure.joint_of)} bones"
        self._came = f"{bones} of {program}" if program else bones
        self._missing = figure.missing(known)

    def _write(self, now: float, root: Sequence[float], rotations: Sequence[float]) -> None:
        self._writer.write(now, root, rotations)
        self._heard_at = now

    def came(self, now: float) -> str:
        """How much of the figure comes, like `17 of 17 bones`; empty: no live dancer is heard."""
        return self._came if now - self._heard_at <= SILENT_S else ""

    def partial(self, now: float) -> str:
        """How much comes and what is missing, where that are bones of the body; else empty."""
        is_partial = not OF_BODY.isdisjoint(self._missing)
        return self._without() if is_partial and self.came(now) else ""

    def message(self, now: float) -> str:
        """A sentence about it, for the one that lets the show start from it."""
        if not self.came(now):
            return "No live dancer is heard: the phrase plays on until its program sends."
        if without := self._without():
            return f"Live dancer: {without}. The other joints stay with the phrase."
        return f"Live dancer: {self._came} come."

    def _without(self) -> str:
        """How many bones come, and which do not; empty: all do."""
        names = self._missing
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        return f"{self._came} come, without {', '.join(names[:_MOST_NAMED])}{more}" if names else ""

    def close(self) -> None:
        self._writer.close()
