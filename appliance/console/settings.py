"""The settings of a box file that the page's process needs, as it gets them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from appliance.pose.foreign_file import with_tuples

WHERE = "console.path"  # in the runtime folder: PIN and devices, host and port of the page that runs, https


@dataclass(frozen=True)
class ConsoleSettings:
    """The port's socket is open already: `descriptor`. control: where commands arrive; None: nowhere.

    journal: its folder; None: none is kept. box: the path of its box file as `box`, or of what the preflight
    chose as `chosen`, or neither. is_installed: systemd starts what the page wants done. folder: where the
    box's processes meet. devices: the file with PIN and remembered devices. viewers, names, rehearsal,
    https: as in the box file. phones: the sensors that phones may be.
    """

    folder: str
    descriptor: int
    devices: str
    control: tuple[str, int] | None = None
    viewers: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    rehearsal: bool = True
    https: bool = False
    journal: str | None = None
    box: dict[str, str] = field(default_factory=dict)
    is_installed: bool = False
    phones: tuple[str, ...] = ()

    def packed(self) -> str:
        """As one argument of a command line; there are no secrets in it."""
        return json.dumps(asdict(self))

    @classmethod
    def unpacked(cls, text: str) -> ConsoleSettings:
        """From that argument."""
        return cls(**with_tuples(json.loads(text)))
