"""`python -m appliance.console SETTINGS`: only the page, and only what it needs is loaded."""

from __future__ import annotations

import logging
import sys

from appliance.box.parent_death import end_with_parent

_log = logging.getLogger("appliance.console")  # `python -m` calls it otherwise


def main() -> int:
    """Run with the settings that `bunraku console` or `bunraku play` hands over; the exit status."""
    end_with_parent()
    from appliance.box.log import process_log
    from appliance.console.run import run_console
    from appliance.console.settings import ConsoleSettings

    settings = ConsoleSettings.unpacked(sys.argv[1])
    with process_log():
        try:
            return run_console(settings)
        except OSError as error:
            _log.error(
                f"{error.filename or settings.folder}: the page has no place there ({error.strerror}). No "
                "browser opens it; the dance goes on. Free space there, or give another folder as `state:`."
            )
    return 1


if __name__ == "__main__":
    sys.exit(main())
