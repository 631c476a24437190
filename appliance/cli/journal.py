"""`bunraku journal`: list what the box has recorded, and export it to a stick."""

from __future__ import annotations

import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from appliance.cli.options import ChosenFile, ThisBoxFile, command_group
from appliance.release.installed_box import box_here

if TYPE_CHECKING:
    from appliance.recorder.reading import Run

STICK = Path("/media/bunraku")

journal = command_group("List what the flight recorder holds, or export it to a stick.", needs_command=True)

Recorded = Annotated[
    Path | None, typer.Option("--journal", help="Folder or exported file; left out: the box file's folder.")
]


@journal.command("list")
def list_journal(
    box: ThisBoxFile = None,
    chosen: ChosenFile = None,
    recorded: Recorded = None,
    events: Annotated[
        bool, typer.Option("--events", help="And what was ordered and said, in order.")
    ] = False,
) -> None:
    """List the runs in a journal: when, how long, what was late, how often the network failed."""
    from appliance.recorder.reading import read_journal
    from appliance.show_control.packet import readable

    for number, run in enumerate(read_journal(_recorded(box, chosen, recorded)).runs, 1):
        typer.echo(readable(_line(number, run)))
        for _, event in run.events if events else ():
            typer.echo(readable(_event_line(event, float(run.ticks["frame_time"][0]))))


@journal.command("export")
def export_journal(
    to: Annotated[Path | None, typer.Argument(help="Folder or file; left out: the stick.")] = None,
    box: ThisBoxFile = None,
    chosen: ChosenFile = None,
    recorded: Recorded = None,
) -> None:
    """Write the journal into one file that replay, filmstrip and list read, on a stick for example."""
    from appliance.recorder.export import export

    source = _recorded(box, chosen, recorded)
    if to is not None:
        typer.echo(f"Exported: {export(source, to, progress=_progress)}")
        return
    with _writable(STICK):
        typer.echo(f"Exported: {export(source, STICK, progress=_progress)}. The stick can be pulled.")


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
    told = [f"{late} late"] + [f"{lost} skipped"] * (lost > 0)
    told += [f"{failed} with a network that failed"] * (failed > 0)
    told += [f"{count} x {kind}" for kind, count in sorted(happened.items())]
    seconds = len(run.ticks) * run.header["tick_s"]
    return f"{number}. {begun}  {run.header['show']}: {seconds:.0f} s, {', '.join(told)}"


def _event_line(event: dict[str, Any], begun: float) -> str:
    """When, in seconds of the run, and what."""
    asked = event.get("order", {})
    words = [str(word) for word in (asked.get("name", ""), asked.get("text", ""), *asked.get("values", ()))]
    words += [str(event.get("words", ""))] + ["(refused)"] * (event.get("done") is False)
    return f"   {event['now'] - begun:9.2f} s  {event['kind']}: {' '.join(filter(None, words))}"


@contextmanager
def _writable(stick: Path) -> Iterator[None]:
    """A context in which the stick, mounted read-only, is writable. Raises JournalError."""
    from appliance.recorder.journal_error import JournalError

    if not stick.is_mount():
        raise JournalError(
            f"No stick is at {stick}. Plug in one whose file system has the label BUNRAKU, or name a folder."
        )
    done = subprocess.run(
        ("mount", "-o", "remount,rw", str(stick)), capture_output=True, text=True, check=False
    )
    if done.returncode:
        said = done.stderr.strip().rpartition(":")[2].strip() or f"mount: status {done.returncode}"
        raise JournalError(
            f"{stick}: the stick cannot be written to ({said}). Run it as root: sudo bunraku journal export. "
            "Or look for a lock on the stick."
        )
    try:
        yield
    finally:
        subprocess.run(("mount", "-o", "remount,ro", str(stick)), capture_output=True, check=False)


def _progress(written: int, size: int) -> None:
    """A line on the terminal that replaces itself."""
    if sys.stderr.isatty():
        end = "\n" if written >= size else ""
        print(f"\r{written / 1e6:.0f} of {size / 1e6:.0f} MB", end=end, file=sys.stderr, flush=True)
