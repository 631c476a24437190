"""The flight recorder keeps what was danced through a kill, in bounded memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from appliance.pose.skeleton import Skeleton
from appliance.stage.journal import Journal, JournalError, read_journal

FIGURE = Skeleton(
    ("Hips", "Chest", "Arm"),
    (-1, 0, 1),
    np.array([[0, 0, 0], [0, 0.5, 0], [0.2, 0, 0]], float),
    ((2, (0.3, 0, 0)),),
)
HANDS = [{"joint": "Arm", "kind": "sensor", "name": "left-wrist"}]

LONG_FIGURE = Skeleton(
    tuple(f"joint{number}" for number in range(200)), tuple(range(-1, 199)), np.ones((200, 3))
)

KILLED = """
import os, signal, sys
from pathlib import Path
from tests.stage.test_journal import FIGURE, HANDS, write_ticks
from appliance.stage.journal import Journal
journal = Journal(Path(sys.argv[1]), FIGURE, HANDS, minutes=1.0)
write_ticks(journal, range(700))
journal.field["tick"][journal.row] = 700  # torn: killed before the record was complete
os.kill(os.getpid(), signal.SIGKILL)
"""


def write_ticks(journal: Journal, ticks: range) -> None:
    for tick in ticks:
        row = journal.row
        journal.field["tick"][row] = tick
        journal.field["pose"][row] = tick
        journal.field["root"][row] = (tick, 1.0, 2.0)
        journal.commit()


def test_reads_back_every_tick_and_the_figure(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "night.journal", FIGURE, HANDS, minutes=1.0)
    write_ticks(journal, range(100))
    journal.close()
    recording = read_journal(tmp_path / "night.journal")
    assert recording.ticks["tick"].tolist() == list(range(100))
    assert recording.ticks["root"][7].tolist() == [7.0, 1.0, 2.0]
    assert recording.header["hands"] == HANDS
    assert recording.skeleton.same_joints(FIGURE)
    assert recording.skeleton.ends == FIGURE.ends
    np.testing.assert_allclose(recording.skeleton.offsets, FIGURE.offsets)


def test_survives_a_kill_and_leaves_the_torn_record_out(tmp_path: Path) -> None:
    path = tmp_path / "night.journal"
    killed = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert read_journal(path).ticks["tick"].tolist() == list(range(700))


def test_the_ring_keeps_the_newest_ticks_in_order(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "night.journal", FIGURE, HANDS, minutes=0.2)
    assert journal.capacity == 600
    write_ticks(journal, range(1500))
    journal.close()
    assert read_journal(tmp_path / "night.journal").ticks["tick"].tolist() == list(range(900, 1500))


LONG_NIGHT = """
import sys
from pathlib import Path
from tests.stage.test_journal import LONG_FIGURE, resident_bytes, write_ticks
from appliance.stage.journal import Journal
from appliance.stage.realtime import enter_realtime
journal = Journal(Path(sys.argv[1]), LONG_FIGURE, [], minutes=4.0)  # 12,000 ticks, 39 MB
enter_realtime(10)
journal.unlock()
write_ticks(journal, range(1100))
before = resident_bytes()
write_ticks(journal, range(1100, 11000))
print(resident_bytes() - before)
"""


def test_a_long_night_does_not_stay_in_memory_even_where_memory_is_locked(tmp_path: Path) -> None:
    command = [sys.executable, "-c", LONG_NIGHT, str(tmp_path / "night.journal")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 6_000_000


def resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def test_a_place_that_cannot_be_written_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match=r"no journal \(No such file or directory; it needs .* MB\).*Free"):
        Journal(tmp_path / "absent" / "night.journal", FIGURE, HANDS, minutes=1.0)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_found_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="no journal"):
        Journal(Path("/dev/full"), FIGURE, HANDS, minutes=1.0)


@pytest.mark.parametrize(
    "content",
    [b"", b"bunraku journal 1\n", b"PK\x03\x04" * 40000, b"bunraku journal 1\n{torn".ljust(70000, b"\0")],
)
def test_what_is_no_journal_is_refused_in_words(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "odd.journal"
    path.write_bytes(content)
    with pytest.raises(JournalError, match=r"not a journal|damaged"):
        read_journal(path)


def test_an_absent_journal_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="cannot be read"):
        read_journal(tmp_path / "absent.journal")
