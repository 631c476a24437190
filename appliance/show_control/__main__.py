"""`python -m appliance.show_control SETTINGS`: only show control, and only what it needs is loaded."""

from __future__ import annotations

import sys

from appliance.box.parent_death import end_with_parent


def main() -> int:
    """Run with the settings that `bunraku control` or `bunraku play` hands over; the exit status."""
    end_with_parent()
    from appliance.box.log_writer import LogWriter
    from appliance.show_control.run import control
    from appliance.show_control.settings import Settings

    speaker, settings = LogWriter(), Settings.unpacked(sys.argv[1])
    try:
        return control(settings, speaker.say)
    except BlockingIOError:
        speaker.say(
            f"Another show control is at work in {settings.folder}. It goes on, and this one does not start. "
            "Stop it, or give each box its own folder: `runtime:` in the box file."
        )
        return 1
    except OSError as error:
        speaker.say(
            f"{settings.folder}: show control has no place there ({error.strerror}). Nobody hears commands; "
            "the dance goes on. Free memory there, or give another folder as `runtime:` in the box file."
        )
        return 1
    finally:
        speaker.close()


if __name__ == "__main__":
    sys.exit(main())
