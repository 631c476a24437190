"""`bunraku project`: show what the stage dances, until somebody ends it; the exit status for a supervisor."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import typer

from appliance.control.lifeline import was_told
from appliance.control.speaker import Speaker
from appliance.control.stop_signals import stop_signals
from appliance.projector.projector_error import ProjectorError
from appliance.projector.run import Run, Wish
from appliance.projector.window import Kind, Size
from appliance.show.box import load_box

_LARGEST = 16384


def wish(
    window: bool,
    fullscreen: bool,
    offscreen: str | None,
    frames: Path | None,
    seconds: float | None,
    info: bool,
) -> Wish:
    """The command line's options as one wish; raises typer.BadParameter where they contradict each other."""
    if window + fullscreen + (offscreen is not None) > 1:
        raise typer.BadParameter("Give one of --window, --fullscreen and --offscreen.")
    kind: Kind | None = "window" if window else "fullscreen" if fullscreen else None
    if offscreen is None:
        return Wish(kind, None, frames, seconds, info)
    return Wish("offscreen", _size(offscreen), frames, seconds, info)


def project_show(box_file: Path | None, wish: Wish) -> int:
    """0: ended as asked; 69: no display or no OpenGL; 73: no room for --frames; 75: reset or hung."""
    with stop_signals() as stopped, closing(Speaker()) as speaker:
        try:
            with closing(Run(load_box(box_file), box_file, wish, speaker.say)) as run:
                for line in run.introduction():
                    speaker.say(line)
                speaker.say(f"Shown: {run.project(stopped).sentence()}.")
        except ProjectorError as error:
            if not was_told(error.status):
                print(f"bunraku: {error}", file=sys.stderr)
            return error.status
    return 0


def _size(text: str) -> Size:
    width, times, height = text.partition("x")
    if not (times and width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"'{text}' is no size. Write it like 1280x720.")
    if not all(1 <= int(part) <= _LARGEST for part in (width, height)):
        raise typer.BadParameter(f"Width and height are from 1 to {_LARGEST} pixels.")
    return int(width), int(height)
