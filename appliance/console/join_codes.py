"""Codes by which a phone becomes a sensor, once each; and the phones that used one."""

from __future__ import annotations

import json
import secrets
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from appliance.box.record import WholeFile
from appliance.console.devices import digest
from appliance.pose.foreign_file import plain_json

FILE = "console.phones"  # in the runtime folder: a phone joins anew after the machine was off
VALID_S = 900.0
_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # none is taken for another one
_LENGTH = 10
_LARGEST = 1 << 14


@dataclass(frozen=True)
class _Admission:
    """A sensor's code and its phone. until: monotonic seconds, because the other clock may be set meanwhile;
    digest: of the pass that the last code became.
    """

    name: str
    code: str = ""
    until: float = 0.0
    digest: str = ""


class JoinCodes:
    """The file with codes and passes, which other processes may change. Raises OSError without a place."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._file = WholeFile(self._path, _LARGEST)
        self._changed = -1
        self._of: dict[str, _Admission] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """The sensors that phones may be."""
        self._look()
        return tuple(self._of)

    def set_names(self, names: Iterable[str]) -> None:
        """Phones may be these sensors, and no others."""
        self._look()
        found = {name: self._of.get(name, _Admission(name)) for name in names}
        if found != self._of or not self._path.exists():
            self._write(found)

    def void(self) -> None:
        """No code and no pass is valid any more; phones join anew."""
        self._look()
        self._write({name: _Admission(name) for name in self._of})

    def new_code(self, name: str, now: float) -> str:
        """A code for one phone, valid for VALID_S, in place of the sensor's last one. Raises KeyError."""
        self._look()
        code = "".join(secrets.choice(_LETTERS) for _ in range(_LENGTH))
        self._write(self._of | {name: replace(self._of[name], code=code, until=now + VALID_S)})
        return code

    def use(self, name: str, code: str, now: float) -> str:
        """The pass of the phone that has this code, which is used up with it; "": the code is not valid."""
        self._look()
        found = self._of.get(name)
        if found is None or not found.code or not 0.0 <= found.until - now < VALID_S + 1.0:
            return ""
        if not secrets.compare_digest(code.encode(errors="replace"), found.code.encode()):
            return ""
        token = secrets.token_hex(16)
        self._write(self._of | {name: _Admission(name, digest=digest(token))})
        return token

    def is_pass(self, name: str, token: str) -> bool:
        """Whether a phone used this sensor's last code and got this pass."""
        self._look()
        found = self._of.get(name)
        return found is not None and secrets.compare_digest(found.digest, digest(token))

    def _look(self) -> None:
        """Read the file again where it has changed; a spoilt one counts as empty."""
        try:
            changed = self._path.stat().st_mtime_ns
            if changed == self._changed:
                return
            found = [_Admission(**one) for one in plain_json(self._file.read()[0])]
        except (OSError, ValueError, TypeError, IndexError):
            return
        self._of, self._changed = {one.name: one for one in found}, changed

    def _write(self, found: dict[str, _Admission]) -> None:
        self._file.write(json.dumps([asdict(one) for one in found.values()]).encode())
        self._of, self._changed = found, self._path.stat().st_mtime_ns
