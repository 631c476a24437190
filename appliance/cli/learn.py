"""`bunraku learn`: from recordings to a show that was checked, unattended; the page begins it too.

It trains, pauses while a show dances, continues after a power cut, checks, and compares with a bar. The show
that dances is never touched: what was learned is only offered.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from appliance.box.child import BUNRAKU, end_child, start_child
from appliance.box.log import process_log
from appliance.box.parent_death import end_with_parent
from appliance.box.realtime import give_way
from appliance.box.runtime_folder import RuntimeFolderError, runtime_folder
from appliance.box.stop_signals import stop_signals
from appliance.cli.learned import figures_of, sentence_of
from appliance.cli.options import BoxFile
from appliance.console.learning import (
    FOLDER,
    LONGEST_MIN,
    SHORTEST_MIN,
    STUDIO_MISSING,
    USUAL_MIN,
    Learning,
    Wanted,
    has_studio,
)
from appliance.console.show_goes import show_goes
from appliance.pose.foreign_file import stored_json
from appliance.release.choice import box_of, files_named
from appliance.show.box import BoxConfig, load_box
from appliance.show.config_error import ConfigError
from appliance.stage.stage_error import StageError

_log = logging.getLogger("appliance.cli.learn")  # `python -m` calls it otherwise

NICE = 19
# Reading, export, measuring the answer and the check: they took 5 minutes on two cores that others used.
REST_SHARE, MOST_REST_MIN = 0.25, 7.5
_LOOK_S = 0.5
_ENDS_WITHIN_S = 120.0  # a step and a checkpoint, while something else has the processor
_INTERRUPTED = 130  # exit status of bunraku train when it was stopped and can go on
_STOPPED = "Stopped. Nothing is lost: the same command continues."


class NotLearnedError(Exception):
    """Learning cannot go on; the message is for the user."""


def learn(
    recordings: Annotated[Path, typer.Option(help="Folder with the dancer's recordings.")],
    out: Annotated[Path, typer.Option(help="Folder for the learning; the show will be in OUT/show.")],
    minutes: Annotated[
        float, typer.Option(min=SHORTEST_MIN, max=LONGEST_MIN, help="For all of it, to the check.")
    ] = USUAL_MIN,
    box: BoxFile = None,
    nice: Annotated[int, typer.Option(min=0, max=19, help="How far it gives way to others.")] = NICE,
    train: Annotated[
        list[str] | None, typer.Argument(help="After --: further options of bunraku train.")
    ] = None,
) -> int:
    """Make a checked show from recordings, unattended: learn tonight, dance tomorrow."""
    give_way(nice)
    learning = Learning(out)
    wanted = Wanted(str(recordings.resolve()), minutes)
    if learning.wanted() not in (None, wanted):
        raise StageError(f"{out}: other recordings are being learned there. Give another --out.")
    if learning.wanted() is None:
        learning.begin(wanted)
    with contextlib.suppress(RuntimeFolderError):
        goes = partial(show_goes, runtime_folder(load_box(box)))
        with process_log():
            return Learner(learning, goes, box, train or ()).run()
    with process_log():
        return Learner(learning, lambda: False, box, train or ()).run()


def main(given: Sequence[str]) -> int:
    """Learn what the page of a box wants; the arguments name the box: `--box FILE` or `--chosen FILE`."""
    from appliance.cli.console import devices_file_made

    end_with_parent()
    give_way(NICE)
    found = _readable_box(*files_named(given))
    if found is None:
        return 0
    path, config = found
    learning = Learning(devices_file_made(config).parent / FOLDER)
    if learning.wanted() is None:
        learning.end()  # a request that cannot be read: else systemd would begin it again and again
        return 0
    try:
        with process_log():
            return Learner(learning, partial(show_goes, runtime_folder(config)), path).run()
    except Exception as error:
        from appliance.cli.app import refuse

        learning.end()  # as above
        learning.report(state="failed", message=str(error))
        refuse(error)


def _readable_box(box: Path | None, chosen: Path | None) -> tuple[Path | None, BoxConfig] | None:
    """The box file, once it can be read: a learner that ended here would be started again at once, for ever.

    None: stopped before.
    """
    said = ""
    with stop_signals() as is_stopped:
        while not is_stopped():
            try:
                path = box_of(box, chosen)
                return path, load_box(path)
            except ConfigError as error:
                if str(error) != said:
                    said = str(error)
                    _print(f"Learning waits: the box file cannot be read.\n{said}")
            time.sleep(_LOOK_S)
    return None


class Learner:
    """Works on what is wanted. show_goes: whether a dance is on, during which nothing is trained.

    box: what the show is checked on; train: further options of `bunraku train`.
    """

    def __init__(
        self,
        learning: Learning,
        show_goes: Callable[[], bool],
        box: Path | None = None,
        train: Sequence[str] = (),
    ) -> None:
        self._learning, self._show_goes, self._box = learning, show_goes, box
        self._train = tuple(train)
        self._is_stopped: Callable[[], bool] = lambda: False
        self._state: dict[str, Any] = {}

    def run(self) -> int:
        """Exit status 0: a show is offered; 1: none is, with the reason printed; 2: stopped, may continue."""
        with stop_signals() as self._is_stopped:
            try:
                require_studio()
                self._learning.move_aside()
                while not self._trained():
                    self._await_rest()
                result = self._checked()
            except _StoppedError:
                if self._learning.wanted() is None:
                    self._report(state="ended")
                _log.info(_STOPPED)
                return 2
            except (NotLearnedError, OSError) as error:
                self._learning.end()
                self._report(state="failed", message=str(error))
                _log.error(f"{error} The show that danced before stays.")
                return 1
            self._learning.end()
            self._report(state="learned" if result["passed"] else "worse", **result)
        self._say_result(result)
        return 0 if result["passed"] else 1

    def _trained(self) -> bool:
        """Whether the training reached its end; False: it was stopped for a show."""
        wanted = self._learning.wanted()
        if wanted is None:
            raise _StoppedError
        self._await_rest()
        out = self._learning.show
        command = ["train", "--out", str(out), "--threads", str(max(1, (os.cpu_count() or 1) - 1))]
        if (out / "checkpoint.pt").exists():
            command += ["--resume"]
        else:
            shutil.rmtree(out, ignore_errors=True)
            command += ["--recordings", wanted.recordings, *self._train]
            if wanted.begins_with:
                command += ["--from", wanted.begins_with]
            if not {"--steps", "--minutes"} & set(self._train):
                rest = min(REST_SHARE * wanted.minutes, MOST_REST_MIN)
                command += ["--minutes", f"{wanted.minutes - rest:g}"]
        status, said = self._run(command, "training", pauses=True)
        if status not in (0, _INTERRUPTED):
            raise NotLearnedError(f"The training ended early: {_last(said)}")
        return status == 0

    def _checked(self) -> dict[str, Any]:
        """The figures beside their bar, and whether the show can be offered."""
        named = () if self._box is None else ("--box", str(self._box))
        status, said = self._run(["check", str(self._learning.show), *named], "checking", pauses=False)
        if status:
            raise NotLearnedError(f"The show that was learned does not pass its check: {_last(said)}")
        try:
            report = stored_json(self._learning.show / "report.json")
            figures = figures_of(report)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise NotLearnedError(f"The training wrote no figures ({error}).") from None
        passed = all(one["holds"] for one in figures)
        verdict = str(report["puppetry"].get("verdict") or report["puppetry"].get("not_measured", ""))
        advice = "" if passed else str(report["puppetry"].get("advice", ""))
        return {
            "passed": passed,
            "message": sentence_of(figures),
            "verdict": verdict,
            "advice": advice,
            "figures": figures,
            "check": said.strip().splitlines()[-4:],
        }

    def _run(self, command: Sequence[str], state: str, pauses: bool) -> tuple[int, str]:
        """Exit status and output of one of our commands. pauses: it is stopped while a show dances.

        Raises _StoppedError where it is no longer wanted.
        """
        was_ended = False
        with tempfile.TemporaryFile() as out:
            child = start_child((*BUNRAKU, *command), stdout=out, stderr=subprocess.STDOUT)
            try:
                while child.poll() is None:
                    if self._is_over() or (pauses and self._show_goes()):
                        end_child(child, _ENDS_WITHIN_S)
                        was_ended = child.returncode != 0
                        break
                    self._report(state=state, **self._share())
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        child.wait(_LOOK_S)
            finally:
                if child.poll() is None:
                    end_child(child, _ENDS_WITHIN_S)
            if self._is_over():
                raise _StoppedError
            out.seek(0)
            # While it reads or exports, the signal ends it at once: it continues as after a step.
            status = _INTERRUPTED if was_ended else int(child.returncode)
            return status, out.read().decode(errors="replace")

    def _await_rest(self) -> None:
        while self._show_goes():
            if self._is_over():
                raise _StoppedError
            self._report(state="waits", **self._share())
            time.sleep(_LOOK_S)

    def _is_over(self) -> bool:
        return self._is_stopped() or self._learning.wanted() is None

    def _share(self) -> dict[str, Any]:
        """How far the training is, as its history tells."""
        try:
            newest = stored_json(self._learning.show / "training.json")["history"][-1]
            return {"share": newest["fraction"], "degrees": newest["held_out_degrees"]}
        except (OSError, ValueError, KeyError, TypeError, IndexError):
            return {"share": 0.0, "degrees": None}

    def _report(self, **state: Any) -> None:
        """Write what changed."""
        if state == self._state:
            return
        with contextlib.suppress(OSError):
            self._learning.report(**state)
            if state["state"] != self._state.get("state") and "share" in state:
                _log.info(f"{_STATES[state['state']]} ({100 * state['share']:.0f} % trained)")
            self._state = state

    def _say_result(self, result: dict[str, Any]) -> None:
        for one in result["figures"]:
            sign = "✓" if one["holds"] else "✗"
            _log.info(
                f"{sign} {one['name']}: {one['value']} ({one['bound']}); the default show's dancer "
                f"{one['default']}; {one['null_name']} {one['null']}"
            )
        _log.info(f"{result['verdict']} {result['message']} {result['advice']}".strip())
        if result["passed"]:
            _log.info(f"Dance it: bunraku play --show {self._learning.show}")


_STATES = {
    "training": "Training.",
    "checking": "Checking.",
    "waits": "A show dances: learning waits until it stops.",
}


class _StoppedError(Exception):
    """Asked to stop."""


def require_studio() -> None:
    """Raises NotLearnedError where the studio or PyTorch is not installed."""
    if not has_studio():
        raise NotLearnedError(STUDIO_MISSING)


def _last(said: str) -> str:
    """The last sentence of a command's output."""
    lines = [line for line in said.splitlines() if line.strip()]
    start = next((n for n in range(len(lines) - 1, -1, -1) if lines[n].startswith("bunraku: ")), -1)
    return " ".join(lines[start:]).removeprefix("bunraku: ")[-600:]


def _print(message: str) -> None:
    print(message, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
