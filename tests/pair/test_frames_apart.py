"""Two boxes that draw one dance: how far apart the same frame is. The null: two boxes that are no pair.

`python -m tests.pair.test_frames_apart 60` prints the figures.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from appliance.outputs.frame_reader import FrameReader
from tests.bundles import write_show
from tests.pair.hall import AHEAD_S, FIRST, SECOND, Hall, before_others
from tests.system.namespace import why_not

pytestmark = pytest.mark.skipif(bool(missing := why_not()), reason=str(missing))
_LOOK_S = 0.001
_MOST = 8  # frames in one look


class Apart(NamedTuple):
    """ticks: that both danced in time; same: of these, bit for bit; ms: how much later the second one was.

    frames: how many ticks the first was ahead, looked at every millisecond.
    """

    ticks: int
    same: int
    ms: npt.NDArray[np.float64]
    frames: Counter[int]

    @property
    def within_one(self) -> float:
        """Share of the time in which both show the same frame or neighbours."""
        return sum(count for apart, count in self.frames.items() if abs(apart) <= 1) / self.frames.total()

    def reported(self) -> str:
        reported = f"{self.ticks} ticks on both, {self.same} the same bit for bit; "
        if self.ticks:
            median, nearly_all, most = np.percentile(np.abs(self.ms), [50, 99, 100])
            reported += f"apart by {median:.1f} ms (median), {nearly_all:.1f} (99 %), {most:.1f} (most); "
        return f"{reported}frames apart, looks: {dict(sorted(self.frames.items()))}"


def measured(folder: Path, seconds: float, paired: bool) -> Apart:
    """The shared frames of both boxes, which their projectors draw, looked at every millisecond."""
    show = write_show(folder / "show", [])
    with Hall(folder, show, relayed=False, paired=paired) as hall:
        for address in (FIRST, SECOND):
            hall.switch_on(address).await_output("Hz")  # the first line about the dance
        if paired:
            hall.await_pair()
        return _watched(hall, seconds)


def _watched(hall: Hall, seconds: float) -> Apart:
    came: dict[str, dict[int, tuple[float, bytes]]] = {FIRST: {}, SECOND: {}}
    newest, frames = dict.fromkeys((FIRST, SECOND), -1), Counter[int]()
    with ExitStack() as opened, before_others():
        readers = {
            one: FrameReader(hall.boxes[one].runtime, partial(_clock_of, one)) for one in (FIRST, SECOND)
        }
        for reader in readers.values():
            opened.callback(reader.close)
        ends_at = time.monotonic() + seconds
        while (now := time.monotonic()) < ends_at:
            for one, reader in readers.items():
                for frame in reader.frames(_MOST if newest[one] >= 0 else 1, _clock_of(one)):
                    if frame.tick > newest[one]:
                        newest[one] = frame.tick
                        pose = b"".join(puppet.pose.tobytes() for puppet in frame.puppets)
                        if not frame.late:  # such a one shows the pose before it once more
                            came[one][frame.tick] = now, pose
            frames[newest[FIRST] - newest[SECOND]] += min(newest.values()) >= 0
            time.sleep(_LOOK_S)
    pairs = [(came[FIRST][tick], came[SECOND][tick]) for tick in came[FIRST].keys() & came[SECOND].keys()]
    late_ms = np.array([1000.0 * (second[0] - first[0]) for first, second in pairs])
    return Apart(len(pairs), sum(first[1] == second[1] for first, second in pairs), late_ms, +frames)


def _clock_of(box: str) -> float:
    return time.monotonic() + AHEAD_S[box]


def test_a_pair_shows_one_dance_at_most_a_frame_apart(tmp_path: Path) -> None:
    """Nearly all, for a machine that tests more beside this; and never a frame that is another one."""
    (tmp_path / "paired").mkdir()
    (tmp_path / "alone").mkdir()
    together = measured(tmp_path / "paired", 6.0, paired=True)
    assert together.ticks > 200 and together.same == together.ticks, together.reported()
    assert together.within_one > 0.98, together.reported()
    alone = measured(tmp_path / "alone", 1.0, paired=False)
    assert alone.within_one == 0.0, alone.reported()


if __name__ == "__main__":
    for is_paired in (True, False):
        with tempfile.TemporaryDirectory() as made:
            print("a pair: " if is_paired else "alone:  ", end="", flush=True)
            print(measured(Path(made), float(sys.argv[1]), is_paired).reported())
