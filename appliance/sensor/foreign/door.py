"""The door of foreign sensors: a UDP port on loopback, and the secret that their keys are made of.

Both are in one file of the runtime folder, which only the box's user can read. The stage writes it; the
processes that hear phones and programs read it. The secret outlives the stage, so that a restarted stage
knows the same sensors; the port is a new one at each start.
"""

from __future__ import annotations

import contextlib
import secrets
from hashlib import blake2s
from pathlib import Path

from appliance.box.durable import write_whole
from appliance.sensor.sensor_key import SensorKey
from appliance.sensor.transports.udp import UdpIntake
from appliance.sensor.wire import KEY_BYTES

FILE = "foreign-sensors"
LOOPBACK = "127.0.0.1"
_LOOK_S = 0.5


def open_door(folder: Path) -> tuple[UdpIntake, bytes]:
    """Open the port, and publish it with the secret. Raises PortError; OSError where the folder is full."""
    found = _read(folder)
    secret = secrets.token_bytes(KEY_BYTES) if found is None else found[1]
    intake = UdpIntake(LOOPBACK, 0)
    intake.name = "the door of phones and programs"  # its port is of no use to people
    try:
        write_whole(folder / FILE, f"{intake.address[1]} {secret.hex()}\n".encode(), private=True)
    except OSError:
        intake.close()
        raise
    return intake, secret


def foreign_key(name: str, source: str, secret: bytes) -> SensorKey:
    """The key of a foreign sensor. It changes when the box is switched on again, or with the source."""
    said = f"{source}\0{name}".encode()
    device_id = int.from_bytes(blake2s(said, digest_size=4, person=b"device").digest(), "little") or 1
    return SensorKey(name, device_id, blake2s(said, key=secret, digest_size=KEY_BYTES).digest(), source)


class Door:
    """Where the stage hears foreign sensors now; looks at the file twice a second at most."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._found: tuple[int, bytes] | None = None
        self._look_at = float("-inf")

    def look(self, now: float) -> tuple[int, bytes] | None:
        """Port and secret; None: no stage has opened the door yet."""
        if now >= self._look_at:
            self._look_at = now + _LOOK_S
            self._found = _read(self._folder)
        return self._found


def _read(folder: Path) -> tuple[int, bytes] | None:
    with contextlib.suppress(OSError, ValueError):
        port, secret = (folder / FILE).read_text().split()
        found = int(port), bytes.fromhex(secret)
        if len(found[1]) == KEY_BYTES:
            return found
    return None
