"""Two real boxes and their cables: the box that receivers hear leads, and none leads that hears nobody."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tests.bundles import write_show
from tests.pair.faults import lost_in
from tests.pair.hall import FIRST, SECOND, Hall, other
from tests.system.namespace import why_not
from tests.system.processes import wait_until

pytestmark = pytest.mark.skipif(bool(missing := why_not()), reason=str(missing))


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hall]:
    """The boxes are joined by the switch, and by a cable of their own."""
    folder = tmp_path_factory.mktemp("pair")
    show = write_show(folder / "show", [])
    with Hall(folder, show, direct=True, pair={"silent_ms": 300}) as made:
        made.switch_on(FIRST)
        made.switch_on(SECOND)
        made.await_pair()
        yield made


def test_a_leader_that_reaches_no_receiver_gives_the_lead_to_the_box_that_does(hall: Hall) -> None:
    leader, since = hall.leader, time.time()
    hall.pull_cable(leader)
    wait_until(lambda: hall.seen.osc[-1][1] == other(leader), "nobody speaks")
    hall.plug_cable(leader)
    hall.await_pair()
    time.sleep(0.3)
    assert hall.leader == other(leader)
    found = lost_in(hall, since, time.time())
    assert found["osc_twice"] == 0 and found["overlap_ms"] == 0.0, found
    assert found["osc_lost"] <= 1, found


def test_a_follower_without_any_cable_leaves_the_lead_where_it_is(hall: Hall) -> None:
    leader, follower, epoch = hall.leader, other(hall.leader), hall.epoch
    hall.pull_cable(follower)
    hall.pull_direct()
    time.sleep(0.7)
    hall.plug_cable(follower)
    hall.await_pair()
    assert (hall.leader, hall.epoch) == (leader, epoch)
