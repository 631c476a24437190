"""`bunraku project`: shows what the stage dances until it is stopped; its exit status is for a supervisor."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from appliance.box.log import process_log
from appliance.box.notify import Notifier
from appliance.box.parent_death import was_reported
from appliance.box.stop_signals import stop_signals
from appliance.cli.options import BoxFile, ChosenFile
from appliance.options.idle_options import refuse_idle
from appliance.projector.projector_error import NO_DISPLAY, ProjectorError
from appliance.projector.raw_stream import take_over_stdout
from appliance.projector.run import Options, Run
from appliance.projector.window import Kind, Size
from appliance.release.choice import Choice, box_of
from appliance.show.box import load_box

_log = logging.getLogger(__name__)

_LARGEST = 16384
_RETRY_S = 10.0  # without a display: a projector is switched on late
_LOOK_S = 0.25


def project(
    context: typer.Context,
    box: BoxFile = None,
    window: Annotated[bool, typer.Option("--window", help="In a window, for a rehearsal.")] = False,
    fullscreen: Annotated[bool, typer.Option("--fullscreen", help="On the whole display.")] = False,
    offscreen: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="On no display, in this size.")
    ] = None,
    frames: Annotated[Path | None, typer.Option(help="Write each picture as a PNG into this folder.")] = None,
    raw: Annotated[
        bool, typer.Option("--raw", help="With --offscreen: raw pictures to standard output, for a pipe.")
    ] = False,
    key: Annotated[
        bool, typer.Option("--key", help="Alpha in --raw and --frames: as much as each pixel shines.")
    ] = False,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after this time.")] = None,
    info: Annotated[bool, typer.Option("--info", help="Figures on the wall and on the terminal.")] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Without a display, wait for one; look every 10 s.")
    ] = False,
    stamp: Annotated[
        bool, typer.Option("--stamp", hidden=True, help="Time stamps in a corner, for `measure --light`.")
    ] = False,
    chosen: ChosenFile = None,
) -> int:
    """Show what the stage dances, on a projector: before it starts, while it dances and when it is back."""
    options = parse_options(window, fullscreen, offscreen, frames, seconds, info)
    if not raw and frames is None:
        refuse_idle(context, ("key",), "without --raw or --frames")
    if raw and (offscreen is None or sys.stdout.isatty()):
        raise typer.BadParameter(
            "--raw needs --offscreen WIDTHxHEIGHT and a pipe: its pictures are no text. "
            "For instance: bunraku project --offscreen 1280x720 --raw | ffmpeg ..."
        )
    pictures = take_over_stdout() if raw else None
    choice = None if chosen is None else Choice.read(chosen)
    is_first = choice is not None and not choice.first.show_id
    more = replace(options, stamps=stamp, raw=pictures, is_keyed=key, is_first=is_first)
    return project_show(box_of(box, chosen), more, wait)


def parse_options(
    window: bool,
    fullscreen: bool,
    offscreen: str | None,
    frames: Path | None,
    seconds: float | None,
    info: bool,
) -> Options:
    """The command line's options as one value; raises typer.BadParameter where they contradict each other."""
    if window + fullscreen + (offscreen is not None) > 1:
        raise typer.BadParameter("Give one of --window, --fullscreen and --offscreen.")
    kind: Kind | None = "window" if window else "fullscreen" if fullscreen else None
    if offscreen is None:
        return Options(kind, None, frames, seconds, info)
    return Options("offscreen", _size(offscreen), frames, seconds, info)


def project_show(box_file: Path | None, options: Options, waits: bool = False) -> int:
    """0: ended as asked; 69: no display or no OpenGL; 73: no room for --frames; 75: reset or hung.

    waits: without a display, try again every 10 s in this process.
    """
    with stop_signals() as stopped, process_log(), closing(Notifier()) as notifier:
        said = ""
        while not stopped():
            try:
                _project(box_file, options, stopped, notifier)
                break
            except ProjectorError as error:
                if not (waits and error.status == NO_DISPLAY):
                    if not was_reported(error.status):
                        print(f"bunraku: {error}", file=sys.stderr)
                    return error.status
                if str(error) != said:
                    said = str(error)
                    _log.warning(f"{said} Trying again every {_RETRY_S:g} s.")
            notifier.ready("No display yet; trying again.")
            _wait(stopped, notifier)
    return 0


def _project(
    box_file: Path | None,
    options: Options,
    stopped: Callable[[], bool],
    notifier: Notifier,
) -> None:
    from appliance.cli.console import card_lines

    box = load_box(box_file)
    with closing(Run(box, replace(options, card=lambda: card_lines(box)))) as run:
        for line in run.introduction():
            _log.info(line)
        _log.info(f"Shown: {run.project(stopped, notifier).sentence()}.")


def _wait(stopped: Callable[[], bool], notifier: Notifier) -> None:
    """Wait until it is time to look for a display again."""
    again = time.monotonic() + _RETRY_S
    while not stopped() and (now := time.monotonic()) < again:
        notifier.ping(now)
        time.sleep(_LOOK_S)


def _size(text: str) -> Size:
    width, times, height = text.partition("x")
    if not (times and width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"'{text}' is no size. Write it like 1280x720.")
    if not all(1 <= int(part) <= _LARGEST for part in (width, height)):
        raise typer.BadParameter(f"Width and height are from 1 to {_LARGEST} pixels.")
    return int(width), int(height)
