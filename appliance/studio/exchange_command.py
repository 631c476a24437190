"""`bunraku convert`, `retarget` and `import`: recordings for other programs and skeletons, and from them."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from appliance.options.idle_options import refuse_idle
from appliance.options.reading import reading_options
from appliance.pose.file_trouble import sentence
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.pose.stage_frame import Guess
from appliance.show.bundle import named_show

app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False)


class Unit(StrEnum):
    """Unit of the points in a file."""

    m = "m"
    cm = "cm"
    mm = "mm"


Animation = Annotated[
    str | None,
    typer.Option(help="Which animation of a .glb, by name or number from 0. Default: the longest."),
]
Skin = Annotated[
    str | None,
    typer.Option(help="Which skin of a .glb, by name or number from 0. Default: all of one figure."),
]


class Up(StrEnum):
    """The vertical axis."""

    y = "y"
    z = "z"


@app.command()
@reading_options
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="A recording: .bvh, .glb, .npz or .csv.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The file; its ending says the format.")],
    fps: Annotated[float | None, typer.Option(min=1.0, max=1000.0, help="Another rate.")] = None,
    animation: Animation = None,
    skin: Skin = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Turn a recording into another format: .bvh, .glb (Blender, three.js, TouchDesigner), .npz, .csv.

    The dance stays the same: the same joints, the same rotations, metres (BVH: centimetres); files in other
    units, with Z up or with the dancer's back to the audience come out in metres, Y up and to the front, and
    a message says so. A .glb has a body around the skeleton, so that it can be looked at as it is.
    """
    from appliance.exchange.formats import known_ending
    from appliance.studio.exchange.glb_reading import Choice
    from appliance.studio.exchange.reading import read_as_given

    known_ending(out)
    recording = _reported(source, *read_as_given(source, reading, Choice(skin, animation)))
    if fps is not None:
        recording = recording.resampled(fps)
    _write(out, recording)
    joints, rate = len(recording.skeleton), recording.fps
    print(f"{out}: {recording.seconds:.1f} s, {len(recording)} poses at {rate:g} a second, {joints} joints.")


@app.command()
@reading_options
def retarget(
    phrase: Annotated[Path, typer.Argument(help="A recording: .bvh, .glb, .npz or .csv.")],
    to: Annotated[
        Path,
        typer.Option(callback=named_show, help="The other skeleton: a recording of it, or a show folder."),
    ],
    out: Annotated[Path, typer.Option(help="The file; its ending says the format.")],
    animation: Animation = None,
    skin: Skin = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Put a dance on another skeleton: a phrase of one dancer for the show of another.

    Joints are matched by what they are (bunraku inspect lists it), turns count from the same T-pose, the way
    over the floor follows the legs' length, and the soles are on the floor.
    """
    from appliance.exchange.exchange_error import ExchangeError
    from appliance.exchange.formats import known_ending
    from appliance.studio.exchange.glb_reading import Choice
    from appliance.studio.exchange.reading import read_as_given
    from appliance.studio.exchange.retargeting import retarget as put_on

    known_ending(out)
    dance = _reported(phrase, *read_as_given(phrase, reading, Choice(skin, animation)))
    other = _skeleton_of(to, reading)
    try:
        found = put_on(dance, other)
    except ValueError as error:
        raise ExchangeError(
            out, f"{error} Nothing was written. Rename joints; see bunraku inspect."
        ) from error
    _write(out, found)
    print(
        f"{out}: {found.seconds:.1f} s of {phrase.name} with the {len(found.skeleton)} joints of {to.name}."
    )


def _skeleton_of(like: Path | None, reading: ReadingOptions = AS_THE_FILES_SAY) -> Skeleton:
    """The skeleton of a recording or a show; None: of the show that comes with the box."""
    from appliance.pose.body_facts import with_stance
    from appliance.pose.bvh import read_bvh
    from appliance.show.bundle import default_show_path
    from appliance.studio.exchange.reading import read_as_given

    folder = like or default_show_path()
    if folder.is_dir():  # a show's skeleton is in the stage's frame already
        return with_stance(read_bvh(folder / "skeleton.bvh"))
    return _reported(folder, *read_as_given(folder, reading)).skeleton


def _write(out: Path, recording: Recording) -> None:
    """Write it; joints' names that a file cannot carry are said."""
    from appliance.exchange.formats import write_recording

    if changed := write_recording(out, recording):
        print(f"{out.name}: joints' names changed, as no file can carry them: {changed}.", file=sys.stderr)


def _reported(file: Path, recording: Recording, guesses: list[Guess]) -> Recording:
    """The recording; what was changed in it is said."""
    for guess in guesses:
        print(f"{file.name}: {guess.sentence()}.", file=sys.stderr)
    return recording


@app.command("import")
def import_(
    context: typer.Context,
    points: Annotated[
        Path,
        typer.Argument(help="Points: .npy, .csv. A video's landmarks: .json, .npz, OpenPose's folder."),
    ],
    out: Annotated[Path, typer.Option(help="The recording: .bvh, .glb, .npz or .csv.")],
    names: Annotated[
        Path | None, typer.Option(help="Text file: a name on each line, or a name, a comma, its parent.")
    ] = None,
    like: Annotated[
        Path | None,
        typer.Option(
            callback=named_show,
            help="Recording whose skeleton the points belong to, by their names; for landmarks a show too.",
        ),
    ] = None,
    landmarks: Annotated[
        bool, typer.Option("--landmarks", help="This .npy or .csv has MediaPipe's 33 landmarks.")
    ] = False,
    fps: Annotated[
        float | None,
        typer.Option(min=1.0, max=1000.0, help="Frames a second. Default: by a column of times, else 50."),
    ] = None,
    unit: Annotated[
        Unit | None, typer.Option(help="Unit of the points. Default: guessed from the size.")
    ] = None,
    up: Annotated[Up, typer.Option(help="The axis that points upwards.")] = Up.y,
    gap: Annotated[
        float, typer.Option(min=0.0, help="Seconds without a point that are crossed in a straight line.")
    ] = 0.5,
    picture: Annotated[
        Path | None, typer.Option(help="PNG of poses from the dance. Default: beside --out.")
    ] = None,
) -> None:
    """Turn positions of points or joints into a recording: a skeleton is fitted to them and follows them.

    A bone is as long as the usual distance between its points. The hierarchy comes from the names (LeftArm,
    l_wrist, RightKnee ...), from parents in --names, or from --like. A missing point is NaN, an empty field,
    or 0, 0, 0 for a while. At the end it says how far the figure is from the points, in centimetres.

    Landmarks that a network found in a video are repaired, and danced by the skeleton of --like. Without it
    that is the skeleton of the show that comes with the box.
    """
    from appliance.exchange.formats import known_ending
    from appliance.pictures.filmstrip import MissingPicturesError, draw_filmstrip
    from appliance.studio.exchange.importing import PointsOptions, import_points
    from appliance.studio.exchange.landmarks_file import is_landmarks, read_landmarks
    from appliance.studio.progress import logged

    known_ending(out)
    if landmarks or is_landmarks(points):
        from appliance.studio.exchange.landmarks_dance import dance_of

        refuse_idle(context, ("names", "unit", "up"), "with landmarks, whose names and axes are known")
        found = dance_of(points, read_landmarks(points, fps), _skeleton_of(like), gap)
        dance, lines = found.recording, [f"{points.name}: {line}." for line in found.lines]
    else:
        options = PointsOptions(names, like, fps, unit.value if unit else None, up.value, gap)
        from rich.console import Console

        with logged(Console()):
            imported = import_points(points, options)
        dance, lines = imported.recording, imported.report()
    _write(out, dance)
    for line in lines:
        print(line)
    print(f"{out}: {dance.seconds:.1f} s, {len(dance.skeleton)} joints.")
    picture = picture or out.with_suffix(".png")
    try:
        print(draw_filmstrip(picture, dance.skeleton, dance.poses, dance.roots, dance.fps, title=out.stem))
    except (MissingPicturesError, OSError) as error:  # the recording is written: only its picture is missing
        message = sentence(error, picture) if isinstance(error, OSError) else None
        print(f"There is no picture: {message or error}", file=sys.stderr)
