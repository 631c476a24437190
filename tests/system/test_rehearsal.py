"""A rehearsal with emulated sensors on a venue's box: the files that the box keeps stay as they were."""

from __future__ import annotations

import shutil
import time
from contextlib import closing
from pathlib import Path

from appliance.box.checkpoint import FILE
from appliance.outputs.frame_reader import FrameReader
from appliance.recorder.journal_reader import read_journal
from appliance.sensor.memory import FILE_NAME, memory_record, memory_text, read_memory
from tests.bundles import write_show
from tests.standing import read_checkpoint
from tests.system.box import Box, playing

VENUE = {"realtime": {"enabled": False}, "state": "state", "journal": {"folder": "journal", "minutes": 5}}
PROFILES = {bytes(16): bytes(22)}


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def rehearse(box: Box, *arguments: str) -> None:
    """The venue's own command with emulated sensors, from its first frames to its end."""
    venue, box.command = box.command, [*box.command, "--emulate", *arguments]
    box.kill_and_restart()
    box.frame_that(lambda frame: frame[2] > 5)
    assert box.end() == 0, box.output
    box.command = venue


def test_a_rehearsal_changes_no_file_of_the_venue_and_the_show_goes_on_afterwards(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show")
    with playing(show, tmp_path, settings=VENUE) as box:
        runtime = box.runtime
        box.frame_that(lambda frame: read_checkpoint(tmp_path / "state" / FILE) is not None)
        box.frames(60)
        box.end_whole()
        memory = memory_record(tmp_path / "state").writer(runtime)  # not on the disk yet
        memory.write(memory_text({}, PROFILES).encode())
        memory.close()
        kept = {name: files_of(tmp_path / name) for name in ("state", "journal")}
        noted = {name: (runtime / name).read_bytes() for name in (FILE, FILE_NAME, "journal")}

        rehearse(box, "--journal", str(tmp_path / "rehearsed"))
        assert {name: files_of(tmp_path / name) for name in kept} == kept
        assert {name: (runtime / name).read_bytes() for name in noted} == noted
        assert "A rehearsal" in box.output
        assert "the show goes on" not in box.output
        assert len(read_journal(tmp_path / "rehearsed").ticks)
        assert {path.name for path in runtime.iterdir() if path.is_dir()} <= {"prepared"}

        shutil.rmtree(tmp_path / "rehearsed")
        rehearse(box)
        assert {name: files_of(tmp_path / name) for name in kept} == kept
        box.kill_and_restart()
        box.await_output("After a restart of the stage the show goes on")
        assert box.end() == 0
        assert "Traceback" not in box.output
    assert read_memory((tmp_path / "state" / FILE_NAME).read_bytes())[1] == PROFILES


def test_a_killed_rehearsal_is_not_resumed(tmp_path: Path) -> None:
    show = write_show(tmp_path / "show")
    with playing(show, tmp_path, "--emulate", settings=VENUE) as box:
        box.frames(20)
        box.kill_and_restart()
        box.frames(5)
        box.command.remove("--emulate")
        box.kill_and_restart()
        box.frames(5)
        assert box.end() == 0
        assert "the show goes on" not in box.output


def test_the_shared_frame_marks_a_rehearsal(tmp_path: Path) -> None:
    """So that the keeper of an installed box does not count it as proof of the show."""
    show = write_show(tmp_path / "show")
    with (
        playing(show, tmp_path, "--emulate", settings=VENUE) as box,
        closing(FrameReader(box.runtime)) as reader,
    ):
        box.frames(1)
        reader.newest(time.monotonic())
        assert reader.facts is not None and reader.facts.rehearsal
        assert box.end() == 0
        box.command.remove("--emulate")
        box.kill_and_restart()
        box.frames(1)
        reader.newest(time.monotonic())
        assert not reader.facts.rehearsal
        assert box.end() == 0
