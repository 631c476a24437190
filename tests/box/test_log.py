"""The log: lines for people come out, whatever is in them and whatever reads them, with their priorities."""

from __future__ import annotations

import fcntl
import logging
import os
import re
import sys
import threading
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from appliance.box.log import (
    LINES,
    MOST_SAID,
    OURS,
    PERIOD_S,
    WAITING_LINES,
    LibraryLimit,
    LogWriter,
    process_log,
)


@pytest.fixture
def pipe() -> Iterator[tuple[FileIO, int]]:
    """A pipe (reading, writing) that keeps its numbers until its writer has ended.

    close() waits for half a second only: on a busy machine the lines of one test would go on into
    the next test's pipe, that was given the same number.
    """
    descriptor, writing = os.pipe()
    with FileIO(descriptor) as reading:
        yield reading, writing
    _ended()  # soon: without its reader, what still waits to be written fails at once
    os.close(writing)


def _ended() -> None:
    for thread in threading.enumerate():
        if thread.name == "log writer":
            thread.join(20.0)
            assert not thread.is_alive()


def _log(
    writer: LogWriter, message: str, level: int = logging.INFO, name: str = "appliance.stage.run"
) -> None:
    writer.handle(logging.LogRecord(name, level, "", 0, message, None, None))


def _all_to(end: bytes, reading: FileIO) -> bytes:
    heard = b""
    while not heard.endswith(end):
        heard += reading.read(1 << 16)
    return heard


def test_a_name_that_is_no_text_does_not_silence_what_follows(pipe: tuple[FileIO, int]) -> None:
    reading, writing = pipe
    writer = LogWriter(writing)
    _log(writer, os.fsdecode(b"caf\xe9.bvh"))
    _log(writer, "The show goes on.")
    writer.close()
    assert _all_to(b"on.\n", reading) == b"caf\\udce9.bvh\nThe show goes on.\n"


def test_a_reader_that_takes_nothing_holds_nobody_up(pipe: tuple[FileIO, int]) -> None:
    """The pipe holds some 60 lines of these, and the queue WAITING_LINES: all others are dropped, at once."""
    _reading, writing = pipe
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 1 << 16)
    writer = LogWriter(writing)

    def speak() -> None:
        for _ in range(1000):
            _log(writer, "x" * 1000)
        writer.close()

    speaking = threading.Thread(target=speak, daemon=True)
    speaking.start()
    speaking.join(20.0)
    assert not speaking.is_alive(), "a line waited for its reader"
    assert 1000 - WAITING_LINES - 70 <= writer.dropped <= 1000 - WAITING_LINES


def test_what_was_dropped_is_counted_and_told_once_lines_are_taken_again(pipe: tuple[FileIO, int]) -> None:
    reading, writing = pipe
    writer = LogWriter(writing)
    for number in range(3 * WAITING_LINES):
        _log(writer, f"{number:05d}" + "x" * 4000)
    dropped = writer.dropped
    assert dropped > WAITING_LINES
    heard = _all_to(b"nothing took them.\n", reading)
    assert f"{dropped} lines before this one are missing".encode() in heard
    _log(writer, "The show goes on.")
    writer.close()
    assert _all_to(b"on.\n", reading) == b"The show goes on.\n"


def test_the_page_still_gets_the_lines_when_the_terminal_is_gone(
    tmp_path: Path, pipe: tuple[FileIO, int]
) -> None:
    reading, writing = pipe
    reading.close()
    writer = LogWriter(writing)
    writer.keep_in(tmp_path / "said")
    for line in ("The show begins.", "The show goes on."):
        _log(writer, line)
    writer.close()
    _ended()
    kept = (tmp_path / "said").read_text().splitlines()
    assert [line.partition(" ")[2] for line in kept] == ["6 The show begins.", "6 The show goes on."]


def test_the_file_for_the_page_stays_small_and_is_there_again_when_it_was_removed(
    tmp_path: Path, pipe: tuple[FileIO, int]
) -> None:
    """A stage of an evening has no memory for each line that it logged."""
    pipe[0].close()
    writer, file = LogWriter(pipe[1]), tmp_path / "said"
    writer.keep_in(file)
    for number in range(2 * MOST_SAID + 2):
        writer._write(f"line {number}", logging.INFO)
    lines = file.read_text().splitlines()
    assert len(lines) == MOST_SAID + 2 and lines[-1].endswith(f" line {2 * MOST_SAID + 1}")
    file.unlink()
    for number in range(MOST_SAID):
        writer._write(f"line {number}", logging.INFO)
    assert file.read_text().endswith(f" line {MOST_SAID - 1}\n")
    writer.close()


def test_the_tick_hands_a_line_over_without_a_lock(
    pipe: tuple[FileIO, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would wait for a thread that may not run for long: one that is not real-time, and holds the lock.

    The first record of a logger is another matter: `logging` asks all loggers above it for their levels.
    """
    reading, writing = pipe
    logger = logging.getLogger("appliance.test")
    locks: list[str] = []
    kinds = (type(threading.Lock()), type(threading.RLock()))

    def note(frame: FrameType, event: str, called: Any) -> None:
        if event == "c_call" and isinstance(getattr(called, "__self__", None), kinds):
            locks.append(called.__name__)

    with process_log(writing) as writer:
        monkeypatch.setattr(logging.getLogger(), "handlers", [writer])  # those of tests take locks
        monkeypatch.setattr(logging.getLogger(OURS), "handlers", [])
        logger.info("A line.")
        sys.setprofile(note)
        try:
            logger.info("Another line.")
        finally:
            sys.setprofile(None)
    assert locks == []
    assert _all_to(b"Another line.\n", reading) == b"A line.\nAnother line.\n"


@pytest.mark.parametrize("is_journal", [True, False])
def test_the_journal_gets_each_lines_priority_and_a_terminal_only_the_line(
    pipe: tuple[FileIO, int], is_journal: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """systemd sets JOURNAL_STREAM for its services; a command that one of them starts inherits it."""
    reading, writing = pipe
    opened = os.fstat(writing)
    monkeypatch.setenv("JOURNAL_STREAM", f"{opened.st_dev}:{opened.st_ino + (not is_journal)}")
    with process_log(writing):
        logger = logging.getLogger("appliance.test")
        logger.info("The dance begins.")
        logger.warning("A sensor is silent.\nThe dancer moves freely.")
        logger.error("No place.")
    expected = b"<6>The dance begins.\n<4>A sensor is silent.\n<4>The dancer moves freely.\n<3>No place.\n"
    if not is_journal:
        expected = re.sub(rb"<\d>", b"", expected)
    assert _all_to(b"place.\n", reading) == expected


def test_messages_of_libraries_are_few_and_say_how_many_were_left_out() -> None:
    """Strangers may provoke them; what the product logs is never left out."""
    now = [0.0]
    limit = LibraryLimit(lambda: now[0])

    def record(level: int, name: str, number: int) -> logging.LogRecord:
        return logging.LogRecord(name, level, "", 0, "message %d", (number,), None)

    records = [record(logging.ERROR, "a", number) for number in range(99)]
    assert [limit.filter(one) for one in records[:50]] == [True] * LINES + [False] * (50 - LINES)
    assert all(limit.filter(record(logging.INFO, "appliance.stage.run", number)) for number in range(99))
    assert not limit.filter(record(logging.INFO, "a", 0))
    now[0] = PERIOD_S
    assert limit.filter(records[50])
    assert records[50].getMessage() == f"a: message 50 ({50 - LINES} messages before this one were left out.)"
    assert limit.filter(records[51]) and records[51].getMessage() == "a: message 51"
