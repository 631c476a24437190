"""`bunraku preflight`: decides at power-on which show dances. Imports little: the box waits for it."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from appliance.box.durable import alone_in
from appliance.cli.run_with_timeout import CHECK_S, TimedOutError, run_with_timeout
from appliance.release.adoption import BoxFolders, Outcome, adopt, built_in_box, chosen_before
from appliance.release.arrivals import look
from appliance.release.choice import BOOTS, CHOSEN, DATA, RUN, STICK, Choice

ANEW = "anew"  # touched to restart the units with another show or box file
_AT_ONCE_S = 120.0  # this soon after power-on a stick takes effect at once; later no show is interrupted
STICK_S = 45.0  # a stick that cannot be read does not keep the box from dancing
# While it dances nobody waits, and a check gets only what the dance leaves of the processors.
LATE_STICK_S, LATE_CHECK_S = 300.0, 240.0
TURN_S, LATE_TURN_S = 20.0, 60.0  # how long to wait for another preflight
_NOT_WRITTEN = 1


class Options(NamedTuple):
    """Where to read and where to write. late: a stick was plugged into a running box; check_release: only
    check whether this release dances."""

    boot: Path | None = None
    stick: Path = STICK
    data: Path = DATA
    run: Path = RUN
    late: bool = False
    check_release: bool = False


def preflight(options: Options, uptime_s: float) -> int:
    """Write chosen.json into the run folder; 0 once it is there, 1 if it cannot be written."""
    folders = BoxFolders(options.data, options.run)
    if options.late:
        with contextlib.suppress(OSError):  # the unit has set it already and allows no change
            os.nice(19)
    try:
        if not options.late:  # this dances even if the new show ends this process
            _say(publish(folders, Outcome(chosen_before(folders), False, ()), False, uptime_s))
        patience_s = LATE_TURN_S if options.late else TURN_S
        with alone_in(options.data, patience_s), alone_in(options.run, patience_s):
            outcome = _found(options, folders)
            for message in outcome.messages:
                _say(message)
            _say(publish(folders, outcome, options.late, uptime_s))
    except BlockingIOError:
        _say("Another preflight has not ended. The show before goes on. Plug the stick in again.")
    except OSError as error:
        _say(
            f"{folders.run}: what was chosen cannot be written there ({error.strerror}). The audience "
            "sees the show that comes with the box. Check the owner of this folder."
        )
        return _NOT_WRITTEN
    return 0


def _found(options: Options, folders: BoxFolders) -> Outcome:
    """The choice; a stick is read in a process that can be killed."""
    boot = options.boot or next((one for one in BOOTS if _is_folder(one)), BOOTS[-1])

    def chosen() -> Outcome:
        arrivals = [look("stick", options.stick), look("boot", boot)]
        check = late_candidate_problems if options.late else candidate_problems
        return adopt(folders, arrivals, check, options.late)

    try:
        if _is_folder(options.stick):
            seconds = LATE_STICK_S if options.late else STICK_S
            return Outcome.unpacked(run_with_timeout(seconds, lambda: chosen().packed()))
        return chosen()
    except TimedOutError as error:
        message = f"The stick could not be read ({error}). The show before goes on. Try another stick."
    except Exception as error:
        message = f"The new show cannot be checked ({error!r}). The show before goes on. Copy it again."
    outcome = adopt(folders, [], candidate_problems)
    return Outcome(outcome.choice._replace(refused=(message, *outcome.choice.refused)), False, (message,))


def _is_folder(path: Path) -> bool:
    """False also for a stick that is just being pulled or gives errors."""
    try:
        return path.is_dir()
    except OSError:
        return False


def publish(folders: BoxFolders, outcome: Outcome, late: bool, uptime_s: float, restarts: bool = True) -> str:
    """Write the choice where all processes look for it; when it dances, in a sentence or none.

    A show that has run for long is not interrupted.

    restarts: the units start anew with it; else the caller sees to that.
    """
    path = folders.run / CHOSEN
    before = Choice.read(path) if late else None
    if before is not None and (not outcome.taken or uptime_s >= _AT_ONCE_S):
        before._replace(refused=outcome.choice.refused).write(path)
        if outcome.taken:
            return "The running show goes on. The new one dances after the next power-on."
        return ""
    choice = outcome.choice.complete(built_in_box(folders))._replace(data=folders.data)
    aside = () if before is None else before.aside  # also what the stage put aside during the checks
    choice.without(Choice(aside=tuple(one for one in aside if one.id != choice.first.id))).write(path)
    if before is not None and restarts:
        (folders.run / ANEW).touch()
        return "The box was switched on only just now: the new show dances at once."
    return ""


def late_candidate_problems(show: Path, box: Path) -> list[str]:
    """As `candidate_problems`, while another show dances."""
    return candidate_problems(show, box, is_late=True)


def candidate_problems(show: Path, box: Path, is_late: bool = False) -> list[str]:
    """Why a show and a box file cannot be danced here; checked in a process that may crash or hang."""
    import subprocess

    seconds = LATE_CHECK_S if is_late else CHECK_S
    command = (sys.executable, "-m", "appliance.cli.candidate", str(show), str(box))
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False, timeout=seconds
        )
    except subprocess.TimeoutExpired:
        return [f"{show}: its check did not end within {seconds:g} s. Try it with: bunraku check."]
    except OSError as error:
        return [f"{show}: it cannot be checked ({error.strerror})."]
    if done.returncode == 0:
        return []
    lines = [line for line in done.stderr.splitlines() if line]
    if done.returncode < 0 or not lines:
        return [f"{show}: its check crashed (signal {-done.returncode}). Export the network again."]
    return lines[-40:]


def parsed(arguments: Sequence[str]) -> Options:
    """The command line; ends the process with status 2 where it is wrong."""
    if not arguments:
        return Options()
    import argparse

    description = (
        "Decide which show dances: a new one from the stick or the boot partition when it is sound, else the "
        "last good one, else the one that comes with the box."
    )
    parser = argparse.ArgumentParser(prog="bunraku preflight", description=description)
    parser.add_argument("--boot", type=Path, help="The boot partition's folder with `show` and `box.yaml`.")
    parser.add_argument("--stick", type=Path, default=STICK, help=f"The same on a stick; {STICK}.")
    parser.add_argument("--data", type=Path, default=DATA, help=f"What is kept over power-off; {DATA}.")
    parser.add_argument("--run", type=Path, default=RUN, help=f"Where all processes look; {RUN}.")
    parser.add_argument("--late", action="store_true", help="A stick was plugged into a box that is on.")
    help_text = "Instead: can this release dance on this machine?"
    parser.add_argument("--check-release", action="store_true", help=help_text)
    return Options(**vars(parser.parse_args(list(arguments))))


def main(arguments: Sequence[str] | None = None) -> int:
    """For `python -m appliance.cli.preflight`, which units run; the exit status."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parsed(given)
    if options.check_release:
        from appliance.cli.check_release import check_release

        return check_release(options.data)
    return preflight(options, time.clock_gettime(time.CLOCK_BOOTTIME))


def _say(message: str) -> None:
    """Standard output, and no `logging`: its import costs more than this line."""
    if message:
        with contextlib.suppress(OSError):
            print(message, flush=True)


if __name__ == "__main__":
    sys.exit(main())
