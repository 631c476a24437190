"""Two boxes that draw one dance: how far apart the same frame is. The null: two boxes that are no pair.

`python -m tests.pair.test_frames_apart 60` prints the figures.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from appliance.box.clock import TICK_S
from appliance.outputs.frame_reader import FrameReader
from tests.bundles import write_show
from tests.pair.hall import AHEAD_S, FIRST, SECOND, Hall
from tests.system.namespace import why_not

pytestmark = pytest.mark.skipif(bool(missing := why_not()), reason=str(missing))
_LOOK_S = 0.001
_MOST = 40  # frames; the shared frame keeps fewer


class Apart(NamedTuple):
    """Of the ticks that both boxes shared: when the second had it after the first, and whether bit for bit."""

    ms: npt.NDArray[np.float64]
    same: int

    def told(self) -> str:
        frames = Counter(np.ceil(np.abs(self.ms) / (1000.0 * TICK_S)).astype(int).tolist())
        median, most = np.median(self.ms), np.abs(self.ms).max()
        return (
            f"{len(self.ms)} ticks, {self.same} the same bit for bit; the second one later by {median:.1f} ms "
            f"(median), {np.percentile(np.abs(self.ms), 99):.1f} (99 %), {most:.1f} (most); frames apart: "
            f"{dict(sorted(frames.items()))}"
        )


def measured(folder: Path, seconds: float, paired: bool) -> Apart:
    """The shared frames of both boxes, which their projectors draw, looked at every millisecond."""
    show = write_show(folder / "show", [])
    with Hall(folder, show, relayed=False, paired=paired) as hall:
        hall.switch_on(FIRST)
        hall.switch_on(SECOND)
        if paired:
            hall.await_pair()
        for box in hall.boxes.values():
            box.await_output("Hz")  # the first line about the dance
        return _watched(hall, seconds)


def _watched(hall: Hall, seconds: float) -> Apart:
    came: dict[str, dict[int, tuple[float, bytes]]] = {FIRST: {}, SECOND: {}}
    with ExitStack() as opened, _before_others():
        readers = {
            one: FrameReader(hall.boxes[one].runtime, partial(_clock_of, one)) for one in (FIRST, SECOND)
        }
        for reader in readers.values():
            opened.callback(reader.close)
        ends_at = time.monotonic() + seconds
        while (now := time.monotonic()) < ends_at:
            for one, reader in readers.items():
                newest = reader.newest(_clock_of(one))
                if newest is None or newest.tick in came[one]:
                    continue
                for frame in reader.frames(_MOST if came[one] else 1, _clock_of(one)):
                    pose = b"".join(puppet.pose.tobytes() for puppet in frame.puppets)
                    came[one].setdefault(frame.tick, (now, pose))
            time.sleep(_LOOK_S)
    both = sorted(came[FIRST].keys() & came[SECOND].keys())
    pairs = [(came[FIRST][tick], came[SECOND][tick]) for tick in both]
    return Apart(
        np.array([1000.0 * (second[0] - first[0]) for first, second in pairs]),
        sum(first[1] == second[1] for first, second in pairs),
    )


def _clock_of(box: str) -> float:
    return time.monotonic() + AHEAD_S[box]


@contextlib.contextmanager
def _before_others() -> Iterator[None]:
    """What comes is noted in time."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(85))
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def test_a_pair_shows_one_dance_at_most_a_frame_apart(tmp_path: Path) -> None:
    """Nearly all, for a machine that tests more beside this; and never a frame that is another one."""
    (tmp_path / "paired").mkdir()
    (tmp_path / "alone").mkdir()
    together = measured(tmp_path / "paired", 6.0, paired=True)
    assert len(together.ms) > 200 and together.same == len(together.ms), together.told()
    assert np.mean(np.abs(together.ms) <= 1000.0 * TICK_S) > 0.95, together.told()
    alone = measured(tmp_path / "alone", 3.0, paired=False)
    assert alone.same < len(alone.ms) / 2, alone.told()


if __name__ == "__main__":
    for is_paired in (True, False):
        with tempfile.TemporaryDirectory() as made:
            print("a pair: " if is_paired else "alone:  ", end="", flush=True)
            print(measured(Path(made), float(sys.argv[1]), is_paired).told())
