"""Pictures of journals and recordings: what was danced, drawn as a filmstrip or rendered in a look."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from appliance.box.clock import TICK_S
from appliance.options.idle_options import refuse_idle
from appliance.options.reading import OPTIONS, reading_options
from appliance.pictures.filmstrip import COLUMNS, Strip, draw_filmstrip, draw_strips
from appliance.pose.file_trouble import sentence
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions, read_upright
from appliance.pose.recording import Recording
from appliance.recorder.journal_reader import read_journal
from appliance.recorder.record import holds_of
from appliance.show.bundle import named_show
from appliance.show.look import looks_by_name
from appliance.show.show import load_show
from appliance.stage.stage_error import StageError


@dataclass(frozen=True)
class RecordedDance:
    """The dance of each puppet, frame by frame, how firmly hands held each joint (N, P, J; None: no hand
    did), its title.

    names: of the puppets, where there are several; start_s: second of what was danced at which it begins.
    """

    recordings: tuple[Recording, ...]
    holds: Array | None
    title: str
    names: tuple[str, ...] = ()
    start_s: float = 0.0

    def of_puppet(self, name: str | None) -> Recording:
        """The dance of one of several puppets; None: of the one named first. Raises StageError."""
        if name is None:
            return self.recordings[0]
        if name not in self.names:
            there = f"There are {', '.join(self.names)}." if self.names else "It has one, without a name."
            raise StageError(f"{self.title}: no puppet '{name}' danced. {there}")
        return self.recordings[self.names.index(name)]

    def part(self, start_s: float, seconds: float) -> RecordedDance:
        """`seconds` of it from a start on; a negative start counts from the end. Raises StageError."""
        whole = self.recordings[0]
        start_s = start_s if start_s >= 0.0 else max(0.0, whole.seconds + start_s)
        end_s = start_s + max(seconds, 1.0 / whole.fps)
        parts = tuple(one.excerpt(start_s, end_s) for one in self.recordings)
        if not len(parts[0]):
            raise StageError(
                f"{self.title}: nothing was danced after second {start_s:g}. Choose an earlier start."
            )
        first = min(round(start_s * whole.fps), len(whole))
        holds = None if self.holds is None else self.holds[first : first + len(parts[0])]
        begin_s = self.start_s + first / whole.fps
        return replace(self, recordings=parts, holds=holds, start_s=begin_s)


@reading_options
def filmstrip(
    context: typer.Context,
    recording: Annotated[Path, typer.Argument(help="A BVH recording, or the journal of a run.")],
    out: Annotated[Path | None, typer.Option(help="The PNG. Default: beside the recording.")] = None,
    start: Annotated[
        float, typer.Option(help="Second at which the pictures begin; negative: counted from the end.")
    ] = 0.0,
    seconds: Annotated[float, typer.Option(min=0.1, help="How many seconds they cover.")] = 10.0,
    look: Annotated[
        str | None, typer.Option(help="Render in this look, as the projector shows it: plaster, lines ...")
    ] = None,
    show: Annotated[
        Path | None, typer.Option(callback=named_show, help="Show bundle that the look belongs to.")
    ] = None,
    *,
    reading: ReadingOptions,
) -> None:
    """Draw a recording or a journal as a row of poses; held joints are highlighted."""
    if look is None:
        refuse_idle(context, ("show",), "without --look")
    if not _is_recording(recording):
        refuse_idle(context, OPTIONS, "with a journal, which is upright and in metres")
    out = out or recording.with_suffix(".png")
    dance = load_dance(recording, reading).part(start, seconds)
    print(draw_dance(dance, out) if look is None else render_dance(dance, out, look, show))


def load_dance(source: Path, reading: ReadingOptions = AS_THE_FILES_SAY) -> RecordedDance:
    """All of a BVH recording, upright and in metres, or of a journal. Raises BvhError or JournalError.

    Prints on standard error what it had to guess about a recording.
    """
    if _is_recording(source):
        recording, guesses = read_upright(source, reading)
        for guess in guesses:
            print(f"{source.name}: {guess.sentence()}.", file=sys.stderr)
        return RecordedDance((recording,), None, source.stem)
    journal = read_journal(source)
    ticks = journal.ticks
    skeleton, fps = journal.skeleton, 1.0 / TICK_S
    names = journal.runs[-1].puppets
    recordings = [
        Recording(skeleton, ticks["pose"][:, one], ticks["root"][:, one], fps) for one in range(len(names))
    ]
    holds = holds_of(journal.header, ticks)
    return RecordedDance(tuple(recordings), holds, source.stem, tuple(names) if len(names) > 1 else ())


def _is_recording(source: Path) -> bool:
    return source.suffix.lower() == ".bvh"


def draw_dance(dance: RecordedDance, out: Path) -> Path:
    """Draw a filmstrip of lit figures, held joints highlighted: two rows, or one for each of several puppets.

    Raises StageError.
    """
    first, start_s = dance.recordings[0], dance.start_s
    holds = [None if dance.holds is None else dance.holds[:, one] for one in range(len(dance.recordings))]
    try:
        if not dance.names:
            body = first.skeleton, first.poses, first.roots, first.fps
            return draw_filmstrip(out, *body, holds=holds[0], title=dance.title, start_s=start_s)
        strips = [
            Strip(one.poses, one.roots, name, holds=held)
            for one, name, held in zip(dance.recordings, dance.names, holds, strict=True)
        ]
        return draw_strips(out, first.skeleton, strips, first.fps, dance.title, COLUMNS, start_s)
    except OSError as error:
        raise _unwritable(out, error) from error


def render_dance(dance: RecordedDance, out: Path, look: str, show: Path | None) -> Path:
    """Render a strip of pictures as the projector shows them, in a look of a show, or else a built-in one.

    Raises ConfigError, or StageError where the look is unknown or nothing can be rendered here.
    """
    looks = looks_by_name(() if show is None else load_show(show).config.looks, show)
    if look not in looks:
        raise StageError(f"There is no look '{look}'. There are: {', '.join(looks)}.")
    try:
        from appliance.projector.strip import render_strip

        return render_strip(out, dance.recordings, looks, look, dance.holds)
    except OSError as error:
        raise _unwritable(out, error) from error


def _unwritable(out: Path, error: OSError) -> StageError:
    return StageError(sentence(error, out) or "")
