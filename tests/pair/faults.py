"""Random faults of a pair in a hall, and what each of them cost on each output.

python -m tests.pair.faults --faults 1000 --seed 1 --out pair.jsonl
python -m tests.pair.faults --read pair.jsonl
python -m tests.pair.faults --null 20

The null product is a second box that knows nothing of the first: it is switched on once the first is dead.
"""

from __future__ import annotations

import argparse
import itertools
import json
import random
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from appliance.sensor.keys import create_keys
from tests.bundles import write_show
from tests.pair.hall import FIRST, SECOND, Hall, HallRadio, other
from tests.system.lit import RIG
from tests.system.processes import wait_until
from tests.system.wearables import Wearables

WATCHED_S = 0.8  # after a fault, and after it is over
TAKEN_S = 0.4  # a takeover is over by then
LIMITS = {
    "osc_lost": 1,
    "osc_twice": 0,
    "psn_lost": 1,
    "dmx_gap_ms": 100.0,
    "overlap_ms": 100.0,
    "dmx_overlap_ms": 100.0,
    "jump_degrees": 1.0,
    "needless": 0,
    "flaps": 0,
}
Undo = Callable[[], None]


def kill_stage(hall: Hall, leader: str) -> Undo:
    hall.boxes[leader].process.send_signal(signal.SIGKILL)
    return lambda: renew(hall, leader)


def cut_power(hall: Hall, leader: str) -> Undo:
    hall.boxes[leader].cut_power()
    return lambda: renew(hall, leader)


def hang(hall: Hall, leader: str) -> Undo:
    hall.boxes[leader].process.send_signal(signal.SIGSTOP)
    return lambda: hall.boxes[leader].process.send_signal(signal.SIGCONT)


def hang_all(hall: Hall, leader: str) -> Undo:
    hall.boxes[leader].signal(signal.SIGSTOP)
    return lambda: hall.boxes[leader].signal(signal.SIGCONT)


def pull_cable(hall: Hall, leader: str) -> Undo:
    hall.pull_cable(leader)
    return lambda: hall.plug_cable(leader)


def pull_cable_for_long(hall: Hall, leader: str) -> Undo:
    undo = pull_cable(hall, leader)
    hall.forget(leader)
    return undo


def lose(hall: Hall, leader: str) -> Undo:
    hall.relay.set(loss=0.2, jitter_s=0.004)
    return hall.relay.set


def delay(hall: Hall, leader: str) -> Undo:
    hall.relay.set(delay_s=0.004, jitter_s=0.012)
    return hall.relay.set


def follower_dies(hall: Hall, leader: str) -> Undo:
    return cut_power(hall, other(leader))


def follower_hangs(hall: Hall, leader: str) -> Undo:
    return hang_all(hall, other(leader))


def follower_cable(hall: Hall, leader: str) -> Undo:
    return pull_cable(hall, other(leader))


def nothing(hall: Hall, leader: str) -> Undo:
    return lambda: None


TAKEOVERS = (kill_stage, cut_power, hang, hang_all, pull_cable, pull_cable_for_long)
FAULTS = (*TAKEOVERS, lose, delay, follower_dies, follower_hangs, follower_cable, nothing)


def renew(hall: Hall, address: str) -> None:
    hall.boxes[address].cut_power()
    hall.switch_on(address)


def lost_in(hall: Hall, since: float, until: float) -> dict[str, float]:
    """What came in a span of wall-clock seconds: frames lost in a row, longest gaps, overlaps, jumps."""
    seen = hall.seen
    osc, psn, sacn = (
        [one for one in list(came) if since <= one[0] <= until] for came in (seen.osc, seen.psn, seen.sacn)
    )
    steps = [b - a for a, b in itertools.pairwise(arguments[0] for _, _, arguments in osc)]
    lost = max([0, *(step - 1 for step in steps)])
    return {
        "osc_lost": lost,
        "osc_twice": sum(step <= 0 for step in steps),
        "osc_gap_ms": _longest([one[0] for one in osc]),
        "psn_lost": _frames(_longest([one[0] for one in psn])),
        "dmx_gap_ms": _longest([one[0] for one in sacn]),
        "overlap_ms": _overlap([one[:2] for one in osc]),
        "dmx_overlap_ms": _overlap([one[:2] for one in sacn]),
        "reading_gap_ms": _longest(
            [after[0] for before, after in itertools.pairwise(osc) if before[2][2] != after[2][2]]
        ),
        "jump_degrees": _jump(seen.poses(since, until), lost),
    }


def _longest(times: list[float]) -> float:
    return 1000.0 * max([0.0, *(b - a for a, b in itertools.pairwise(times))])


def _frames(gap_ms: float) -> int:
    """Frames that are missing in a gap: each leaves less than a period after its deadline."""
    return max(0, int((gap_ms + 2.0) / 20.0) - 1)


def _overlap(arrivals: list[tuple[float, str]]) -> float:
    """Longest time in which two boxes spoke in turn, ms: from a change of the box to one back in 0.15 s."""
    changes = [at for (_, before), (at, box) in itertools.pairwise(arrivals) if before != box]
    longest = span = 0.0
    for before, at in itertools.pairwise(changes):
        span = span + at - before if at - before < 0.15 else 0.0
        longest = max(longest, span)
    return 1000.0 * longest


def _jump(poses: list[Any], lost: int) -> float:
    """Largest turn of a joint from the last frame of the one box to the first of the other, degrees, beyond
    its largest turn in the three frames before and after (one of them may be late, so a repeat), for each
    frame that has passed.
    """
    tracks: dict[str, list[tuple[str, Any]]] = defaultdict(list)
    for _, box, address, quaternion in poses:
        tracks[address].append((box, np.array(quaternion)))
    worst = 0.0
    for track in tracks.values():
        turns = [_turn(a, b) for (_, a), (_, b) in itertools.pairwise(track)]
        for place, ((before, _), (after, _)) in enumerate(itertools.pairwise(track)):
            if before != after:
                near = max([0.0, *turns[max(0, place - 3) : place], *turns[place + 1 : place + 4]])
                worst = max(worst, turns[place] - (1 + min(lost, 5)) * near)
    return worst


def _turn(a: Any, b: Any) -> float:
    chord = min(np.linalg.norm(a - b), np.linalg.norm(a + b))
    return float(np.degrees(4 * np.arcsin(min(1.0, chord / 2))))


@contextmanager
def staged(folder: Path, **more: Any) -> Iterator[tuple[Hall, Wearables]]:
    """A hall with both boxes' show: a hand that a wearable holds, lights by sACN."""
    (key,) = create_keys(folder / "sensors.keys", ["left-wrist"]).values()
    show = write_show(folder / "show", lights=RIG)
    dmx = [{"wire": "sacn", "universe": 1}]
    with (
        Hall(folder, show, outputs={"dmx": dmx}, **more) as hall,
        Wearables([key], radio=lambda: HallRadio(hall.hall)) as worn,
    ):
        yield hall, worn


def random_faults(
    count: int, seed: int, folder: Path, names: Sequence[str], seconds: float
) -> Iterator[dict[str, Any]]:
    """What each fault has cost, until `count` or for `seconds`."""
    rng = random.Random(seed)
    faults = [one for one in FAULTS if not names or one.__name__ in names]
    ends_at = time.monotonic() + seconds
    with staged(folder) as (hall, worn):
        hall.switch_on(FIRST), hall.switch_on(SECOND)
        hall.await_whole()
        worn.dance()
        for _ in range(count):
            if time.monotonic() > ends_at:
                return
            hall.await_whole()
            time.sleep(1.0 + rng.random())  # anywhere in a tick
            yield one_fault(hall, rng.choice(faults))
            hall.seen.clear()


def one_fault(hall: Hall, fault: Callable[[Hall, str], Undo]) -> dict[str, Any]:
    """Begin it, end it, and look at all that came meanwhile."""
    leader, before, since = hall.leader, hall.epoch, time.time() - 0.3
    waited = {address: box.waited_ms() for address, box in hall.boxes.items()}
    undo = fault(hall, leader)
    time.sleep(TAKEN_S)
    held_up = [
        {name: ms - waited[address].get(name, ms) for name, ms in box.waited_ms().items()}
        for address, box in hall.boxes.items()
    ]
    time.sleep(WATCHED_S - TAKEN_S)
    undo()
    time.sleep(WATCHED_S)
    until = time.time()
    wait_until(lambda: hall.seen.psn and hall.seen.psn[-1][0] > until, "nobody speaks")
    found = lost_in(hall, since, until)
    hall.await_pair()
    changes, wanted = hall.epoch - before, int(fault in TAKEOVERS)
    return {
        "fault": fault.__name__,
        **{name: round(value, 1) for name, value in found.items()},
        "changes": changes,
        "needless": max(0, changes) if not wanted else 0,
        "flaps": max(0, changes - 1),
        "stage_waited_ms": round(max(one.get("stage", 0.0) for one in held_up), 1),
        "lights_waited_ms": round(max(one.get("lights", 0.0) for one in held_up), 1),
    }


def null(count: int, folder: Path) -> Iterator[dict[str, Any]]:
    """One box dies, and another one, that knows nothing of it, is switched on in the same moment."""
    with staged(folder, paired=False) as (hall, worn):
        leader = FIRST
        hall.switch_on(leader)
        worn.dance()
        for _ in range(count):
            wait_until(lambda: hall.seen.sacn and hall.seen.osc, "nobody speaks")
            time.sleep(2.0)
            since = time.time() - 0.3
            hall.boxes[leader].cut_power()
            leader = other(leader)
            hall.seen.clear()
            hall.switch_on(leader)
            wait_until(lambda: hall.seen.osc[-1][1] == hall.seen.sacn[-1][1] == leader, "nobody speaks")  # noqa: B023
            time.sleep(0.1)
            found = lost_in(hall, since, time.time())
            found["osc_lost"] = _frames(found["osc_gap_ms"])
            yield {"fault": "null", **{name: round(value, 1) for name, value in found.items()}}


def histogram(results: Sequence[dict[str, Any]]) -> Iterator[str]:
    """For each kind of fault: how often, and of each figure the values with how often each came."""
    kinds = defaultdict(list)
    for one in results:
        kinds[one["fault"]].append(one)
    for name, ones in sorted(kinds.items()):
        yield f"{name}: {len(ones)}"
        for key in ones[0].keys() - {"fault", "changes"}:
            values = sorted(one[key] for one in ones)
            if all(value == int(value) for value in values) and values[-1] < 100:
                shown = ", ".join(f"{value:g}: {times}" for value, times in sorted(Counter(values).items()))
            else:
                shown = " / ".join(f"{values[int(part * (len(values) - 1))]:g}" for part in (0, 0.5, 0.95, 1))
            beyond = sum(value > LIMITS[key] for value in values) if key in LIMITS else 0
            yield f"  {key}: {shown}" + (f"   beyond {LIMITS[key]:g}: {beyond}" if beyond else "")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--faults", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=600.0, help="end after so many, if not before")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[], choices=[one.__name__ for one in FAULTS])
    parser.add_argument("--null", type=int, default=0)
    parser.add_argument("--out", type=Path, help="one line of JSON for each fault, appended")
    parser.add_argument("--read", type=Path)
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # its boxes and networks end with it
    results = [json.loads(line) for line in given.read.read_text().splitlines()] if given.read else []
    with tempfile.TemporaryDirectory(prefix="pair-") as name:
        folder = Path(name)
        found = (
            null(given.null, folder)
            if given.null
            else random_faults(given.faults, given.seed, folder, given.only, 60.0 * given.minutes)
        )
        for one in found:
            results.append(one)
            print(len(results), json.dumps(one), flush=True)
            if given.out:
                with given.out.open("a") as out:
                    out.write(json.dumps(one) + "\n")
    print("\n".join(histogram(results)))


if __name__ == "__main__":
    main()
