"""`python -m appliance.show_control SETTINGS`: only show control, and only what it needs is loaded."""

from __future__ import annotations

import logging
import sys

from appliance.box.parent_death import end_with_parent

_log = logging.getLogger("appliance.show_control")  # `python -m` calls it otherwise


def main() -> int:
    """Run with the settings that `bunraku control` or `bunraku play` hands over; the exit status."""
    end_with_parent()
    from appliance.box.log import process_log
    from appliance.show_control.run import control
    from appliance.show_control.settings import ControlSettings

    settings = ControlSettings.unpacked(sys.argv[1])
    with process_log():
        try:
            return control(settings)
        except BlockingIOError:
            _log.error(
                f"Another show control is at work in {settings.folder}. It goes on, and this one does not "
                "start. Stop it, or give each box its own folder: `runtime:` in the box file."
            )
        except OSError as error:
            _log.error(
                f"{settings.folder}: show control has no place there ({error.strerror}). Nobody hears "
                "commands; the dance goes on. Free memory there, or give another folder as `runtime:` in the "
                "box file."
            )
    return 1


if __name__ == "__main__":
    sys.exit(main())
