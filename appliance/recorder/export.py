"""Exports a journal into one file: its segments with their checksums, whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import io
import itertools
import re
import tarfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from appliance.box.durable import replacing
from appliance.recorder import chunks, log
from appliance.recorder.journal_error import JournalError
from appliance.recorder.journal_reader import EXPORTED, Run, header_of, segments_of
from appliance.recorder.record import DAMAGED
from appliance.recorder.segments import SUFFIX

CHECKSUMS = "SHA256SUMS"
_LONGEST_NAME = 80  # length of a show's name, before the date


def export(
    journal: Path,
    to: Path,
    wall_clock: Callable[[], float] = time.time,
    progress: Callable[[int, int], None] = lambda written, of: None,
) -> Path:
    """Write a journal to a file, or into a folder as `<show>-<date>.bunraku`; the file.

    It appears under its name when it is whole and on the disk. `progress`: bytes so far, and all of them.
    Raises JournalError with the reason.
    """
    show, size = _show_and_size(journal)
    target = to / _name(show, wall_clock()) if to.is_dir() else to
    _write(segments_of(journal), target, size, progress)
    return target


def export_stretch(journal: Path, to: Path, run: Run, start_s: float, seconds: float) -> None:
    """Write the segments of a run in which these seconds of it lie: what they hold can be danced again.

    `run`: as it was read from this journal. Raises JournalError with the reason, before anything is written
    where nothing was danced then.
    """
    at = run.ticks["frame_time"] - run.ticks["frame_time"][0]
    wanted = run.tick_numbers[(at >= start_s) & (at < start_s + seconds)]
    if not len(wanted):
        raise JournalError(f"Nothing was danced at second {start_s:g} of this run.")
    _write(_with_entries(journal, run.header["run"], int(wanted[0]), int(wanted[-1])), to)


def _with_entries(journal: Path, run: str, first: int, last: int) -> Iterator[tuple[str, bytes]]:
    """The segments of a run that hold one of these entries of its log."""
    for name, data in segments_of(journal):
        header = header_of(data)
        if header is not None and header["run"] == run:
            logs = (log.unpacked(one.data) for one in chunks.chunks(data) if one.kind == chunks.LOG)
            if any(first <= entry.number <= last for entry in itertools.chain.from_iterable(logs)):
                yield name, data


def _write(
    segments: Iterable[tuple[str, bytes]],
    target: Path,
    size: int = 0,
    progress: Callable[[int, int], None] = lambda written, of: None,
) -> None:
    written, checksums = 0, []
    try:
        with (
            replacing(target) as file,
            tarfile.open(fileobj=file, mode="w:", format=tarfile.USTAR_FORMAT) as archive,
        ):
            for number, (_, data) in enumerate(segments, 1):
                name = f"{number:08d}{SUFFIX}"  # whatever it is called there
                _add(archive, name, data)
                checksums.append(f"{hashlib.sha256(data).hexdigest()}  {name}\n")
                written += len(data)
                progress(written, max(size, written))
            _add(archive, CHECKSUMS, "".join(checksums).encode())
    except OSError as error:
        raise JournalError(
            f"{target}: the journal cannot be written there ({error.strerror}). It stays on the box. Take a "
            "stick with more room that can be written to, or name another place."
        ) from error


def _show_and_size(journal: Path) -> tuple[str, int]:
    """The newest show in it, and its bytes."""
    show, size = "journal", 0
    for _, data in segments_of(journal):
        with contextlib.suppress(*DAMAGED):
            header = header_of(data)
            show = show if header is None else header["show"]
        size += len(data)
    return show, size


def _add(archive: tarfile.TarFile, name: str, data: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size, member.mode = len(data), 0o644
    archive.addfile(member, io.BytesIO(data))


def _name(show: str, now: float) -> str:
    """After the show, and the time by the box's clock."""
    plain = re.sub(r"[^a-z0-9]+", "-", show.lower()).strip("-")[:_LONGEST_NAME] or "journal"
    return f"{plain}-{time.strftime('%Y%m%d-%H%M%S', time.localtime(now))}{EXPORTED}"
