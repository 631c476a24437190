"""`python -m appliance.console`: holds the page's place, says so to systemd, and listens nowhere."""

from __future__ import annotations

import sys
import time

from appliance.box.notify import Notifier
from appliance.box.stop_signals import stop_signals

_WORDS = "The technician's page comes with a later release. Nothing listens here."
_LOOK_S = 0.2  # at power-off the stage waits for it


def main() -> int:
    """Until it is stopped; the exit status."""
    with stop_signals() as stopped:
        notifier = Notifier()
        print(_WORDS, flush=True)
        notifier.ready(_WORDS)
        while not stopped():
            notifier.ping(time.monotonic())
            time.sleep(_LOOK_S)
        notifier.stopping()
    return 0


if __name__ == "__main__":
    sys.exit(main())
