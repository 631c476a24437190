"""The stream's process: pictures from standard input; `w` to standard output for each that is wanted."""

from __future__ import annotations

import asyncio
import os
import sys
from contextlib import suppress

from appliance.box.log import process_log
from appliance.box.parent_death import end_with_parent
from appliance.projector.stream.server import serve
from appliance.show.stream import StreamConfig

_ERRORS = 2  # standard output has the wishes for pictures


def main() -> None:
    """Serve until the projector ends."""
    end_with_parent()
    config = StreamConfig.model_validate_json(sys.argv[1])
    try:
        with process_log(_ERRORS), suppress(KeyboardInterrupt):
            asyncio.run(serve(config, sys.stdin.buffer, sys.stdout.buffer))
    except OSError as error:
        sys.exit(
            f"The stream cannot listen on {config.host}, port {config.port} ({error.strerror}). The audience "
            "sees the picture; media servers and mixers do not. Choose another port in the box file."
        )
    os._exit(0)  # the thread that waits for pictures has nothing to end


if __name__ == "__main__":
    main()
