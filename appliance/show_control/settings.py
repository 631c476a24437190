"""The settings of a box file that show control needs, as its process gets them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from appliance.pose.foreign_file import with_tuples
from appliance.sensor.foreign.sources import SourceSettings
from appliance.show_control.foreign_sensors import ForeignPort

Listener = tuple[str, int]  # address and port


@dataclass(frozen=True)
class ControlSettings:
    """The port's socket is open already: `descriptor`. `key_file`, `state` (the box's folder on the disk):
    empty for none.
    """

    folder: str
    descriptor: int
    senders: tuple[str, ...] = ()
    heartbeat: tuple[Listener, ...] = ()
    key_file: str = ""
    replies: tuple[Listener, ...] = ()
    feedback: tuple[Listener, ...] = ()
    foreign: tuple[ForeignPort, ...] = ()
    state: str = ""

    def packed(self) -> str:
        """As one argument of a command line; there are no secrets in it."""
        return json.dumps(asdict(self))

    @classmethod
    def unpacked(cls, text: str) -> ControlSettings:
        """From that argument."""
        values = with_tuples(json.loads(text))
        foreign = tuple(
            ForeignPort(**port | {"sensors": tuple(SourceSettings(**one) for one in port["sensors"])})
            for port in values["foreign"]
        )
        return cls(**values | {"foreign": foreign})
