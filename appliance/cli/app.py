"""The command `bunraku`: the box's own commands; simulation and studio plug theirs in."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import EntryPoint, entry_points
from importlib.metadata import version as distribution_version
from pathlib import Path
from typing import Annotated, NoReturn

from appliance.box.notify import Notifier
from appliance.box.parent_death import end_with_parent
from appliance.box.realtime import prepare_environment

prepare_environment()

import typer  # noqa: E402  (numpy, which commands import, must find the environment prepared)

from appliance.cli import journal as journal_commands  # noqa: E402
from appliance.cli import lights_commands, sensor_commands  # noqa: E402
from appliance.cli.chosen import ChosenFile, box_of, pair_of  # noqa: E402
from appliance.release import choice  # noqa: E402

PLUG_INS = "bunraku.commands"
REFUSED = 2

app = typer.Typer(
    name="bunraku",
    help="The box that lets a dancer puppeteer an AI dancer on stage.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

ShowFolder = Annotated[
    Path | None, typer.Option(help="Show bundle; left out: the show that comes with the box.")
]
BoxFile = Annotated[
    Path | None, typer.Option(help="box.yaml of the venue; left out: everything on this machine.")
]


@app.command()
def play(
    show: ShowFolder = None,
    box: BoxFile = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Stop after so long; left out: never.")
    ] = None,
    emulate: Annotated[
        bool, typer.Option("--emulate", help="Start emulated sensors, over real sockets.")
    ] = False,
    journal: Annotated[
        Path | None, typer.Option(help="Folder for the flight recorder; left out: the box file's.")
    ] = None,
    filmstrip: Annotated[
        Path | None, typer.Option(help="At the end draw what was danced into this PNG.")
    ] = None,
    alone: Annotated[
        bool,
        typer.Option(
            "--alone", help="Start no companions (show control, lights, keeper): they run by themselves."
        ),
    ] = False,
    window: Annotated[bool, typer.Option("--window", help="Show the projection in a window.")] = False,
    rehearse: Annotated[
        Path | None,
        typer.Option(
            help="A window where there is a display; at the end render what was danced into this PNG."
        ),
    ] = None,
    chosen: ChosenFile = None,
) -> None:
    """Dance: sensors in, joints out, 50 times a second, until Ctrl-C."""
    from appliance.cli.play import play_show

    show, box = pair_of(show, box, chosen)
    raise typer.Exit(
        play_show(show, box, seconds, emulate, journal, filmstrip, alone, window, rehearse, bool(chosen))
    )


@app.command()
def control(
    box: BoxFile = None,
    socket_fd: Annotated[
        int | None, typer.Option(min=3, help="The control port's socket, where it was opened already.")
    ] = None,
    chosen: ChosenFile = None,
) -> None:
    """Take commands by OSC (go, stop, panic, cues ...), also while the stage hangs or is not there."""
    from appliance.cli.control import control_box

    control_box(box_of(box, chosen), socket_fd)


@app.command()
def keep(
    box: BoxFile = None,
    journal: Annotated[Path | None, typer.Option(help="Another folder than the box file's.")] = None,
    minutes: Annotated[float | None, typer.Option(min=0.1, help="How much of it is kept.")] = None,
    chosen: ChosenFile = None,
) -> None:
    """Carry the journal and the place of the dance from memory to the disk, which may be slow or broken."""
    from appliance.cli.keep import keep_box

    raise typer.Exit(keep_box(box_of(box, chosen), journal, minutes, chosen))


@app.command()
def replay(
    journal: Annotated[
        Path, typer.Argument(help="Folder of a journal, a segment in it, or an exported file.")
    ],
    show: Annotated[Path | None, typer.Option(help="Show bundle; left out: where it was then.")] = None,
    from_s: Annotated[float, typer.Option("--from", min=0.0, help="Second of a run to begin at.")] = 0.0,
    tolerance: Annotated[
        float | None,
        typer.Option(min=0.0, help="Degrees that a joint may be off; 0: every bit must be the same."),
    ] = None,
) -> None:
    """Dance a journal again through the same tick, and say which is the first that differs."""
    from appliance.cli.replay import replay_journal

    raise typer.Exit(replay_journal(journal, show, from_s, tolerance))


@app.command()
def check(
    show: Annotated[
        Path | None, typer.Argument(help="Show bundle; left out: the show that comes with the box.")
    ] = None,
    box: BoxFile = None,
) -> None:
    """Verify a show bundle and a box file, and measure whether the iterations fit this machine."""
    from appliance.cli.check import check_show

    check_show(show, box)


@app.command()
def doctor(
    box: BoxFile = None,
    chosen: ChosenFile = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
) -> None:
    """Look at machine, venue and running box, and say what to do; status 1 when something is wrong."""
    from appliance.cli.doctor.doctor_command import doctor as look_at

    raise typer.Exit(look_at(box, chosen, as_json))


@app.command()
def pack(show: Annotated[Path, typer.Argument(help="The show bundle that you changed.")]) -> None:
    """Verify a changed show bundle and vouch for its files with new checksums."""
    from appliance.cli.check import pack_show

    pack_show(show)


app.command()(sensor_commands.provision)
app.add_typer(sensor_commands.sensors, name="sensors")
app.add_typer(lights_commands.lights, name="lights")
app.add_typer(journal_commands.journal, name="journal")


@app.command()
def project(
    box: BoxFile = None,
    window: Annotated[bool, typer.Option("--window", help="In a window, for a rehearsal.")] = False,
    fullscreen: Annotated[bool, typer.Option("--fullscreen", help="On the whole display.")] = False,
    offscreen: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="On no display, in this size.")
    ] = None,
    frames: Annotated[Path | None, typer.Option(help="Write each picture as a PNG into this folder.")] = None,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after so long.")] = None,
    info: Annotated[bool, typer.Option("--info", help="Figures on the wall and on the terminal.")] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Without a display wait for one, and look each 10 s.")
    ] = False,
    chosen: ChosenFile = None,
) -> None:
    """Show what the stage dances, on a projector: before it starts, while it dances and when it is back."""
    from appliance.cli.project import project_show, wish

    wished = wish(window, fullscreen, offscreen, frames, seconds, info)
    raise typer.Exit(project_show(box_of(box, chosen), wished, wait))


@app.command()
def filmstrip(
    recording: Annotated[Path, typer.Argument(help="A BVH recording, or the journal of a run.")],
    out: Annotated[Path | None, typer.Option(help="The PNG; left out: beside the recording.")] = None,
    start: Annotated[
        float, typer.Option(help="Second at which the pictures begin; negative: counted from the end.")
    ] = 0.0,
    seconds: Annotated[float, typer.Option(min=0.1, help="How many seconds they cover.")] = 10.0,
    metres_per_unit: Annotated[float, typer.Option(min=1e-6, help="Unit of a BVH file, in metres.")] = 0.01,
    look: Annotated[
        str | None, typer.Option(help="Render in this look, as the projector shows it: plaster, lines ...")
    ] = None,
    show: Annotated[Path | None, typer.Option(help="Show bundle whose look it is.")] = None,
) -> None:
    """Draw a recording or a journal as a row of poses; held joints are highlighted."""
    from appliance.cli.pictures import danced, drawn, rendered

    dance, out = danced(recording, metres_per_unit).part(start, seconds), out or recording.with_suffix(".png")
    typer.echo(drawn(dance, out) if look is None else rendered(dance, out, look, show))


@app.command()
def preflight(
    boot: Annotated[
        Path | None, typer.Option(help="The boot partition's folder with show/ and box.yaml.")
    ] = None,
    stick: Annotated[Path, typer.Option(help="The same on a stick.")] = choice.STICK,
    data: Annotated[Path, typer.Option(help="What is kept over power-off.")] = choice.DATA,
    run: Annotated[Path, typer.Option(help="In memory: where all processes look.")] = choice.RUN,
    late: Annotated[bool, typer.Option("--late", help="A stick was plugged into a box that is on.")] = False,
    check_release: Annotated[
        bool, typer.Option("--check-release", help="Instead: can this release dance on this machine?")
    ] = False,
) -> None:
    """Decide which show dances: a new one if it is sound, else the last good one."""
    from appliance.cli import preflight

    arguments = [f"--stick={stick}", f"--data={data}", f"--run={run}"]
    arguments += [f"--boot={boot}"] * (boot is not None) + ["--late"] * late
    raise typer.Exit(preflight.main([*arguments, *["--check-release"] * check_release]))


@app.command()
def firewall(
    box: BoxFile = None,
    chosen: ChosenFile = None,
    access_point: Annotated[
        list[str] | None, typer.Option(help="Network card whose access point the sensors join; several.")
    ] = None,
) -> None:
    """Print rules for nft that let in what the box file opens, and nothing else."""
    from appliance.cli.firewall import print_rules

    print_rules(box_of(box, chosen), access_point or [])


@app.command()
def version() -> None:
    """Say which version this is."""
    typer.echo(f"bunraku {distribution_version('bunraku')}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; errors that people can mend are one clear line and exit status 2."""
    end_with_parent()
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] not in _own_commands():
        plug_in(app, entry_points(group=PLUG_INS), lambda words: print(words, file=sys.stderr))
    try:
        app(given, prog_name="bunraku")
    except Exception as error:
        refuse(error)


def refuse(error: Exception) -> NoReturn:
    """End with one clear line, if the error is one that people can mend; others are raised."""
    if not _is_for_people(error):
        raise error
    print(f"bunraku: {error}", file=sys.stderr)
    status = getattr(error, "exit_status", REFUSED)
    if status != REFUSED:
        Notifier().ready(str(error))  # for systemd this is no failed start
    sys.exit(status)


def plug_in(onto: typer.Typer, found: Iterable[EntryPoint], say: Callable[[str], None]) -> None:
    """Add the commands of every plug-in that loads; one that does not load costs its own alone."""
    for point in found:
        try:
            onto.add_typer(point.load())
        except Exception as error:
            say(f"bunraku: the commands of '{point.name}' are not available here ({error}).")


def _own_commands() -> set[str]:
    commands = {
        command.name or command.callback.__name__ for command in app.registered_commands if command.callback
    }
    return commands | {str(group.name) for group in app.registered_groups if group.name}


def _is_for_people(error: Exception) -> bool:
    from appliance.box.runtime_folder import RuntimeFolderError
    from appliance.pose.bvh import BvhError
    from appliance.recorder.journal_error import JournalError
    from appliance.show.config_error import ConfigError
    from appliance.stage.stage_error import StageError

    return isinstance(error, BvhError | ConfigError | JournalError | RuntimeFolderError | StageError)


if __name__ == "__main__":
    main()
