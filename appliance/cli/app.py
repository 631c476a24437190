"""The command `bunraku`: which module has which command; simulation and studio plug in their own."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.metadata import version as distribution_version
from pathlib import Path
from typing import Annotated, Any, NoReturn

from appliance.box.notify import Notifier
from appliance.box.parent_death import end_with_parent
from appliance.box.realtime import prepare_environment

prepare_environment()

import typer  # noqa: E402  (numpy, which commands import, must find the environment prepared)

from appliance.cli.distributions import PLUG_INS, absent, absent_commands  # noqa: E402
from appliance.cli.examples import ORDER, SYNONYMS  # noqa: E402
from appliance.cli.help_page import complete_help  # noqa: E402
from appliance.cli.options import BoxFile, ChosenFile, ShowFolder  # noqa: E402
from appliance.options.idle_options import refuse_idle  # noqa: E402
from appliance.pose.correctable_error import CorrectableError  # noqa: E402
from appliance.pose.file_trouble import sentence  # noqa: E402
from appliance.show.config_error import ConfigError, Problem, nearest  # noqa: E402

REFUSED = 2
_HERE = __name__
_MODULES = {  # in each a function or a group of the command's name
    "play": _HERE,
    "project": "appliance.cli.project",
    "control": "appliance.cli.control",
    "console": "appliance.cli.console",
    "generate": "appliance.cli.generate",
    "kept": "appliance.cli.kept",
    "keep": "appliance.cli.keep",
    "check": "appliance.cli.check",
    "pack": "appliance.cli.check",
    "doctor": "appliance.cli.doctor.doctor_command",
    "journal": "appliance.cli.journal",
    "replay": "appliance.cli.replay",
    "filmstrip": "appliance.cli.pictures",
    "provision": "appliance.cli.sensors.commands",
    "sensors": "appliance.cli.sensors.commands",
    "lights": "appliance.cli.lights_commands",
    "pair": "appliance.cli.pair",
    "fleet": "appliance.cli.fleet",
    "sound": "appliance.cli.sound",
    "remote": "appliance.cli.remote",
    "learn": "appliance.cli.learn",
    "preflight": _HERE,
    "release": "appliance.cli.release",
    "firewall": "appliance.cli.firewall",
    "version": _HERE,
}


_OWN_OPTIONS = ("preflight", "release")  # programs that also run without this parser
_OF_THE_PROJECTOR = ("moderngl", "glcontext")
_PROJECTOR_CURE = (
    "Where it has no wheel it needs a compiler (Debian: sudo apt install g++ python3-dev), then: "
    "pip install 'bunraku[projector]'. The Debian package of a box has it."
)


def command_line(name: str | None = None) -> typer.Typer:
    """The parser of one command, which loads no other (none where it is a plug-in's), or of all of them."""
    app = typer.Typer(
        help="The box that lets a dancer puppeteer an AI dancer on stage.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_bunraku)  # a parser of one command expects its name too
    for command, module in _MODULES.items():
        if name in (None, command):
            found = _loaded(command, module)
            if isinstance(found, typer.Typer):
                app.add_typer(found, name=command)
            elif command in _OWN_OPTIONS or module not in sys.modules:
                settings = {"allow_extra_args": True, "ignore_unknown_options": True}
                app.command(command, add_help_option=False, context_settings=settings)(_ending(found))
            else:
                app.command(command)(_ending(found))
    return app


def _bunraku(
    version: Annotated[bool, typer.Option("--version", help="Print the version, and end.")] = False,
) -> None:
    """The box that lets a dancer puppeteer an AI dancer on stage."""


def _loaded(command: str, module: str) -> Any:
    """The command, or one in its place that says which package is missing: only the projector's can be."""
    try:
        return getattr(import_module(module), command)
    except ModuleNotFoundError as error:
        if error.name not in _OF_THE_PROJECTOR:
            raise
        message = f"The projector draws with {error.name}, which is not installed here: there is no picture."
        missing = ConfigError([Problem(Path(command), 0, message, _PROJECTOR_CURE)])

    def absent_projector(context: typer.Context) -> NoReturn:
        """Show what the stage dances. Not installed here."""
        raise missing

    return absent_projector


def _ending(command: Callable[..., int | None]) -> Callable[..., None]:
    """The command, which ends the process with the exit status that it returns."""

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> None:
        raise typer.Exit(command(*arguments, **options) or 0)

    return run


def play(
    context: typer.Context,
    show: ShowFolder = None,
    box: BoxFile = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="Stop after this time. Default: never.")
    ] = None,
    emulate: Annotated[
        bool, typer.Option("--emulate", help="Start emulated sensors, over real sockets.")
    ] = False,
    journal: Annotated[
        Path | None, typer.Option(help="Folder for the flight recorder. Default: the box file's.")
    ] = None,
    filmstrip: Annotated[
        Path | None, typer.Option(help="At the end draw what was danced into this PNG.")
    ] = None,
    alone: Annotated[
        bool, typer.Option("--alone", help="Start no companions (show control, lights, keeper).")
    ] = False,
    window: Annotated[bool, typer.Option("--window", help="Show the projection in a window.")] = False,
    rehearse: Annotated[
        Path | None,
        typer.Option(
            help="Open a window where there is a display; at the end render the dance into this PNG."
        ),
    ] = None,
    chosen: ChosenFile = None,
    cue: Annotated[str | None, typer.Option(help="Begin in this cue of the show.")] = None,
    phone: Annotated[
        bool,
        typer.Option(
            "--phone",
            help="Let a phone be the show's first sensor: print a QR code, and serve the page over HTTPS to "
            "this machine's networks.",
        ),
    ] = False,
) -> int:
    """Dance: sensors in, joints out, 50 times a second, until Ctrl-C."""
    from appliance.cli.play import PlayOptions, play_show

    if alone:
        refuse_idle(context, ("window",), "with --alone, which starts no projector")
        refuse_idle(context, ("phone",), "with --alone, which serves no page")
    return play_show(
        PlayOptions(
            show=show,
            box=box,
            seconds=seconds,
            emulate=emulate,
            journal=journal,
            filmstrip=filmstrip,
            alone=alone,
            window=window,
            rehearse=rehearse,
            chosen=chosen,
            cue=cue,
            phone=phone,
        )
    )


def preflight(context: typer.Context) -> int:
    """Decide which show dances: a new one if it is sound, else the last good one."""
    from appliance.cli.preflight import main

    return main(context.args)


def version() -> None:
    """Say which version this is."""
    print(f"bunraku {distribution_version('bunraku')}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; an error that the user can correct ends it with one clear line and exit status 2."""
    end_with_parent()
    given = list(sys.argv[1:] if arguments is None else arguments)
    if "--version" in given:
        given = ["version"]
    word = given[0] if given else ""
    plugged = [] if word in _MODULES else plug_ins(entry_points(group=PLUG_INS))
    command = parser(word, plugged)
    if word not in command.commands:  # help and mistakes need all
        command = parser(None, plugged)
    complete_help(command, order=ORDER)
    if word not in command.commands:
        command.epilog += "".join(
            f"\n\nNot installed here: {one.name} ({', '.join(one.commands)})." for one in absent()
        )
    _require_known(given, list(command.commands))
    gc.enable()  # spare_the_collector has put it off until the command is loaded
    try:
        command(given, prog_name="bunraku")
    except Exception as error:
        refuse(error)


def parser(name: str | None, plugged: Iterable[typer.Typer] = ()) -> Any:
    """The parsed `command_line` with the commands of plug-ins beside its own."""
    app = command_line(name)
    for each in plugged:
        app.add_typer(each)
    return typer.main.get_command(app)


def _require_known(given: Sequence[str], commands: Sequence[str]) -> None:
    """End with the nearest command, by spelling or by meaning, where there is none of this name."""
    word = given[0] if given else ""
    if not word or word.startswith("-") or word in commands:
        return
    missing = absent_commands()
    if word in missing:
        print(f"bunraku: {missing[word]}", file=sys.stderr)
        sys.exit(REFUSED)
    known = {name: name for name in (*commands, *missing)}
    meant = {other: name for name, others in SYNONYMS.items() if name in known for other in others}
    near = nearest(word, list(known | meant)) if word.casefold() not in meant else word.casefold()
    found = known.get(near or "") or meant.get(near or "")
    cure = f"Did you mean '{found}'?" if found else "bunraku -h lists all."
    print(f"bunraku: There is no command '{word}'. {cure}", file=sys.stderr)
    sys.exit(REFUSED)


def refuse(error: Exception) -> NoReturn:
    """Exit with one clear line for an error that the user can correct; raise any other."""
    message = str(error) if isinstance(error, CorrectableError) else None
    if isinstance(error, OSError):
        message = sentence(error)
    if message is None:
        raise error
    from appliance.box.log import is_journal

    print(f"{'<3>' * is_journal(2)}bunraku: {message}", file=sys.stderr)  # sd-daemon(3): an error
    status = getattr(error, "exit_status", REFUSED)
    if status != REFUSED:
        Notifier().ready(str(error))  # systemd must not count this as a failed start
    sys.exit(status)


def plug_ins(found: Iterable[EntryPoint]) -> list[typer.Typer]:
    """The commands of every plug-in. A plug-in that does not load loses only its own commands."""
    loaded = []
    for point in found:
        try:
            loaded.append(point.load())
        except Exception as error:
            message = f"bunraku: the commands of '{point.name}' are not available here ({error})."
            print(message, file=sys.stderr)
    return loaded


if __name__ == "__main__":
    main()
