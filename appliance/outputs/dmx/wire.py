"""What carries one universe to the lights: Art-Net, sACN or an adapter on a USB cable."""

from __future__ import annotations

from typing import Protocol


class Wire(Protocol):
    """One universe on its way. Nothing here waits for a light, and nothing raises.

    What cannot be sent at once is dropped and counted: the next universe is 25 ms away. A wire that failed
    opens itself again, after 0.1 s at first and 2 s at last.
    """

    name: str  # how to call it in front of people: 'Art-Net 192.168.0.30, universe 1'

    @property
    def sent(self) -> int:
        """Universes that left."""

    @property
    def dropped(self) -> int:
        """Universes that did not."""

    @property
    def last_error(self) -> str:
        """Why the last one was dropped, in a few words; stays after the wire is well again."""

    @property
    def is_open(self) -> bool:
        """Whether the newest universe left."""

    @property
    def trouble(self) -> str | None:
        """For people: what happened, what the audience sees, what to do; None while all is well."""

    def send(self, data: bytes | bytearray, now: float) -> None:
        """One universe, 512 levels; `now` in monotonic seconds. The levels are copied."""

    def close(self, now: float) -> None:
        """The last one to call: lets what was sent last leave, says goodbye where the wire has a word for it.

        Lights hold what they got last: send zeros or the safe look before.
        """
