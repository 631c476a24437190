"""Random faults of a pair in a hall, and what each of them cost on each output.

python -m tests.pair.faults 50 --seed 1 --out out/pair.json
"""

from __future__ import annotations

import itertools
import json
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from appliance.sensor.keys import create_keys
from tests.bundles import write_show
from tests.pair.hall import FIRST, SECOND, Hall
from tests.system.lit import RIG
from tests.system.processes import wait_until

SPLIT_S = 0.1
WATCHED_S = 1.2
DMX: list[dict[str, Any]] = [{"wire": "sacn", "universe": 1}]


def other(address: str) -> str:
    return SECOND if address == FIRST else FIRST


def kill_stage(hall: Hall, leader: str) -> Callable[[], None]:
    hall.boxes[leader].process.send_signal(signal.SIGKILL)
    return lambda: renew(hall, leader)


def cut_power(hall: Hall, leader: str) -> Callable[[], None]:
    hall.boxes[leader].cut_power()
    return lambda: renew(hall, leader)


def hang(hall: Hall, leader: str) -> Callable[[], None]:
    hall.boxes[leader].process.send_signal(signal.SIGSTOP)
    return lambda: hall.boxes[leader].process.send_signal(signal.SIGCONT)


def hang_all(hall: Hall, leader: str) -> Callable[[], None]:
    hall.boxes[leader].signal(signal.SIGSTOP)
    return lambda: hall.boxes[leader].signal(signal.SIGCONT)


def pull_cable(hall: Hall, leader: str) -> Callable[[], None]:
    hall.pull_cable(leader)
    return lambda: hall.plug_cable(leader)


def lose(hall: Hall, leader: str) -> Callable[[], None]:
    hall.relay.set(loss=0.2, jitter_s=0.004)
    return hall.relay.set


def delay(hall: Hall, leader: str) -> Callable[[], None]:
    hall.relay.set(delay_s=0.004, jitter_s=0.012)
    return hall.relay.set


def follower_dies(hall: Hall, leader: str) -> Callable[[], None]:
    hall.boxes[other(leader)].cut_power()
    return lambda: renew(hall, other(leader))


def follower_hangs(hall: Hall, leader: str) -> Callable[[], None]:
    hall.boxes[other(leader)].signal(signal.SIGSTOP)
    return lambda: hall.boxes[other(leader)].signal(signal.SIGCONT)


def nothing(hall: Hall, leader: str) -> Callable[[], None]:
    return lambda: None


FAULTS = (
    nothing,
    kill_stage,
    cut_power,
    hang,
    hang_all,
    pull_cable,
    lose,
    delay,
    follower_dies,
    follower_hangs,
)


def renew(hall: Hall, address: str) -> None:
    box = hall.boxes[address]
    box.cut_power()
    hall.switch_on(address)


def lost_in(hall: Hall, since: float, until: float) -> dict[str, float]:
    """What came in a span of wall-clock seconds: frames that were lost, the longest gaps, overlaps."""
    seen = hall.seen
    osc = [one for one in list(seen.osc) if since <= one[0] <= until]
    ticks = [arguments[0] for _, _, arguments in osc]
    steps = [b - a for a, b in itertools.pairwise(ticks)]
    found = {
        "osc_lost": max([0, *(step - 1 for step in steps)]),
        "osc_twice": sum(step <= 0 for step in steps),
        "osc_gap_ms": _gap([one[0] for one in osc]),
        "psn_gap_ms": _gap([one[0] for one in list(seen.psn) if since <= one[0] <= until]),
        "overlap_ms": _overlap([one[:2] for one in osc]),
    }
    sacn = [one for one in list(seen.sacn) if since <= one[0] <= until]
    if sacn:
        changes = [b[0] - a[0] for a, b in itertools.pairwise(sacn) if a[1] != b[1]]
        found["dmx_taken_ms"] = 1000.0 * max([0.0, *changes])  # unchanged levels repeat once in 0.85 s
        found["dmx_overlap_ms"] = _overlap([one[:2] for one in sacn])
    found["jump_degrees"] = _jump(seen.poses(since, until), int(found["osc_lost"]))
    return found


def _gap(times: list[float]) -> float:
    return 1000.0 * max([0.0, *(b - a for a, b in itertools.pairwise(times))])


def _overlap(arrivals: list[tuple[float, str]]) -> float:
    """Longest time in which two boxes spoke in turn, ms: from a change of the box to one back in 0.15 s."""
    changes = [at for (_, before), (at, box) in itertools.pairwise(arrivals) if before != box]
    longest = span = 0.0
    for before, at in itertools.pairwise(changes):
        span = span + at - before if at - before < 0.15 else 0.0
        longest = max(longest, span)
    return 1000.0 * longest


def _jump(poses: list[Any], lost: int) -> float:
    """Largest turn of a joint from one frame to the next where the box changed, degrees, beyond the largest
    that the same joint made elsewhere in the frames that have passed.
    """
    import numpy as np

    usual: dict[str, float] = {}
    changed: dict[str, float] = {}
    before: dict[str, Any] = {}
    for _, box, address, quaternion in poses:
        if (was := before.get(address)) is not None:
            a, b = np.array(was[1]), np.array(quaternion)
            chord = min(np.linalg.norm(a - b), np.linalg.norm(a + b))
            found = usual if was[0] == box else changed
            found[address] = max(
                found.get(address, 0.0), float(np.degrees(4 * np.arcsin(min(1.0, chord / 2))))
            )
        before[address] = box, quaternion
    return max([0.0, *(turn - (1 + lost) * usual.get(address, 0.0) for address, turn in changed.items())])


def run(count: int, seed: int, folder: Path, names: list[str]) -> list[dict[str, Any]]:
    rng, results = random.Random(seed), []
    faults = [one for one in FAULTS if not names or one.__name__ in names]
    create_keys(folder / "sensors.keys", ["left-wrist"])
    show = write_show(folder / "show", [], lights=RIG)
    dmx = [{"wire": "sacn", "universe": 1, "interface": "INTERFACE"}]
    with Hall(folder, show, outputs={"dmx": dmx}) as hall:
        hall.switch_on(FIRST), hall.switch_on(SECOND)
        for number in range(count):
            hall.await_pair()
            fault = rng.choice(faults)
            time.sleep(1.0 + rng.random())  # anywhere in a tick
            leader, since = hall.leader, time.time() - 0.3
            undo = fault(hall, leader)
            time.sleep(WATCHED_S)
            undo()
            time.sleep(WATCHED_S)
            until = time.time()
            wait_until(lambda: hall.seen.psn and hall.seen.psn[-1][0] > until, "nobody speaks")  # noqa: B023
            found = lost_in(hall, since, until)
            results.append({"fault": fault.__name__, "led": leader == hall.leader, **found})
            print(number, json.dumps(results[-1]), flush=True)
            if "--trace" in sys.argv and (found["osc_lost"] > 1 or found["osc_twice"]):
                for address, box in hall.boxes.items():
                    print(
                        address, "\n".join(one for one in box.output.splitlines()[-40:] if "This box" in one)
                    )
            hall.seen.clear()
        if "--words" in sys.argv:
            for box in hall.boxes.values():
                print(box.output)
    return results


def histogram(results: list[dict[str, Any]]) -> str:
    by_fault: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for one in results:
        by_fault[one["fault"]].append(one)
    lines = []
    for name, ones in sorted(by_fault.items()):
        lost = Counter(one["osc_lost"] for one in ones)
        worst = {key: max(one.get(key, 0) for one in ones) for key in ones[0] if key not in ("fault", "led")}
        frames = ", ".join(f"{frames}: {times}" for frames, times in sorted(lost.items()))
        lines.append(
            f"{name} x {len(ones)}: frames lost at once {{{frames}}}; worst "
            + str({k: round(v, 1) for k, v in worst.items()})
        )
    return "\n".join(lines)


def main() -> None:
    import argparse

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--trace", action="store_true")
    parser.add_argument("--words", action="store_true")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="pair-"))
    try:
        results = run(given.count, given.seed, folder, given.only)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(histogram(results))
    if given.out:
        given.out.write_text(json.dumps(results))


if __name__ == "__main__":
    main()
