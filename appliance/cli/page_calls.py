"""Functions that the page calls in a process apart, because they load more than its own may: by name."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from appliance.box.parent_death import end_with_parent
from appliance.box.realtime import prepare_environment


def about(box: str | None = None, chosen: str | None = None) -> Any:
    """Facts about this box."""
    from appliance.release import about

    return about.about(_path(chosen), _path(box))


def shows_here(
    danced: str | None, learned: str | None, box: str | None = None, chosen: str | None = None
) -> Any:
    """The shows that this box can play."""
    from appliance.release import shows_here

    return shows_here.shows_here(_path(chosen), _path(danced), _path(learned))


def pose_map(show: str | None = None) -> Any:
    """The map of a show's poses."""
    from appliance.generator import pose_map
    from appliance.show.bundle import default_show_path
    from appliance.show.show import load_show
    from appliance.stage.stage_error import StageError

    try:
        return pose_map.pose_map(load_show(_path(show) or default_show_path()))
    except LookupError as error:
        raise StageError(str(error)) from None


def keep_cue(show: str, into: str, cue: dict[str, Any]) -> Any:
    """Write a cue into the copy of a show."""
    from appliance.release import rehearsed
    from appliance.stage.stage_error import StageError

    try:
        return rehearsed.keep_cue(Path(show), Path(into), cue)
    except OSError as error:
        raise StageError(f"{into}: the copy of the show cannot be kept ({error.strerror}).") from error


def box_file(box: str | None = None, chosen: str | None = None) -> Any:
    """The box file with its venue's keys."""
    from appliance.cli import box_file

    return box_file.reported(_path(box), _path(chosen))


def change_box_file(change: dict[str, Any], box: str | None = None, chosen: str | None = None) -> Any:
    """Change the box file."""
    from appliance.cli import box_file

    return box_file.change(_path(box), _path(chosen), box_file.Change(**change))


def dance_again(show: str, box: str | None = None, chosen: str | None = None) -> Any:
    """Let a show that the box has kept dance from now on, by its id."""
    from appliance.cli import box_file

    return box_file.dance_again(_chosen(chosen), show)


def adopt_show(
    folder: str, source: str = "rehearsal", box: str | None = None, chosen: str | None = None
) -> Any:
    """Let a show dance from now on: the copy of a rehearsal, or what was learned."""
    from appliance.cli import box_file

    return box_file.adopt_show(_chosen(chosen), Path(folder), source)


def pack_show(show: str, into: str) -> Any:
    """Pack a show for other boxes."""
    from appliance.release import packed_show

    packed_show.pack_show(Path(show), Path(into))
    return {}


def take_show(file: str, now: bool, box: str | None = None, chosen: str | None = None) -> Any:
    """Let a packed show from another box dance."""
    from appliance.cli import box_file

    return box_file.take_show(_chosen(chosen), Path(file), now)


def use_rehearsal(journal: str, into: str) -> Any:
    """Write a live dancer's dance from the journal as recordings to learn from."""
    import shutil

    from appliance.exchange.training_set import write_training_set
    from appliance.recorder.journal_error import JournalError
    from appliance.recorder.journal_reader import read_journal

    written = write_training_set(read_journal(Path(journal)), Path(into))
    if not written.recordings:
        shutil.rmtree(into)
        raise JournalError("No live dancer danced in this journal: there is nothing to learn from.")
    return {"name": f"box/{written.folder.name}", "seconds": written.seconds}


def check_recording(file: str, name: str) -> Any:
    """Read a recording that came by the page; name: for messages."""
    from appliance.pose.bvh import BvhError, read_bvh
    from appliance.stage.stage_error import StageError

    try:
        seconds = read_bvh(Path(file)).seconds
    except (BvhError, OSError) as error:
        raise StageError(str(error).replace(file, name)) from None
    if seconds < 1.0:
        raise StageError(f"{name}: there is less than a second of dance in it. Export the recording again.")
    return {"seconds": seconds}


def help_file(
    out: str,
    journal: str | None,
    log: list[str],
    status: dict[str, Any],
    box: str | None = None,
    chosen: str | None = None,
) -> Any:
    """Write the help file."""
    import socket

    from appliance.cli import help_file, proof
    from appliance.release.choice import box_of
    from appliance.stage.stage_error import StageError

    versions = {"host": socket.gethostname(), "machine": proof.machine(), "software": proof.software()}
    folder = _path(journal)
    try:
        help_file.help_file(Path(out), box_of(_path(box), _path(chosen)), folder, log, status, versions)
    except OSError as error:
        raise StageError(f"{out}: the file cannot be written ({error.strerror}). Free memory.") from error
    return {}


def timelines(journal: str) -> Any:
    """All runs of a journal."""
    from appliance.recorder.journal_reader import read_journal
    from appliance.recorder.timeline import timeline

    return [timeline(number, run) for number, run in enumerate(read_journal(Path(journal)).runs, 1)]


def stretch(journal: str, run: int, start: float, seconds: float, out: str | None = None) -> bytes:
    """A stretch of a run: frames for the page, or into a BVH, glTF or .bunraku file."""
    from appliance.exchange.formats import write_recording
    from appliance.pose.counted import counted
    from appliance.pose.recording import Recording
    from appliance.recorder.export import export_stretch
    from appliance.recorder.journal_error import JournalError
    from appliance.recorder.journal_reader import EXPORTED, read_journal
    from appliance.recorder.timeline import stretch

    runs = read_journal(Path(journal)).runs
    if run > len(runs):
        raise JournalError(f"The journal has {counted(len(runs), 'run')}, and no run {run}.")
    one = runs[run - 1]
    if out is None:
        return b"".join(stretch(one, start, seconds))
    if Path(out).suffix.casefold() == EXPORTED:
        export_stretch(Path(journal), Path(out), one, start, seconds)
        return b""
    whole = Recording(
        one.skeleton, one.ticks["pose"][:, 0], one.ticks["root"][:, 0], 1.0 / one.header["tick_s"]
    )
    write_recording(Path(out), whole.excerpt(start, start + seconds))
    return b""


CALLS: dict[str, Callable[..., Any]] = {
    one.__name__: one
    for one in (
        *(about, shows_here, pose_map, keep_cue, box_file, change_box_file, dance_again, adopt_show),
        *(pack_show, take_show, timelines, stretch, help_file, use_rehearsal, check_recording),
    )
}


def main() -> None:
    """Call the function on the command line with the keywords on standard input; write what it returns."""
    end_with_parent()
    prepare_environment()
    try:
        answer = CALLS[sys.argv[1]](**json.loads(sys.stdin.buffer.read()))
    except Exception as error:
        from appliance.cli.app import refuse

        refuse(error)
    sys.stdout.buffer.write(answer if isinstance(answer, bytes) else json.dumps(answer).encode())


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def _chosen(text: str | None) -> Path:
    from appliance.release.choice import CHOSEN, RUN

    return _path(text) or RUN / CHOSEN


if __name__ == "__main__":
    main()
