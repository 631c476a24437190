"""The command `bunraku`: play and preflight start at once; all else, and every mistake, goes to the parser.

A stage that was killed is black until its process is up again, a box that is switched on until the preflight
has ended: the parser and what it loads take a tenth of a second of that, and neither has a use for them.
"""

from __future__ import annotations

import contextlib
import faulthandler
import sys
from collections.abc import Sequence
from pathlib import Path

from appliance.box.parent_death import end_with_parent
from appliance.box.realtime import prepare_environment, spare_the_collector

_PATHS = ("--show", "--box", "--journal", "--chosen")
_SECONDS, _ALONE = "--seconds", "--alone"
_FEWEST_SECONDS = 0.1
INTERRUPTED = 130  # as shells say it

Options = dict[str, Path | float | bool]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; errors that people can mend are one clear line and exit status 2."""
    with contextlib.suppress(OSError, ValueError, AttributeError):  # no standard error to write to
        faulthandler.enable()  # the watchdog's signal prints the line that hung
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] == ["preflight"]:
        from appliance.cli.preflight import main as preflight

        sys.exit(preflight(given[1:]))
    spare_the_collector()
    options = options_of_play(given)
    if options is None:
        from appliance.cli.app import main as any_command

        any_command(given)
        return
    end_with_parent()
    prepare_environment()
    try:
        sys.exit(_play(options))
    except KeyboardInterrupt:  # before there was anything to stop
        sys.exit(INTERRUPTED)
    except Exception as error:
        from appliance.cli.app import refuse

        refuse(error)


def options_of_play(given: Sequence[str]) -> Options | None:
    """The options of a plain `play`, by their names; None where the whole parser must look."""
    if not given or given[0] != "play":
        return None
    options: Options = {}
    rest = list(given[1:])
    while rest:
        option, separator, value = rest.pop(0).partition("=")
        if option == _ALONE and not separator:
            options["alone"] = True
            continue
        if not separator and rest:
            value = rest.pop(0)
        if not value or value.startswith("-"):
            return None
        if option in _PATHS:
            options[option[2:]] = Path(value)
        elif option == _SECONDS and (seconds := _number(value)) >= _FEWEST_SECONDS:
            options["seconds"] = seconds
        else:
            return None
    return None if "chosen" in options and {"show", "box"} & options.keys() else options


def _play(options: Options) -> int:
    from appliance.cli.play import PlayOptions, play_show

    # options_of_play gives each name its type
    return play_show(PlayOptions(**options))  # type: ignore[arg-type]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


if __name__ == "__main__":
    main()
