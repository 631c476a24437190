"""`python -m appliance.control SETTINGS`: show control alone, with nothing loaded that it does not need."""

from __future__ import annotations

import sys

from appliance.control.lifeline import hold_lifeline


def main() -> int:
    """Run with the settings that `bunraku control` or `bunraku play` hands over; the exit status."""
    hold_lifeline()
    from appliance.control.run import control
    from appliance.control.settings import Settings
    from appliance.control.speaker import Speaker

    speaker = Speaker()
    try:
        return control(Settings.unpacked(sys.argv[1]), speaker.say)
    except OSError as error:
        speaker.say(f"Show control does not start: {error}.")
        return 1
    finally:
        speaker.close()


if __name__ == "__main__":
    sys.exit(main())
