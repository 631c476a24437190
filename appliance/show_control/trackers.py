"""Trackers of the VMC protocol: each moves the joints whose hands name it (`tracker` in show.yaml)."""

from __future__ import annotations

from collections.abc import Sequence

from appliance.box.orders import Order
from appliance.outputs.shared_frame import Facts
from appliance.show_control.command import require_read
from appliance.show_control.vmc_input import PREFIX, parsed

TRACKERS = frozenset(f"{PREFIX}{kind}/Pos" for kind in ("Tra", "Con", "Hmd"))  # tracker, controller, headset
EVERY_S = 0.018  # a tracker may send 250 times a second: one place a tick is enough
SILENT_S = 0.5  # after which its joints are given back


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
