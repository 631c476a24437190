"""The key of one sensor: who it is, and the secret that it signs with."""

from __future__ import annotations

from dataclasses import dataclass, field
from hashlib import blake2s


@dataclass(frozen=True)
class SensorKey:
    """One sensor: its name in the show, its 32-bit device id, and its 128-bit key (which repr leaves out).

    source: of a foreign sensor, like phone; "" for a wearable.
    """

    name: str
    device_id: int
    key: bytes = field(repr=False)
    source: str = ""

    @property
    def wearable(self) -> int:
        """Identifies the wearable that this entry lets in, 32 bits; changes at each provisioning."""
        tag = blake2s(self.device_id.to_bytes(4, "little"), key=self.key, digest_size=4, person=b"wearable")
        return int.from_bytes(tag.digest(), "little")
