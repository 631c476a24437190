"""The speaker: lines for people come out, whatever is in them and whoever reads them."""

from __future__ import annotations

import fcntl
import os
import sys
import threading
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from appliance.box.log_writer import WAITING_LINES, LogWriter


@pytest.fixture
def pipe() -> Iterator[tuple[FileIO, int]]:
    """A pipe (reading, writing) that keeps its numbers until its speaker has ended.

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
        if thread.name == "speaker":
            thread.join(20.0)
            assert not thread.is_alive()


def _all_to(end: bytes, reading: FileIO) -> bytes:
    heard = b""
    while not heard.endswith(end):
        heard += reading.read(1 << 16)
    return heard


def test_a_name_that_is_no_text_does_not_silence_what_follows(pipe: tuple[FileIO, int]) -> None:
    reading, writing = pipe
    speaker = LogWriter(writing)
    speaker.say(os.fsdecode(b"caf\xe9.bvh"))
    speaker.say("The show goes on.")
    speaker.close()
    assert _all_to(b"on.\n", reading) == b"caf\\udce9.bvh\nThe show goes on.\n"


def test_a_reader_that_takes_nothing_holds_nobody_up(pipe: tuple[FileIO, int]) -> None:
    """The pipe holds some 60 lines of these, and the queue WAITING_LINES: all others are dropped, at once."""
    _reading, writing = pipe
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 1 << 16)
    speaker = LogWriter(writing)

    def speak() -> None:
        for _ in range(1000):
            speaker.say("x" * 1000)
        speaker.close()

    speaking = threading.Thread(target=speak, daemon=True)
    speaking.start()
    speaking.join(20.0)
    assert not speaking.is_alive(), "a line waited for its reader"
    assert 1000 - WAITING_LINES - 70 <= speaker.dropped <= 1000 - WAITING_LINES


def test_what_was_dropped_is_counted_and_told_once_lines_are_taken_again(pipe: tuple[FileIO, int]) -> None:
    reading, writing = pipe
    speaker = LogWriter(writing)
    for number in range(3 * WAITING_LINES):
        speaker.say(f"{number:05d}" + "x" * 4000)
    dropped = speaker.dropped
    assert dropped > WAITING_LINES
    heard = _all_to(b"nothing took them.\n", reading)
    assert f"{dropped} lines before this one are missing".encode() in heard
    speaker.say("The show goes on.")
    speaker.close()
    assert _all_to(b"on.\n", reading) == b"The show goes on.\n"


def test_the_page_still_gets_the_lines_when_the_terminal_is_gone(
    tmp_path: Path, pipe: tuple[FileIO, int]
) -> None:
    reading, writing = pipe
    reading.close()
    speaker = LogWriter(writing)
    speaker.keep_in(tmp_path / "said")
    for line in ("The show begins.", "The show goes on."):
        speaker.say(line)
    speaker.close()
    _ended()
    kept = (tmp_path / "said").read_text().splitlines()
    assert [line.partition(" ")[2] for line in kept] == ["The show begins.", "The show goes on."]


def test_the_tick_hands_a_line_over_without_a_lock(pipe: tuple[FileIO, int]) -> None:
    """It would wait for a thread that may not run for long: one that is not real-time, and holds the lock."""
    reading, writing = pipe
    speaker = LogWriter(writing)
    locks: list[str] = []
    kinds = (type(threading.Lock()), type(threading.RLock()))

    def note(frame: FrameType, event: str, called: Any) -> None:
        if event == "c_call" and isinstance(getattr(called, "__self__", None), kinds):
            locks.append(called.__name__)

    sys.setprofile(note)
    try:
        speaker.say("A line.")
    finally:
        sys.setprofile(None)
    assert locks == []
    speaker.close()
    assert _all_to(b"\n", reading) == b"A line.\n"
