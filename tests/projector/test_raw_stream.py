"""Raw pictures through a pipe: whole, upright, the newest; a reader that is slow or gone holds nothing up."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from appliance.projector.raw_stream import RawStream
from tests.system.processes import BUNRAKU, run_bunraku

WITHIN_S = 60.0
SIZE = (64, 36)
BYTES = 4 * SIZE[0] * SIZE[1]


def wait_until(is_so: Callable[[], bool]) -> None:
    until = time.monotonic() + WITHIN_S
    while not is_so():
        assert time.monotonic() < until
        time.sleep(0.01)


def read(descriptor: int, count: int) -> bytes:
    found = b""
    while len(found) < count and (part := os.read(descriptor, count - len(found))):
        found += part
    return found


def test_pictures_come_whole_with_the_top_row_first() -> None:
    out, into = os.pipe()
    stream = RawStream(into)
    bottom_first = b"".join(bytes([row]) * 8 for row in range(3))
    stream.offer(bottom_first, (2, 3))
    assert read(out, 24) == b"".join(bytes([row]) * 8 for row in (2, 1, 0))
    stream.close()
    assert os.read(out, 1) == b"", "closed"
    os.close(out)


def test_a_slow_reader_gets_the_newest_picture_and_holds_nothing_up() -> None:
    out, into = os.pipe()
    stream, size = RawStream(into), (512, 512)
    began = time.process_time()
    stream.offer(bytes(4 * 512 * 512), size)
    first = read(out, 1)  # it is on its way
    for number in range(200):
        stream.offer(bytes([number]) * (4 * 512 * 512), size)
    assert stream.written == 0 and time.process_time() - began < WITHIN_S
    first += read(out, 4 * 512 * 512 - 1)
    last = read(out, 4 * 512 * 512)
    assert len(set(first)) == 1 and set(last) == {199}, "whole, and the newest"
    stream.close()
    os.close(out)


def test_a_reader_that_has_gone_is_noticed() -> None:
    out, into = os.pipe()
    stream = RawStream(into)
    os.close(out)
    stream.offer(bytes(BYTES), SIZE)
    wait_until(lambda: stream.is_closed)
    stream.close()


@pytest.mark.parametrize("how", ["reader gone", "stopped"])
def test_the_projector_writes_pictures_alone_and_ends_cleanly(tmp_path: Path, how: str) -> None:
    box = tmp_path / "box.yaml"
    box.write_text("runtime: run\n")
    command = [*BUNRAKU, "project", "--box", box, "--offscreen", "64x36", "--raw"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        pictures = read(process.stdout.fileno(), 3 * BYTES)
        assert len(pictures) == 3 * BYTES
        assert not any(pictures[at] for at in range(0, len(pictures), 4)), "no stage: black, and no words"
        if how == "stopped":
            process.send_signal(signal.SIGTERM)
            while read(process.stdout.fileno(), BYTES):
                pass
        else:
            process.stdout.close()
        output = process.stderr.read().decode()
        assert process.wait(WITHIN_S) == 0, output
    assert "The picture is 64x36" in output and "Traceback" not in output


def test_raw_pictures_need_a_size() -> None:
    done = run_bunraku("project", "--raw")
    assert done.returncode != 0 and "--offscreen" in done.stderr
