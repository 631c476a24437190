"""The speaker: lines for people come out, whatever is in them and whoever reads them."""

from __future__ import annotations

import fcntl
import os
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import Any

from appliance.box.log_writer import WAITING_LINES, LogWriter


def test_a_name_that_is_no_text_does_not_silence_what_follows() -> None:
    reading, writing = os.pipe()
    speaker = LogWriter(writing)
    speaker.say(os.fsdecode(b"caf\xe9.bvh"))
    speaker.say("The show goes on.")
    speaker.close()
    os.close(writing)
    assert os.read(reading, 1000) == b"caf\\udce9.bvh\nThe show goes on.\n"
    os.close(reading)


def test_a_reader_that_takes_nothing_holds_nobody_up() -> None:
    """The pipe holds some 60 lines of these, and the queue WAITING_LINES: all others are dropped, at once."""
    reading, writing = os.pipe()
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
    os.close(reading)
    os.close(writing)


def test_what_was_dropped_is_counted_and_told_once_lines_are_taken_again() -> None:
    reading, writing = os.pipe()
    speaker = LogWriter(writing)
    for number in range(3 * WAITING_LINES):
        speaker.say(f"{number:05d}" + "x" * 4000)
    dropped, heard = speaker.dropped, b""
    assert dropped > WAITING_LINES
    while b"missing" not in heard:
        heard += os.read(reading, 1 << 16)
    assert f"{dropped} lines before this one are missing".encode() in heard
    speaker.say("The show goes on.")
    speaker.close()
    os.close(writing)
    while more := os.read(reading, 1 << 16):
        heard += more
    assert heard.endswith(b"The show goes on.\n") and heard.count(b"missing") == 1
    os.close(reading)


def test_the_page_still_gets_the_lines_when_the_terminal_is_gone(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    speaker = LogWriter(writing)
    speaker.keep_in(tmp_path / "said")
    for line in ("The show begins.", "The show goes on."):
        speaker.say(line)
    speaker.close()
    os.close(writing)
    kept = (tmp_path / "said").read_text().splitlines()
    assert [line.partition(" ")[2] for line in kept] == ["The show begins.", "The show goes on."]


def test_the_tick_hands_a_line_over_without_a_lock() -> None:
    """It would wait for a thread that may not run for long: one that is not real-time, and holds the lock."""
    reading, writing = os.pipe()
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
    assert os.read(reading, 100) == b"A line.\n"
    os.close(writing)
    os.close(reading)
