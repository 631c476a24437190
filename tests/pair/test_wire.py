"""The pair's datagrams and messages: what is let in, and that nothing is lost that can be asked for."""

from __future__ import annotations

import random

import pytest

from appliance.pair import wire
from appliance.pair.clock_offset import ClockOffset
from appliance.pair.locked import LockedPair
from appliance.pair.pair import Pair, PairSettings
from appliance.pair.roles import Heard, Role
from appliance.pair.stream import KEPT, MOST_PART, Incoming, Outgoing, body_of, numbers_in
from appliance.pair.wire import BEAT, MESSAGE, Codec
from hw_sim.peers import free_ports

KEY, PRINT = bytes(range(16)), b"same    "
LEADS = Heard(Role.LEADS, 3, True)


def acquainted() -> tuple[Codec, Codec]:
    """Two boxes that know each other's numbers."""
    one, other = Codec(KEY, PRINT), Codec(KEY, PRINT)
    assert other.accept(one.pack(BEAT, LEADS, 0.0)) is None and other.greeting
    assert one.accept(other.pack(BEAT, LEADS, 0.0, to=other.greeting)) is not None
    assert other.accept(one.pack(BEAT, LEADS, 0.0)) is not None
    return one, other


def test_a_datagram_comes_as_it_was_sent() -> None:
    one, other = acquainted()
    found = other.accept(one.pack(MESSAGE, LEADS, 12.5, b"body"))
    assert found == wire.Datagram(MESSAGE, LEADS, PRINT, 12.5, b"body")


@pytest.mark.parametrize("place", [0, 2, 3, 5, 15, 40, 60, -1])
def test_a_datagram_with_a_changed_byte_is_dropped(place: int) -> None:
    one, other = acquainted()
    data = bytearray(one.pack(MESSAGE, LEADS, 12.5, b"body"))
    data[place] ^= 1
    assert other.accept(bytes(data)) is None


def test_repeats_strangers_and_other_nights_are_dropped() -> None:
    one, other = acquainted()
    recorded = one.pack(BEAT, LEADS, 1.0)
    assert other.accept(recorded) is not None
    assert other.accept(recorded) is None and other.counts["repeat"] == 1
    assert other.accept(Codec(bytes(16), PRINT).pack(BEAT, LEADS, 1.0)) is None and other.counts["tag"] == 1
    assert other.accept(other.pack(BEAT, LEADS, 1.0)) is None and other.counts["own"] == 1
    tomorrow = Codec(KEY, PRINT)
    assert tomorrow.accept(recorded) is None and tomorrow.counts["greeting"] == 1


def test_a_box_that_starts_again_is_let_in_and_its_earlier_start_is_not() -> None:
    one, other = acquainted()
    late = one.pack(BEAT, LEADS, 1.0)
    again = Codec(KEY, PRINT)
    assert other.accept(again.pack(BEAT, LEADS, 0.0)) is None
    assert again.accept(other.pack(BEAT, LEADS, 0.0, to=other.greeting)) is not None
    assert other.accept(again.pack(BEAT, LEADS, 0.0)) is not None
    assert other.accept(late) is None and other.counts["ended"] == 1


def test_late_datagrams_count_once() -> None:
    one, other = acquainted()
    sent = [one.pack(MESSAGE, LEADS, 0.0, bytes([number])) for number in range(100)]
    random.Random(1).shuffle(sent)
    assert sum(other.accept(data) is not None for data in sent + sent) == 100


@pytest.mark.parametrize("loss", [0.0, 0.2, 0.5])
def test_all_messages_come_in_order_whatever_is_lost(loss: float) -> None:
    rng, outgoing, incoming, now = random.Random(2), Outgoing(), Incoming(), 0.0
    messages = [rng.randbytes(rng.choice((10, 900, 3 * MOST_PART))) for _ in range(200)]
    came: list[bytes] = []
    for message in [*messages, *[b""] * 40]:
        now += 0.02
        bodies = [*outgoing.put(message)]
        for number in numbers_in(body_of(incoming.missing(now))):
            bodies += outgoing.again(number)
        rng.shuffle(bodies)
        for body in bodies:
            if rng.random() >= loss:
                incoming.put(body)
        while (whole := incoming.take()) is not None:
            came.append(whole)
    assert came[:200] == messages


def test_a_box_that_missed_too_much_says_so_and_goes_on_behind_a_keyframe() -> None:
    outgoing, incoming = Outgoing(), Incoming()
    for _ in range(KEPT + 10):
        body = next(outgoing.put(b"x"))
    incoming.put(body)
    assert incoming.is_lost
    incoming.begin_at(outgoing.number)
    incoming.put(body)
    assert incoming.take() == b"x"


def test_of_a_leader_that_is_gone_the_rest_is_taken_without_what_is_missing() -> None:
    outgoing, incoming = Outgoing(), Incoming()
    for word in (b"one", b"two", b"three"):
        for body in outgoing.put(word):
            if word != b"two":
                incoming.put(body)
    assert incoming.take() == b"one" and incoming.take() is None
    assert [*incoming.take_rest()] == [b"three"]


def test_the_shortest_way_tells_how_far_clocks_are_apart() -> None:
    offset = ClockOffset()
    for number in range(100):
        offset.hear(100.0 + number, 40.0 + number + 0.0003 + 0.01 * (number % 7))
    assert offset.seconds == pytest.approx(-60.0 + 0.0003)


def pair_of(*keys: bytes, clock: list[float], kind: type[Pair] = Pair) -> list[Pair]:
    """Both boxes on this machine, with a clock that stands where the test puts it."""
    port, hosts = free_ports(1)[0], ("127.0.0.1", "127.0.0.2")
    settings = (
        PairSettings("", number == 0, hosts[number], port, [hosts[1 - number]], key, 0.042)
        for number, key in enumerate(keys)
    )
    made = [kind(one, PRINT, clock[0], lambda: clock[0]) for one in settings]
    for _ in range(3):
        for box in made:
            box.beat(clock[0])
            box.look(clock[0])
    return made


@pytest.mark.parametrize("same", [True, False])
def test_another_secret_is_told_from_a_box_that_is_away(same: bool) -> None:
    one, other = pair_of(KEY, KEY if same else bytes(16), clock=[0.0])
    assert one.has_other_secret is other.has_other_secret is not same
    assert one.roles.peer_lives(0.0) is same
    one.close(), other.close()


def test_a_leader_that_starts_again_is_followed_anew_though_it_waited_first() -> None:
    """It leads with the same number as before, and its messages begin at 1 again."""
    clock = [0.0]
    one, other = pair_of(KEY, KEY, clock=clock, kind=LockedPair)
    for start in range(2):
        for clock[0] in (1.5 * start + 0.1, 1.5 * start + 1.0):  # it waits, and says so; then it leads
            one.look(clock[0])
            one.beat(clock[0])
            other.look(clock[0])
        assert one.leads
        other.ask(clock[0])
        one.look(clock[0])
        assert one.wants_keyframe, f"start {start}: nothing was asked for"
        for number in range(5 - start):
            one.publish(b"message %d of start %d" % (number, start), clock[0])
        one.give_keyframe(b"the state")
        one.publish(b"after the keyframe", clock[0])
        one.answer(clock[0])
        other.look(clock[0])
        assert other.take_keyframe() == b"the state"
        assert other.take_message() == b"after the keyframe"
        one.close()
        clock[0] += 0.5
        one = LockedPair(one.settings, PRINT, clock[0], lambda: clock[0])
        for box in (one, other, one):
            box.beat(clock[0])
            other.look(clock[0]), one.look(clock[0])
    one.close(), other.close()


def test_a_box_that_was_held_up_takes_none_for_silent_and_a_late_datagram_for_nothing() -> None:
    clock = [0.0]
    one, other = pair_of(KEY, KEY, clock=clock)
    clock[0] = 1.0
    one.look(1.0)
    assert one.leads
    one.beat(1.0)
    other.look(1.0)
    other.is_ready = True
    assert other.roles.role is Role.FOLLOWS
    one.newest_frame = 1.98
    one.beat(1.99)
    clock[0] = 2.0
    other.look(1.0)  # it was stopped after it had read its clock
    other.look(2.01)
    assert other.roles.role is Role.FOLLOWS
    heard = other.roles.heard
    one.beat(1.5)
    clock[0] = 2.02
    other.look(2.02)
    assert other.roles.heard == heard
    one.close(), other.close()


def test_a_datagram_that_waited_here_says_nothing_of_the_time_since_the_look_before() -> None:
    """It came while the cable was still in, and is read once it is out."""
    clock = [0.0]
    one, other = leading_pair(clock)
    clock[0] = 1.02
    other.look(1.02)
    one.beat(1.02)
    clock[0] = 1.06
    other.look(1.06)
    assert other.roles.heard == 1.06 and other.came_after == 1.02
    one.close(), other.close()


def leading_pair(clock: list[float]) -> tuple[Pair, Pair]:
    """The first box leads, and the frame of 1.000 has left; the second one is ready."""
    one, other = pair_of(KEY, KEY, clock=clock)
    clock[0] = 0.9
    one.look(0.9)
    one.beat(0.9)
    other.look(0.9)
    clock[0] = one.newest_frame = 1.0
    other.look(1.0)
    one.publish(b"", 1.0)
    other.is_ready = True
    return one, other


def look_on(box: Pair, clock: list[float], until: float) -> bool:
    """Let it look every 4 ms; whether it leads after that."""
    while clock[0] < until:
        clock[0] = min(until, clock[0] + 0.004)
        box.look(clock[0])
    return box.leads


@pytest.mark.parametrize("busy_until", [1.0045, 1.015, 1.03])
def test_silence_counts_from_the_newest_frame_however_late_it_was_heard_of(busy_until: float) -> None:
    """A leader that dies in its next tick, right after it said that it is there, loses that frame only."""
    clock = [0.0]
    one, other = leading_pair(clock)
    clock[0] = busy_until
    other.look(busy_until)
    assert not look_on(other, clock, 1.02)
    one.beat(max(1.02, busy_until))
    assert not look_on(other, clock, 1.0419)
    assert look_on(other, clock, 1.0421)
    one.close(), other.close()


@pytest.mark.parametrize("lost_s", [0.0, 0.5])
def test_a_box_that_was_held_up_hears_what_has_come_before_it_takes_a_leader_for_silent(
    lost_s: float,
) -> None:
    """It reads some datagrams at each look, and the newest did not fit into its socket."""
    clock = [0.0]
    one, other = leading_pair(clock)
    other.look(1.0)
    for tick in range(51):
        one.newest_frame = 1.0 + 0.02 * tick
        for _ in range(6 * (one.newest_frame < 2.0 - lost_s)):
            one.beat(one.newest_frame + 0.002)
    clock[0] = 2.003
    other.look(clock[0])
    assert not look_on(other, clock, 2.0449)
    assert look_on(other, clock, 2.0451)
    one.close(), other.close()


def test_a_leader_whose_frame_is_late_keeps_the_lead_though_the_frame_before_was_lost() -> None:
    clock = [0.0]
    one, other = leading_pair(clock)
    other.look(1.0)
    assert not look_on(other, clock, 1.04)
    one.newest_frame = 1.02  # nothing of it came; the frame of 1.040 waits for a reading
    one.beat(1.04)
    assert not look_on(other, clock, 1.0619)
    assert look_on(other, clock, 1.0621)
    one.close(), other.close()


def test_a_leader_that_has_sent_no_frame_yet_counts_from_when_it_began_to_lead() -> None:
    clock = [0.0]
    one, other = pair_of(KEY, KEY, clock=clock)
    clock[0] = 0.9
    one.look(0.9)
    one.newest_frame = 0.5  # it led earlier, too
    one.beat(0.9)
    other.look(0.9)
    other.is_ready = True
    for begun in (0.91, 0.93):
        assert not look_on(other, clock, begun)
        one.beat(begun)
    assert not look_on(other, clock, 0.9419)
    assert look_on(other, clock, 0.9421)
    one.close(), other.close()
