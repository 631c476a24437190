"""Neither a flood of commands nor an output that nobody reads holds up the real box or its panic."""

from __future__ import annotations

import contextlib
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.recorder.reading import read_journal
from hw_sim.peers import free_ports
from tests.show_control.doubles import Asker
from tests.system.box import JOURNAL, PLAY, playing
from tests.system.desk import answers, asking
from tests.system.processes import PATIENCE_S, wait_until

pytestmark = pytest.mark.realtime


def test_a_flood_does_not_touch_the_dance(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, settings=JOURNAL) as box, asking(box):
        flood = Asker(box.control)
        before = box.frames(1)[0][0]
        for number in range(20_000):
            flood.tell(*(("/player/jump", 0.5), ("/iterations", 3, 2), ("/nonsense",))[number % 3])
        frames = box.frames(50)
        wait_until(lambda: answers(box.control))
        assert box.end() == 0
        flood.close()
    numbers = [frame[0] for frame in frames]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > before
    ticks = read_journal(tmp_path / "run.journal").ticks
    assert float(np.median(ticks["sections_ms"].sum(axis=1))) < 20.0
    assert "refused, the last one" in box.output
    assert "Traceback" not in box.output


def test_a_full_pipe_at_the_output_blocks_no_panic(show: Path, tmp_path: Path) -> None:
    """The reader of the box's output may stop reading."""
    reading, writing = os.pipe()
    [port] = free_ports(1)
    (tmp_path / "box.yaml").write_text(yaml.safe_dump({"runtime": "runtime", "control": {"port": port}}))
    command = [*PLAY, "--show", str(show), "--box", str(tmp_path / "box.yaml")]
    unread = b"x" * 4096
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, unread)
    os.set_blocking(writing, True)
    running = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=writing, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: answers(port))
        asker = Asker(port)
        assert asker.ask("/panic")[2] == 1
        asker.close()
        running.terminate()
        assert running.wait(PATIENCE_S) == 0
    finally:
        running.kill()
        running.wait()
        os.close(reading)
        os.close(writing)
