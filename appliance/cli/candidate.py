"""Can this show dance on this box? Checked in a separate process: a broken network may crash it."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

from appliance.box.realtime import prepare_environment

prepare_environment()

from appliance.cli.check import verified_parts  # noqa: E402  (numpy must find the environment prepared)
from appliance.cli.prepare_show import prepare_show  # noqa: E402
from appliance.cli.run_with_timeout import limit_memory  # noqa: E402
from appliance.pose.correctable_error import CorrectableError  # noqa: E402


def main(show: str, box: str) -> int:
    """0: it dances; 1: it does not, and stderr says why.

    Sensors without keys are no reason to refuse: they can be provisioned later. Neither are iterations that
    the stage has to lower: while a box starts, other programs disturb the measurement. A network is too slow
    if half of its runs are, even with a single iteration.
    """
    limit_memory()
    try:
        _, verdict = verified_parts(Path(show), Path(box))
    except CorrectableError as error:
        print(error, file=sys.stderr)
        return 1
    except MemoryError:
        print(f"{show}: it takes more memory than this box has for a show.", file=sys.stderr)
        return 1
    if verdict.p50_ms > verdict.asked_coding * verdict.budget_ms:
        print(verdict.sentence(), file=sys.stderr)
        return 1
    with contextlib.suppress(Exception):  # without it the show only starts somewhat later
        prepare_show(Path(show))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
