"""The PIN, and the devices that gave it: remembered, listed, revoked; wrong PINs cost time."""

from __future__ import annotations

import hashlib
import json
import secrets
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from appliance.box.durable import private_folder
from appliance.box.record import WholeFile
from appliance.pose.foreign_file import plain_json

DIGITS, LONG_DIGITS = 6, 10
MOST_DEVICES = 32  # beyond it the one that gave the PIN first gives way
LONGEST_NAME = 40
FREE_TRIES, PAUSE_S, LONGEST_PAUSE_S = 5, 60.0, 900.0
MOST_WRONG = 1000  # wrong PINs of all addresses, in a day: then a million PINs are too few
_MOST_ASKERS = 4096
_DAY_S = 24 * 3600.0
_LARGEST = 1 << 16


@dataclass(frozen=True)
class Device:
    """A browser that gave the PIN. digest: of the token that only it keeps; since: Unix seconds."""

    id: str
    name: str
    digest: str
    since: float


class Devices:
    """The file with PIN and devices, which other processes may change. Raises OSError without a place."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = WholeFile(path, _LARGEST)
        self._changed = -1
        self._pin = ""
        self._devices: tuple[Device, ...] = ()
        self._look()
        if not self._pin:
            self._write(new_pin(), ())

    @property
    def pin(self) -> str:
        """Six digits; ten after an attack."""
        self._look()
        return self._pin

    @property
    def devices(self) -> tuple[Device, ...]:
        """Those that gave it, in that order."""
        self._look()
        return self._devices

    def change_pin(self) -> str:
        """A new PIN; all devices are forgotten."""
        self._write(new_pin(), ())
        return self._pin

    def lengthen_pin(self) -> bool:
        """A new PIN that takes too long to guess, whether there was none yet; devices stay remembered."""
        if len(self.pin) == LONG_DIGITS:
            return False
        self._keep(new_pin(LONG_DIGITS), self._devices)
        return True

    def remember(self, name: str) -> str:
        """Remember one more device; its token. A disk that does not take it shuts nobody out."""
        token = secrets.token_hex(32)
        others = self.devices[-(MOST_DEVICES - 1) :]
        self._keep(self._pin, (*others, Device(secrets.token_hex(4), name, digest(token), time.time())))
        return token

    def known(self, token: str) -> Device | None:
        given = digest(token)
        return next((one for one in self.devices if secrets.compare_digest(one.digest, given)), None)

    def revoke(self, device_id: str) -> bool:
        """Whether there was such a device; it needs the PIN again."""
        others = tuple(one for one in self.devices if one.id != device_id)
        if len(others) == len(self._devices):
            return False
        self._keep(self._pin, others)
        return True

    def _keep(self, pin: str, devices: tuple[Device, ...]) -> None:
        """As `_write`; without a place on the disk it counts until this process ends."""
        try:
            self._write(pin, devices)
        except OSError:
            self._pin, self._devices = pin, devices

    def _look(self) -> None:
        """Read the file again where it has changed; a spoilt one is as good as none."""
        try:
            changed = self.path.stat().st_mtime_ns
        except OSError:
            return
        if changed == self._changed:
            return
        try:
            values = plain_json(self._file.read()[0])
            devices = tuple(Device(**device) for device in values["devices"])
            pin = values["pin"]
            if not (isinstance(pin, str) and len(pin) in (DIGITS, LONG_DIGITS) and pin.isdecimal()):
                return
        except (OSError, ValueError, KeyError, TypeError, IndexError):
            return
        self._pin, self._devices, self._changed = pin, devices, changed

    def _write(self, pin: str, devices: tuple[Device, ...]) -> None:
        private_folder(self.path.parent)
        values = {"pin": pin, "devices": [asdict(device) for device in devices]}
        self._file.write(json.dumps(values, indent=1).encode())
        self._pin, self._devices, self._changed = pin, devices, self.path.stat().st_mtime_ns


@dataclass(frozen=True)
class _Tries:
    """Wrong PINs in a row, and when the last one came."""

    count: int = 0
    last: float = 0.0

    def more(self, now: float) -> _Tries:
        return _Tries(1 if now - self.last > LONGEST_PAUSE_S else self.count + 1, now)

    def wait_s(self, now: float) -> float:
        """Each wrong PIN after the free ones doubles the pause."""
        if self.count < FREE_TRIES:
            return 0.0
        pause_s = PAUSE_S * 2.0 ** min(self.count - FREE_TRIES, 10)
        return max(0.0, self.last + min(pause_s, LONGEST_PAUSE_S) - now)


class WrongPins:
    """How many wrong PINs came from where. An address waits for its own: nobody else does.

    Many addresses together guess faster than one, so `are_too_many` asks for a longer PIN.
    """

    def __init__(self) -> None:
        self._of: dict[str, _Tries] = {}
        self._all, self._since = 0, 0.0

    def wait_s(self, asker: str, now: float) -> float:
        """How long this address waits before its next try; 0: none."""
        return self._of.get(asker, _Tries()).wait_s(now)

    def note(self, asker: str, now: float) -> None:
        """One more wrong PIN."""
        self._of[asker] = self._of.pop(asker, _Tries()).more(now)
        while len(self._of) > _MOST_ASKERS:
            self._of.pop(next(iter(self._of)))
        if now - self._since > _DAY_S:
            self._all, self._since = 0, now
        self._all += 1

    def forget(self, asker: str) -> None:
        """This address gave the right PIN."""
        self._of.pop(asker, None)

    @property
    def are_too_many(self) -> bool:
        """Whether all of a day together come near to guessing six digits."""
        return self._all >= MOST_WRONG


def new_pin(digits: int = DIGITS) -> str:
    """Digits that nobody guesses."""
    return f"{secrets.randbelow(10**digits):0{digits}}"


def digest(token: str) -> str:
    """A secret is kept as this: it opens nothing."""
    return hashlib.sha256(token.encode(errors="replace")).hexdigest()
