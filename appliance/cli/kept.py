"""`bunraku kept`: the motions that were kept on this box, and one of them as a file for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from appliance.cli.options import ThisBoxFile, ThisShowFolder
from appliance.dancer.material.material_file import SUFFIX, parsed_recipe, read_material
from appliance.dancer.phrase import FPS, X, Z
from appliance.generator.saved_motions import FOLDER
from appliance.options.idle_options import refuse_idle
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.config_error import did_you_mean


def kept(
    context: typer.Context,
    name: Annotated[str | None, typer.Argument(help="A kept motion; left out: all are listed.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write it there: .bvh, .glb, .npz or .csv. Default: NAME.bvh.")
    ] = None,
    show: ThisShowFolder = None,
    box: ThisBoxFile = None,
) -> None:
    """List the motions that `/motion/keep` kept on this box, or write one as a recording.

    The motion stays where it is, and `/phrase NAME` calls it as before. The file is a phrase like any other:
    a show may list it under `phrases`, and `bunraku retarget`, `vary` and `filmstrip` take it.
    """
    from appliance.exchange.exchange_error import ExchangeError
    from appliance.exchange.formats import known_ending, write_recording
    from appliance.release.installed_box import show_and_box_here
    from appliance.show.box import load_box
    from appliance.show.bundle import default_show_path
    from appliance.show.show import load_show

    if name is None:
        refuse_idle(context, ("out",), "without the NAME of a motion")
    show, box = show_and_box_here(show, box)
    skeleton, state = load_show(show or default_show_path()).skeleton, load_box(box).state_folder
    if state is None:
        print(
            "The box file names no state folder (`state:`): motions are kept until the box is switched off."
        )
        raise typer.Exit(0 if name is None else 2)
    folder = state / FOLDER
    names = [file.name.removesuffix(SUFFIX) for file in sorted(folder.glob(f"*{SUFFIX}"))]
    if name is None:
        for one in names:
            print(_line(folder / f"{one}{SUFFIX}", one, skeleton))
        if not names:
            print(f"{folder}: no motion is kept. /motion/keep NAME keeps the one that is danced.")
        return
    if name not in names:
        cure = did_you_mean(name, names) if names else "Nothing was kept yet: /motion/keep NAME does."
        raise ExchangeError(folder, f"No motion '{name}' is kept here. {cure}")
    out = out or Path(f"{name}.bvh")
    known_ending(out)
    try:
        recording = _recording(folder / f"{name}{SUFFIX}", skeleton)
    except ValueError as error:
        raise ExchangeError(out, f"Nothing was written. {error} Name its show: --show FOLDER.") from None
    write_recording(out, recording)
    print(f"{out}: {recording.seconds:.1f} s of '{name}'. /phrase {name} calls it as before.")


def _recording(file: Path, skeleton: Skeleton) -> Recording:
    """One round of a kept motion. Raises OSError, and ValueError for another figure's."""
    loop = read_material(file, skeleton.names).loop
    poses, track = (part[: loop.length].astype(float) for part in (loop.poses, loop.track))
    return Recording(skeleton, poses, track[:, X : Z + 1], FPS)


def _line(file: Path, name: str, skeleton: Skeleton) -> str:
    try:
        material = read_material(file, skeleton.names)
        recipe = parsed_recipe(material.recipe)
    except (OSError, ValueError) as error:
        return f"{name}: cannot be called ({error})"
    recipe = recipe.get("of", recipe)
    reported = ", ".join(
        f"{key} {value}" for key, value in recipe.items() if key not in _NOT_TOLD and value is not None
    )
    return f"{name}: {material.loop.length / FPS:.1f} s of {recipe['source']} ({reported})"


_NOT_TOLD = ("source", "number", "after", "from_s", "prompt")
