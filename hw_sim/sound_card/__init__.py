"""A sound card whose clock can be read: what it plays, and when. It is put in place by `environment`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HEAD = 4  # numbers ahead of each block's samples: when it plays, frames, rate, came too late
LOG = "BUNRAKU_EMULATED_CARD_LOG"
folder = Path(__file__).parent


class Played(NamedTuple):
    """Output of a card: the samples (N,) of all loudspeakers added, each with the monotonic second at which
    the card's clock plays it (N,). late: blocks that came too late and were replaced by silence."""

    at: NDArray[np.float64]
    samples: NDArray[np.float64]
    late: int = 0


def environment(log: Path) -> dict[str, str]:
    """The environment of a process whose sound card is this one."""
    path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path, LOG: str(log)}


def read_played(log: Path) -> Played:
    """Reads the log of a card. Raises OSError; ValueError when it played nothing."""
    written, times, samples, late, place = np.fromfile(log, np.float64), [], [], 0, 0
    while place + HEAD <= len(written):
        plays_at, frames, rate, was_late = written[place : place + HEAD]
        block = written[place + HEAD : place + HEAD + int(frames)]
        times.append(plays_at + np.arange(len(block)) / rate)
        samples.append(block)
        late, place = late + int(was_late), place + HEAD + int(frames)
    if not times:
        raise ValueError("The sound card played nothing.")
    return Played(np.concatenate(times), np.concatenate(samples), late)
