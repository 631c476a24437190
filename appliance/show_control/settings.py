"""The settings of a box file that show control needs, as its process gets them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

Listener = tuple[str, int]  # address and port


@dataclass(frozen=True)
class Settings:
    """The port's socket is open already: `descriptor`. `key_file`: empty for none."""

    folder: str
    descriptor: int
    senders: tuple[str, ...] = ()
    heartbeat: tuple[Listener, ...] = ()
    key_file: str = ""
    replies: tuple[Listener, ...] = ()

    def packed(self) -> str:
        """As one argument of a command line; there are no secrets in it."""
        return json.dumps(asdict(self))

    @classmethod
    def unpacked(cls, text: str) -> Settings:
        """From that argument."""
        values = json.loads(text)
        heartbeat, replies = (
            tuple((str(host), int(port)) for host, port in values[name]) for name in ("heartbeat", "replies")
        )
        changed = {"senders": tuple(values["senders"]), "heartbeat": heartbeat, "replies": replies}
        return cls(**values | changed)
