"""`bunraku inspect`: what kind of file a recording is. Its app joins the studio's commands."""

from __future__ import annotations

import json as json_text
from pathlib import Path
from typing import Annotated

import typer

from appliance.options.reading import reading_options
from appliance.pose.reading_options import ReadingOptions
from appliance.studio.clear_errors import clear_errors

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


@app.command()
@reading_options
def inspect(
    recordings: Annotated[list[Path], typer.Argument(help="BVH recordings, or folders of them.")],
    json: Annotated[bool, typer.Option("--json", help="Print the facts as JSON.")] = False,
    strip: Annotated[
        Path | None, typer.Option(help="PNG of the worst masked stretches, the joints in colour.")
    ] = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Say what kind of file a recording is: joints, lengths, axes, rate, rest pose, capture errors.

    Each guess is named with the option that overrules it. All commands that read recordings take these
    options, and a show keeps those that it was trained with.
    """
    with clear_errors("inspect"):
        from appliance.studio.data.catalogue import find_catalogue, left_out_of, recordings_in
        from appliance.studio.data.takes import load_take
        from appliance.studio.evaluation.masked import draw_masked
        from appliance.studio.inspection import inspect as look_at
        from appliance.studio.studio_error import StudioError

        files = [
            file for given in recordings for file in (recordings_in(given) if given.is_dir() else [given])
        ]
        for folder in filter(Path.is_dir, recordings):
            if others := left_out_of(folder):
                typer.echo(f"Only BVH files are read, left out of {folder}: {others}.", err=True)
        if not files:
            raise StudioError(f"{recordings[0]} has no .bvh files. Give BVH recordings, or a folder of them.")
        found = [
            look_at(load_take(file, find_catalogue(file.parent, [file]).with_options(reading)))
            for file in files
        ]
        if json:
            print(json_text.dumps([one.as_json() for one in found], indent=1))
        else:
            for number, one in enumerate(found):
                same = number and one.take.recording.skeleton.same_joints(
                    found[number - 1].take.recording.skeleton
                )
                print("\n".join(one.lines(joints=not same)))
        if strip is not None:
            shown = [one.take for one in found if one.take.errors]
            if not shown:
                typer.echo("No frame is masked: there is no strip to draw.", err=True)
            for take in shown[:1]:
                same_joints = [
                    one for one in shown if one.recording.skeleton.same_joints(take.recording.skeleton)
                ]
                draw_masked(strip, same_joints)
                typer.echo(f"{strip} shows the worst masked stretches.", err=True)
