"""The rate of a universe: that of its wire while it changes, keep-alives while it does not."""

from __future__ import annotations

from appliance.outputs.dmx.network_wire import NetworkWire
from appliance.outputs.dmx.wire import Wire
from appliance.show.dmx import SLOTS, DmxConfig

KEEP_ALIVE_S = 0.85  # E1.31 section 6.6.2: 0.8 to 1.0 s, as Art-Net 4 by now; before: 4 s at the latest
EARLY = 0.75  # fraction of a period
REPEATS = 3  # E1.31 section 6.6.2: repeats after the last change, before keep-alives


class Universe:
    """One universe on one wire. Offer levels at the wire's rate or faster: the newest leave, none wait.

    The rate is never exceeded by more than one universe. A caller that wakes late, or offers 50 a second to a
    wire that takes 40, still gets the full rate: a universe may leave three quarters of a period early.
    """

    def __init__(self, config: DmxConfig, wire: Wire) -> None:
        self.config = config
        self.wire = wire
        self.number = config.universe  # as the show's fixtures name it
        self._period_s = 1.0 / config.rate
        self._due = float("-inf")  # when the next one would leave at an even rate
        self._newest = bytearray(SLOTS)
        self._changed = False  # since the last one that left
        self._same = 0  # how many alike have left
        self._sent_at = float("-inf")

    def offer(self, data: bytes | bytearray, now: float) -> bool:
        """Offer 512 levels. Returns whether they left. Monotonic seconds; never waits, never raises."""
        if len(data) != SLOTS:
            raise ValueError(f"A universe has {SLOTS} channels, not {len(data)}.")
        if data != self._newest:
            self._newest[:] = data
            self._changed = True
        if now < self._due - EARLY * self._period_s or not (self._changed or self._is_repeated(now)):
            return False
        self._leave(now)
        return True

    def take_over(self, raised: int, now: float) -> None:
        """Another box has sent until now. The next offer leaves at once, by `raised` above this box's usual
        priority where the wire has one.
        """
        self._due, self._changed = float("-inf"), True
        if isinstance(self.wire, NetworkWire):
            self.wire.take_over(raised, now)

    def cede(self, now: float) -> None:
        """Another box sends from now on: what has not left does not leave."""
        self._changed = False
        if isinstance(self.wire, NetworkWire):
            self.wire.cede(now)

    def close(self, now: float) -> None:
        """Send the last offer, if it has not left, and close the wire."""
        if self._changed:
            self._leave(now)
        self.wire.close()

    def _is_repeated(self, now: float) -> bool:
        return self._same < REPEATS or now - self._sent_at >= KEEP_ALIVE_S

    def _leave(self, now: float) -> None:
        self._same = 0 if self._changed else self._same + 1
        self._changed = False
        self._sent_at = now
        self._due = max(self._due, now) + self._period_s
        self.wire.send_universe(self._newest, now)
