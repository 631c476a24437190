"""Three real boxes in step: each sends the same frames to its own receiver, at most one frame apart.

The null: three boxes that know nothing of each other. `python -m tests.pair.test_locked 60` prints figures.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from appliance.pose import quaternion
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from hw_sim.osc_receiver import decode
from hw_sim.peers import free_ports
from tests.bundles import write_show
from tests.pair.hall import FIRST, HALL, KEY, SECOND, Hall, before_others
from tests.show_control.doubles import Asker
from tests.system.box import Box, playing
from tests.system.namespace import why_not
from tests.system.processes import run_bunraku, wait_until

FRAME_MS = 20.0
ADDRESSES = ("127.0.0.1", "127.0.0.2", "127.0.0.3")


class InStep(NamedTuple):
    """ticks: that all sent in time; same: of these, with the same joints bit for bit; apart_ms: of each, from
    the first box's datagram to the last one's.
    """

    ticks: int
    same: int
    apart_ms: Sequence[float]

    @property
    def within_a_frame(self) -> float:
        return sum(one <= FRAME_MS for one in self.apart_ms) / max(1, self.ticks)

    def reported(self) -> str:
        if not self.ticks:
            return "no tick came from all"
        median, nearly, most = np.percentile(self.apart_ms, [50, 99, 100])
        frames = Counter(int(np.ceil(one / FRAME_MS)) for one in self.apart_ms)
        return (
            f"{self.ticks} ticks of all, {self.same} the same bit for bit; apart {median:.1f} ms (median), "
            f"{nearly:.1f} (99 %), {most:.1f} (most); frames apart: {dict(sorted(frames.items()))}"
        )


@contextlib.contextmanager
def three_boxes(folder: Path, locked: bool = True) -> Iterator[list[Box]]:
    """The first one leads; all are switched on one after the other."""
    show = write_show(folder / "show", [{"osc": True, "joint": "lShldr"}])
    ports = free_ports(2)
    (folder / "fleet.key").write_text(KEY)
    with ExitStack() as opened:
        boxes = []
        for number, address in enumerate(ADDRESSES):
            own = folder / str(number)
            own.mkdir()
            common = {"host": address, "secret": str(folder / "fleet.key")}
            others = [{"host": one, "port": port} for one, port in zip(ADDRESSES[1:], ports, strict=True)]
            role = {"leader": ADDRESSES[0], "port": ports[number - 1]} if number else {"followers": others}
            settings: dict[str, Any] = {"locked": common | role} if locked else {}
            box = opened.enter_context(playing(show, own, settings=settings | {"resume": "never"}))
            box.frames(10)
            boxes.append(box)
        yield boxes


def measured(boxes: Sequence[Box], seconds: float) -> InStep:
    """What comes at the boxes' receivers."""
    came: list[list[tuple[float, bytes]]] = [[] for _ in boxes]
    for box in boxes:
        box.pause()
    with before_others():
        ends_at = time.monotonic() + seconds
        while time.monotonic() < ends_at:
            for box, own in zip(boxes, came, strict=True):
                own += box.receiver.poll_datagrams()
            time.sleep(0.001)
    by_tick = [dict(_frames(own)) for own in came]
    ticks = set.intersection(*(set(one) for one in by_tick))
    arrivals = [[one[tick][0] for one in by_tick] for tick in ticks]
    return InStep(
        len(ticks),
        sum(len({one[tick][1] for one in by_tick}) == 1 for tick in ticks),
        [1000.0 * (max(one) - min(one)) for one in arrivals],
    )


def _frames(came: Sequence[tuple[float, bytes]]) -> Iterator[tuple[int, tuple[float, bytes]]]:
    """Tick, arrival and rotations of each frame that left in time."""
    tick, arrival, is_late = -1, 0.0, 1
    for at, data in came:
        if data.startswith(b"/bunraku/frame"):
            ((_, arguments),) = decode(data)
            words: list[Any] = [*arguments]
            tick, arrival, is_late = words[0], at, words[3]
        elif data.startswith(b"/mocap/0/joint/rot_local") and tick >= 0 and not is_late:
            yield tick, (arrival, data)


def test_three_boxes_are_in_step_and_one_command_moves_them_all(tmp_path: Path) -> None:
    with three_boxes(tmp_path) as boxes:
        still = measured(boxes, 2.0)
        assert still.ticks > 60 and still.same == still.ticks, still.reported()
        leader, follower = Asker(boxes[0].control), Asker(boxes[1].control)
        leader.tell("/mocap/setjointrot", "lShldr", 0.0, 0.0, 1.0, 1.2)
        assert leader.ask("/iterations", 2, 1)[2] == 1
        assert follower.ask("/iterations", 3, 1)[2] == 0, "the one that leads is commanded"
        moved = measured(boxes, 3.0)
        assert moved.ticks > 90 and moved.same == moved.ticks, moved.reported()
        assert still.within_a_frame > 0.9 and moved.within_a_frame > 0.9, (still.reported(), moved.reported())
        leader.tell("/look", "ink")
        wait_until(lambda: follower.status().look == "ink", "what is declared is in force on all")
        for one in (leader, follower):
            one.close()


def test_a_box_that_loses_the_leader_dances_by_itself_until_it_is_back(tmp_path: Path) -> None:
    with three_boxes(tmp_path) as boxes:
        boxes[0].kill()
        for box in boxes[1:]:
            box.pause()
            ticks = [frame[0] for frame in box.frames(60)]
            assert ticks == sorted(set(ticks)), "it goes on where it was"
            box.await_output("dances by itself")
        boxes[0].start()
        boxes[0].frames(10)
        wait_until(lambda: (again := measured(boxes, 1.0)).ticks > 20 and again.same == again.ticks)


def shown(box: Box, until: Callable[[list[int]], bool]) -> tuple[list[int], npt.NDArray[np.float64]]:
    """Ticks and poses (n, J, 4) that a box shows from now on, until `until` says so of the ticks."""
    came: list[tuple[float, bytes]] = []

    def is_over() -> bool:
        came.extend(box.receiver.poll_datagrams(0.05))
        return until([tick for tick, _ in _frames(came)])

    wait_until(is_over, lambda: box.output, pause=lambda: None)
    frames = [(tick, decode(data)[0][1]) for tick, (_, data) in _frames(came)]
    return [tick for tick, _ in frames], np.array([pose for _, pose in frames], float).reshape(
        len(frames), -1, 4
    )


def test_a_box_that_comes_back_into_step_jumps_nowhere(tmp_path: Path) -> None:
    """The leader begins anew, without the hand that the others still hold: its shoulder is 69 degrees away.

    The null: a box that shows the leader's frame at once turns it by all of that.
    """
    with three_boxes(tmp_path) as boxes:
        leader = Asker(boxes[0].control)
        leader.tell("/mocap/setjointrot", "lShldr", 0.0, 0.0, 1.0, 1.2)
        assert leader.ask("/iterations", 2, 1)[2] == 1
        leader.close()
        time.sleep(1.0)  # until the hand holds
        boxes[0].kill()
        boxes[1].await_output("dances by itself")
        boxes[1].pause()
        boxes[0].start()
        ticks, poses = shown(boxes[1], lambda ticks: ticks[-1:] < ticks[:1] and ticks[-1] > 150)
        turns = np.degrees(quaternion.angle_between(poses[1:], poses[:-1]))
        (back,) = [place for place, (a, b) in enumerate(pairwise(ticks)) if b < a]
        away = np.degrees(quaternion.angle_between(poses[back], poses[-1]))
        shoulder, usual = int(away.argmax()), turns[: back - 1].max(axis=0)
        assert away[shoulder] > 60.0, away
        assert turns[back].max() < 0.1, "the first frame of the leader's is where the box stood"
        beyond = turns - usual
        assert beyond.max() < 3.0, (beyond.max(axis=0), away)
        wait_until(lambda: (again := measured(boxes, 1.0)).ticks > 20 and again.same == again.ticks)


def in_step(hall: Hall, since: float, until: float) -> tuple[InStep, int]:
    """What both boxes of a hall sent between two moments; how many ticks of the first one were in time."""
    shown: dict[str, dict[int, tuple[float, str]]] = {FIRST: {}, SECOND: {}}
    poses: dict[tuple[str, float], list[object]] = defaultdict(list)
    for at, host, address, turn in hall.seen.poses(since, until):
        poses[host, at].append((address, turn))
    events = [(at, host, arguments) for at, host, arguments in hall.seen.osc if since <= at <= until]
    for host, own in shown.items():
        arrivals = sorted(at for (of, at) in poses if of == host)
        for at, _, arguments in (one for one in events if one[1] == host and not one[2][3]):
            if (place := bisect_left(arrivals, at)) < len(arrivals):
                own[arguments[0]] = at, repr(poses[host, arrivals[place]])
    first, second = shown.values()
    both = sorted(first.keys() & second.keys())
    return InStep(
        len(both),
        sum(first[tick][1] == second[tick][1] for tick in both),
        [1000.0 * abs(first[tick][0] - second[tick][0]) for tick in both],
    ), len(first)


RELAYED: dict[str, dict[str, float]] = {
    "a whole cable": {},
    "a fifth lost": {"loss": 0.2, "jitter_s": 0.004},
    "held up": {"delay_s": 0.004, "jitter_s": 0.012},
}


@contextlib.contextmanager
def hall_in_step(folder: Path) -> Iterator[Hall]:
    """Two boxes in networks of their own, with clocks of their own, and what loses datagrams between."""
    show = write_show(folder / "show", [])
    with Hall(folder, show, locked=True) as hall:
        hall.switch_on(FIRST), hall.switch_on(SECOND)
        hall.await_pair()
        yield hall


def relayed(hall: Hall, way: str, seconds: float) -> tuple[InStep, int]:
    """With this between the boxes."""
    hall.relay.set(**RELAYED[way])
    time.sleep(0.5)
    since = time.time()
    time.sleep(seconds)
    hall.relay.set()
    return in_step(hall, since, since + seconds)


@pytest.mark.skipif(bool(missing := why_not()), reason=str(missing))
def test_boxes_stay_in_step_where_datagrams_are_lost_and_held_up(tmp_path: Path) -> None:
    """Each tick comes, and is the same; the way there may take its time."""
    with hall_in_step(tmp_path) as hall:
        for way in RELAYED:
            found, ticks = relayed(hall, way, 4.0)
            assert ticks > 120 and found.ticks > 0.98 * ticks - 3, (way, ticks, found.reported())
            assert found.same == found.ticks, (way, found.reported())
            assert found.within_a_frame > 0.9, (way, found.reported())
        assert "dances by itself" not in hall.boxes[SECOND].output
        assert hall.boxes[FIRST].ask("pair", "status") == (0, "This box leads. In step with it: 1 of 1.\n")
        code, said = hall.boxes[SECOND].ask("pair", "status")
        assert code == 0 and f"in step with {HALL}, " in said, said
        hall.relay.set(cut=True)
        for box in hall.boxes.values():
            wait_until(lambda: "been silent for" in box.ask("pair", "status")[1])  # noqa: B023
            assert box.ask("pair", "status")[0] == 1
        assert "by itself" in hall.boxes[SECOND].ask("pair", "status")[1]


def test_three_boxes_that_know_nothing_of_each_other_are_far_apart(tmp_path: Path) -> None:
    with three_boxes(tmp_path, locked=False) as boxes:
        alone = measured(boxes, 2.0)
    assert alone.within_a_frame == 0.0, alone.reported()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{secret: k}", "either leads others or follows"),
        ("{leader: 127.0.0.2, followers: [{host: 127.0.0.3}], secret: k}", "either leads others or follows"),
        ("{followers: [{host: 127.0.0.2}, {host: 127.0.0.3}], secret: k}", "have the port 9761"),
        ("{leader: 10.0.0.2, secret: k}", "inside itself"),
        ("{leader: 127.0.0.2, secret: k}\npair: {role: first, peer: [127.0.0.1], secret: k}", "in step"),
    ],
)
def test_a_box_file_that_cannot_be_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "box.yaml").write_text(f"locked: {text}\n")
    with pytest.raises(ConfigError, match=message):
        load_box(tmp_path / "box.yaml")


def test_the_firewall_lets_in_each_box_in_step(tmp_path: Path) -> None:
    followers = "[{host: 10.0.0.2, port: 9761}, {host: 10.0.0.3, port: 9762}]"
    (tmp_path / "box.yaml").write_text(f"locked: {{followers: {followers}, host: 0.0.0.0, secret: k}}\n")
    rules = run_bunraku("firewall", "--box", tmp_path / "box.yaml").stdout
    assert "ip saddr 10.0.0.2 udp dport 9761 accept" in rules
    assert "ip saddr 10.0.0.3 udp dport 9762 accept" in rules


if __name__ == "__main__":
    for is_locked in (True, False):
        with tempfile.TemporaryDirectory() as made, three_boxes(Path(made), is_locked) as running:
            print("in step:" if is_locked else "alone:  ", measured(running, float(sys.argv[1])).reported())
    with tempfile.TemporaryDirectory() as made, hall_in_step(Path(made)) as in_hall:
        for between in RELAYED:
            figures, sent = relayed(in_hall, between, float(sys.argv[1]))
            print(f"{between}: of {sent} ticks", figures.reported())
        print([line for line in in_hall.boxes[SECOND].output.splitlines() if "Hz" not in line][-6:])
