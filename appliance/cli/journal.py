"""`bunraku journal`: list what the box has recorded, and export it to a stick."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from appliance.box.child import finished
from appliance.cli.options import ChosenFile, ThisBoxFile, command_group
from appliance.options.idle_options import refuse_idle
from appliance.release.installed_box import box_here
from appliance.show_control.packet import readable

if TYPE_CHECKING:
    from appliance.recorder.journal_reader import Run

STICK = Path("/media/bunraku")
_TROUBLES = ("late", "skipped", "failed")

journal = command_group("List what the flight recorder holds, or export it to a stick.", needs_command=True)

Recorded = Annotated[
    Path | None, typer.Option("--journal", help="Folder or exported file. Default: the box file's folder.")
]


@journal.command("list")
def list_journal(
    box: ThisBoxFile = None,
    chosen: ChosenFile = None,
    recorded: Recorded = None,
    events: Annotated[
        bool, typer.Option("--events", help="Also list what was ordered and said, in order.")
    ] = False,
) -> None:
    """List the runs in a journal: when, how long, what was late, how often the network failed."""
    from appliance.recorder.journal_reader import read_journal
    from appliance.recorder.timeline import message_of

    for number, run in enumerate(read_journal(_recorded(box, chosen, recorded)).runs, 1):
        typer.echo(readable(_line(number, run)))
        for _, event in run.events if events else ():
            second = event["now"] - float(run.ticks["frame_time"][0])
            typer.echo(readable(f"   {second:9.2f} s  {event['kind']}: {message_of(event)}"))


@journal.command("timeline")
def show_timeline(
    box: ThisBoxFile = None,
    chosen: ChosenFile = None,
    recorded: Recorded = None,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON, for programs.")] = False,
) -> None:
    """Show minute by minute what was late or skipped, and how long the slowest tick took."""
    from appliance.recorder.journal_reader import read_journal
    from appliance.recorder.timeline import timeline

    read = read_journal(_recorded(box, chosen, recorded)).runs
    runs = [timeline(number, run) for number, run in enumerate(read, 1)]
    if as_json:
        typer.echo(json.dumps(runs))
        return
    for run in runs:
        begun = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(run["begun"]))
        typer.echo(readable(f"{run['number']}. {begun}  {run['show']}: {run['seconds']:.0f} s"))
        for line in _minutes(run):
            typer.echo(line)


def _minutes(run: dict[str, Any]) -> Iterator[str]:
    """A line for each minute of a run, or for each bin where bins are longer."""
    bins = max(1, round(60.0 / run["bin_s"]))
    for first in range(0, len(run["late"]), bins):
        part = slice(first, first + bins)
        counts = [f"{sum(run[what][part])} {what}" for what in _TROUBLES if any(run[what][part])]
        slowest = f"slowest tick {max(run['slowest_ms'][part]):.1f} ms"
        yield f"   {first * run['bin_s'] / 60:6.1f} min  {', '.join([*counts, slowest])}"


@journal.command("export")
def export_journal(
    context: typer.Context,
    to: Annotated[Path | None, typer.Argument(help="Folder or file. Default: the stick.")] = None,
    box: ThisBoxFile = None,
    chosen: ChosenFile = None,
    recorded: Recorded = None,
    bvh: Annotated[Path | None, typer.Option(help="Write what was danced into this BVH file.")] = None,
    glb: Annotated[
        Path | None, typer.Option(help="Write it into this glTF file, for Blender, three.js, TouchDesigner.")
    ] = None,
    puppet: Annotated[
        str | None, typer.Option(help="With --bvh or --glb: which puppet of several, by name.")
    ] = None,
    training: Annotated[
        Path | None, typer.Option(help="Write a live dancer's dance, hands and cues into this new folder.")
    ] = None,
) -> None:
    """Write the journal into one file that replay, filmstrip and list read, on a stick for example.

    With --bvh or --glb it writes only the dance, as a recording; with --training, a folder that bunraku train
    takes.
    """
    from appliance.recorder.export import export

    source = _recorded(box, chosen, recorded)
    if training is not None:
        if to is not None or bvh is not None or glb is not None:
            raise typer.BadParameter("--training writes a folder: leave the others out")
        from appliance.exchange.training_set import write_training_set
        from appliance.recorder.journal_reader import read_journal

        typer.echo(write_training_set(read_journal(source), training).sentence())
        return
    if bvh is not None or glb is not None:
        _export_dance(source, to, {".bvh": bvh, ".glb": glb}, puppet)
        return
    refuse_idle(context, ("puppet",), "without --bvh or --glb")
    if to is not None:
        typer.echo(f"Exported: {export(source, to, progress=_progress)}")
        return
    with _writable(STICK):
        typer.echo(f"Exported: {export(source, STICK, progress=_progress)}. The stick can be pulled.")


def _export_dance(source: Path, to: Path | None, wanted: dict[str, Path | None], puppet: str | None) -> None:
    """Export the dance of a journal as recordings. Raises JournalError, StageError or ExchangeError."""
    from appliance.cli.pictures import load_dance
    from appliance.exchange.exchange_error import ExchangeError
    from appliance.exchange.formats import write_recording

    if to is not None:
        raise typer.BadParameter(f"with --bvh or --glb the dance alone is written: leave out '{to}'")
    for ending, out in wanted.items():
        if out is not None and out.suffix.lower() != ending:
            raise ExchangeError(out, f"A file for --{ending[1:]} ends with {ending}.")
    dance = load_dance(source)
    danced, which = dance.of_puppet(puppet), ""
    if dance.names:
        which = f" by {puppet or dance.names[0]} of {', '.join(dance.names)} (--puppet)"
    for out in filter(None, wanted.values()):
        write_recording(out, danced)
        typer.echo(f"Exported: {out}, {danced.seconds:.1f} s of dance{which}.")


def _recorded(box: Path | None, chosen: Path | None, recorded: Path | None) -> Path:
    """Where the journal is; without any option, that of the show chosen on this box."""
    from appliance.recorder.journal_error import JournalError
    from appliance.show.box import load_box

    if recorded is not None:
        return recorded
    folder = load_box(box_here(box, chosen)).journal.folder
    if folder is None:
        raise JournalError(
            "No box file names a journal. Name it: --journal FOLDER, or the box file: --box FILE, where "
            "`journal: {folder: ...}` says that there is one."
        )
    return folder


def _line(number: int, run: Run) -> str:
    from appliance.recorder.record import LATE, NOT_FINITE

    begun = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(run.header["written_at"]))
    flags = run.ticks["flags"]
    late, failed = (int(((flags & flag) != 0).sum()) for flag in (LATE, NOT_FINITE))
    lost = int(run.ticks["skipped"].sum())
    happened = Counter(event["kind"] for _, event in run.events)
    reported = [f"{late} late"] + [f"{lost} skipped"] * (lost > 0)
    reported += [f"{failed} with a network that failed"] * (failed > 0)
    reported += [f"{count} x {kind}" for kind, count in sorted(happened.items())]
    seconds = len(run.ticks) * run.header["tick_s"]
    return f"{number}. {begun}  {run.header['show']}: {seconds:.0f} s, {', '.join(reported)}"


@contextmanager
def _writable(stick: Path) -> Iterator[None]:
    """A context in which the stick, mounted read-only, is writable. Raises JournalError."""
    from appliance.recorder.journal_error import JournalError

    if not stick.is_mount():
        raise JournalError(
            f"No stick is at {stick}. Plug in one whose file system has the label BUNRAKU, or name a folder."
        )
    done = finished(("mount", "-o", "remount,rw", str(stick)))
    if done.returncode:
        said = done.stderr.strip().rpartition(":")[2].strip() or f"mount: status {done.returncode}"
        raise JournalError(
            f"{stick}: the stick cannot be written to ({said}). Run it as root: sudo bunraku journal export. "
            "Or look for a lock on the stick."
        )
    try:
        yield
    finally:
        finished(("mount", "-o", "remount,ro", str(stick)))


def _progress(written: int, size: int) -> None:
    """A line on the terminal that replaces itself."""
    if sys.stderr.isatty():
        end = "\n" if written >= size else ""
        print(f"\r{written / 1e6:.0f} of {size / 1e6:.0f} MB", end=end, file=sys.stderr, flush=True)
