"""Two real boxes in networks of their own: the second follows bit for bit, takes over, and gives back."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from appliance.box.show_state import ShowStateReader
from appliance.levers.table import MASTER
from appliance.outputs.frame_reader import FrameReader
from appliance.sensor.keys import create_keys
from tests.bundles import write_show
from tests.pair.faults import lost_in
from tests.pair.hall import FIRST, SECOND, Hall, other
from tests.system.lit import RIG
from tests.system.namespace import why_not
from tests.system.processes import wait_until

pytestmark = pytest.mark.skipif(bool(missing := why_not()), reason=str(missing))


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    """Both boxes on, the first one leads, the second one is ready."""
    folder = tmp_path_factory.mktemp("pair")
    create_keys(folder / "sensors.keys", ["left-wrist"])
    show = write_show(folder / "show", [{"osc": True, "joint": "lShldr"}], lights=RIG)
    # A machine that tests more beside this holds boxes up for longer than a real one does.
    settings = {"outputs": {"dmx": [{"wire": "sacn", "universe": 1}]}, "pair": {"silent_ms": 300}}
    with Hall(folder, show, **settings) as made:
        made.switch_on(FIRST)
        made.switch_on(SECOND)
        made.await_pair()
        yield made


def command(hall: Hall, address: str, osc: str, *arguments: float | str) -> None:
    """To the box's control port, from inside of it."""
    import socket

    from appliance.show_control.packet import datagram

    with hall.networks[address].entered(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(datagram((osc, *arguments)), ("127.0.0.1", 9002))


def test_one_box_speaks_and_the_other_one_follows_without_a_difference(hall: Hall) -> None:
    follows = "second box of the pair, and it follows"  # told once a second
    wait_until(lambda: follows in hall.boxes[SECOND].ask("pair", "status")[1], "it never followed")
    assert hall.boxes[SECOND].ask("pair", "status")[0] == 0
    since = time.time()
    command(hall, FIRST, "/hold", "lShldr", 1)
    command(hall, FIRST, "/mocap/setjointrot", "lShldr", 0.0, 0.0, 1.0, 1.2)
    time.sleep(1.5)
    assert {box for at, box, _ in hall.seen.osc if at > since} == {FIRST}
    assert "danced otherwise" not in hall.boxes[SECOND].output


def test_what_is_declared_is_in_force_on_both(hall: Hall) -> None:
    command(hall, FIRST, f"/{MASTER.name}", 0.25)
    reader = ShowStateReader(hall.boxes[SECOND].runtime)
    wait_until(lambda: reader.read()[MASTER].value == 0.25, "the second box never heard of it")
    reader.close()


def test_the_second_box_takes_over_and_gives_back(hall: Hall) -> None:
    wait_until(lambda: all("Lights:" in box.output for box in hall.boxes.values()), "the lights never came")
    wait_until(lambda: hall.seen.sacn, "no light")
    since = time.time()
    hall.boxes[FIRST].signal(signal.SIGSTOP)
    wait_until(lambda: hall.boxes[SECOND].part.leads, "no takeover")
    wait_until(lambda: hall.seen.sacn[-1][1] == SECOND, "no light of the second box")
    hall.boxes[FIRST].signal(signal.SIGCONT)
    hall.await_pair()
    found = lost_in(hall, since, time.time())
    assert found["overlap_ms"] <= 100.0 and found["jump_degrees"] <= 1.0, found
    assert next(one[2] for one in reversed(hall.seen.sacn) if one[1] == SECOND) == 101
    hall.boxes[SECOND].await_output("pair-taken")

    since = time.time()
    code, said = hall.boxes[SECOND].ask("pair", "back")
    assert code == 0, said
    wait_until(lambda: hall.leader == FIRST, "the first box never led again")
    hall.await_pair()
    code, said = hall.boxes[SECOND].ask("pair", "back")
    assert code == 1 and "follows" in said
    ticks = [arguments[0] for at, _, arguments in hall.seen.osc if at > since]
    assert all(b > a for a, b in pairwise(ticks)), "a frame was sent twice"


def test_a_box_that_was_switched_off_follows_when_it_is_back(hall: Hall) -> None:
    leader = hall.leader
    hall.boxes[leader].cut_power()
    wait_until(lambda: hall.boxes[other(leader)].part.leads, "no takeover")
    hall.switch_on(leader)
    hall.await_pair()
    assert hall.leader == other(leader)


def fallbacks(hall: Hall, address: str) -> str:
    """The fallbacks that the box's stage reports."""
    with contextlib.closing(FrameReader(hall.boxes[address].runtime)) as reader:
        return str((reader.health() or {}).get("fallbacks"))


def test_a_leader_whose_cable_was_out_for_long_sends_nothing_before_it_hears_the_other_one(
    hall: Hall,
) -> None:
    """Multicast passes at once; the other box is heard once the network has asked for the address again."""
    leader = hall.leader
    follower = other(leader)
    hall.pull_cable(leader)
    hall.forget(leader)
    wait_until(lambda: hall.boxes[follower].part.leads, "no takeover")
    wait_until(lambda: "its cable to the receivers is out" in fallbacks(hall, leader), "it said nothing")
    since = time.time()
    hall.plug_cable(leader)
    hall.await_pair()
    assert hall.leader == follower
    came = [(at, box) for seen in (hall.seen.osc, hall.seen.psn, hall.seen.sacn) for at, box, *_ in seen]
    assert {box for at, box in came if at > since} == {follower}


def test_a_box_with_another_show_does_not_follow(hall: Hall, tmp_path: Path) -> None:
    follower = other(hall.leader)
    hall.boxes[follower].cut_power()
    hall.show, before = write_show(tmp_path / "other", [], name="Another"), hall.show
    hall.switch_on(follower)
    hall.show = before
    leader = hall.leader
    wait_until(lambda: "another show" in hall.boxes[leader].ask("pair", "status")[1], "it said nothing")
    assert not hall.boxes[follower].part.is_ready
