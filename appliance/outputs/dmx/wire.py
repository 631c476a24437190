"""A wire carries one universe to the lights: Art-Net, sACN or an adapter on a USB cable."""

from __future__ import annotations

from typing import Protocol


class Wire(Protocol):
    """Carries one universe. Never waits for a light, never raises.

    Data that cannot be sent at once is dropped and counted: the next universe is 25 ms away. A wire that
    failed is
    opened again, after 0.1 s at first, then up to every 2 s.
    """

    name: str  # in messages: 'Art-Net 192.168.0.30, universe 1'
    sent: int  # universes that left
    dropped: int  # universes that did not
    last_error: str  # why the last one was dropped, in a few words; stays after the wire is well again
    is_open: bool  # whether the newest universe left

    @property
    def trouble(self) -> str | None:
        """Says what happened, what the audience sees, what to do; None while all is well."""

    @property
    def remark(self) -> str:
        """A further remark while the wire works; "" for none."""

    def send_universe(self, levels: bytes | bytearray, now: float) -> None:
        """Send one universe, 512 levels; `now` in monotonic seconds. The levels are copied."""

    def close(self) -> None:
        """Let the last universe leave, and end the stream where the protocol has a word for it.

        Lights hold what they got last: send zeros or the safe look before.
        """
