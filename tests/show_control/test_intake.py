"""Panic, blackout, stop and go are carried out before everything else that has come in."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from appliance.outputs.shared_frame import FrameWriter
from appliance.show_control.intake import WAITING as DATAGRAMS_WAITING
from appliance.show_control.packet import URGENT, messages_in
from appliance.show_control.port import open_port
from appliance.show_control.run import ControlProcess
from appliance.show_control.settings import ControlSettings
from tests.show_control.doubles import HOST, Asker, Clock, facts
from tests.show_control.fuzz import bundle, message

SENT = 20  # at once; the smallest receive buffer of a kernel holds more
NOW = Clock().now
NOISE = {
    "questions": message("/sensors/list"),
    "pings": message("/ping"),
    "orders": message("/player/jump", 1.0),
    "no OSC": b"\xff" * 40,
    "very large": message("/look", "x" * 9000),
    "a live dancer": message("/VMC/Ext/Bone/Pos", "Hips", *[0.0] * 7),
    "bundles": bundle(*[message("/status"), message("/ping")] * 30),
    "an urgent name that is an argument": message("/look", "/go"),
}


@pytest.fixture
def process(folder: Path, clock: Clock) -> Iterator[ControlProcess]:
    settings = ControlSettings(str(folder), open_port(HOST, 0).detach())
    with (
        closing(FrameWriter(folder, facts())),
        closing(ControlProcess(settings, clock)) as process,
    ):
        yield process


@pytest.fixture
def desk(process: ControlProcess) -> Iterator[Asker]:
    with closing(Asker(process.port.number)) as desk:
        yield desk


def heard(desk: Asker) -> list[object]:
    """The address that each reply is about, in the order of the replies."""
    desk.socket.setblocking(False)
    addresses: list[object] = []
    while True:
        try:
            [(reply, arguments)] = messages_in(desk.socket.recv(65536))
        except BlockingIOError:
            return addresses
        addresses.append(arguments[0] if reply == "/reply" else reply)


@pytest.mark.parametrize("noise", NOISE.values(), ids=NOISE)
def test_what_is_urgent_is_answered_first_however_much_has_come_before_it(
    process: ControlProcess, desk: Asker, noise: bytes
) -> None:
    for _ in range(SENT):
        desk.socket.send(noise)
    desk.tell("/panic")
    for _ in range(SENT):
        desk.socket.send(noise)
    desk.tell("/go")
    desk.tell("/stop", 1.0)
    desk.tell("/blackout", 1)
    process.turn()
    show_state = process.handler.show_state
    assert (show_state.panic, show_state.going, show_state.blackout) == (False, False, True)
    assert heard(desk)[:4] == ["/panic", "/go", "/stop", "/blackout"]


def test_what_is_urgent_keeps_its_order_and_the_rest_follows_in_its_own(
    process: ControlProcess, desk: Asker
) -> None:
    seed = random.randrange(2**32)
    sent = random.Random(seed).choices([*URGENT, "/ping", "/master", "/nonsense"], k=5 * SENT)
    for address in sent:
        desk.tell(address, *((1,) if address in ("/blackout", "/master") else ()))
    for _ in sent:
        process.turn()
    urgent = panic_first([one for one in sent if one in URGENT])
    rest = ["/pong" if one == "/ping" else one for one in sent if one not in URGENT]
    assert heard(desk) == urgent + rest, f"seed {seed}"


def panic_first(sent: list[str]) -> list[str]:
    """Each /panic before all that is urgent but an earlier /go."""
    done: list[str] = []
    waiting: list[str] = []
    for one in sent:
        (done if one == "/panic" and "/go" not in waiting else waiting).append(one)
    return done + waiting


@pytest.mark.parametrize(
    ("before", "answered"),
    [
        (["/stop", "/blackout"], ["/panic", "/stop", "/blackout"]),
        (["/stop", "/go"], ["/stop", "/go", "/panic"]),
    ],
)
def test_panic_comes_before_what_is_urgent_but_for_a_go_that_would_lift_it(
    process: ControlProcess, desk: Asker, before: list[str], answered: list[str]
) -> None:
    for address in before:
        desk.tell(address, 1)
    desk.tell("/panic")
    process.turn()
    assert heard(desk) == answered
    assert process.handler.show_state.panic


def test_a_bundle_with_an_urgent_message_goes_first_as_a_whole(process: ControlProcess, desk: Asker) -> None:
    for _ in range(SENT):
        desk.tell("/ping")
    desk.socket.send(bundle(message("/master", 0.5), bundle(message("/panic")), message("/look", "ink")))
    process.turn()
    assert heard(desk)[:3] == ["/master", "/panic", "/look"]


def test_what_comes_while_others_are_carried_out_goes_before_the_next_of_them(
    process: ControlProcess, desk: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    hear = process.handler.handle_datagram

    def slowly(received: bytes, *others: object) -> None:
        hear(received, *others)  # type: ignore[arg-type]
        if received == message("/ping"):
            desk.tell("/panic")

    monkeypatch.setattr(process.handler, "handle_datagram", slowly)
    for address in ("/ping", "/status", "/status"):
        desk.tell(address)
    process.turn()
    assert heard(desk)[:3] == ["/pong", "/panic", "/bunraku/status/state"]


def test_of_too_many_the_oldest_give_way_are_counted_and_the_status_says_so(
    process: ControlProcess, desk: Asker
) -> None:
    for number in range(DATAGRAMS_WAITING + SENT):
        desk.tell("/nonsense", number)
    desk.tell("/panic")
    desk.tell("/status")
    process.turn()
    answers = heard(desk)
    assert answers[0] == "/panic"
    [dropped] = [one for _, one in process.observer.fallbacks(NOW) if one.name == "commands-dropped"]
    assert (dropped.times, dropped.active) == (SENT + 1, True)
    for _ in range(DATAGRAMS_WAITING):
        process.turn()
        answers += heard(desk)
    assert answers.count("/nonsense") == DATAGRAMS_WAITING - 1
    assert "/bunraku/status/fallbacks" in answers
    assert process.handler.status(0, NOW).fallbacks == 1


def test_what_the_kernel_dropped_is_counted_too(process: ControlProcess, desk: Asker) -> None:
    while not process.port.dropped():
        for _ in range(1000):
            desk.tell("/ping")
    process.turn()
    [dropped] = [one for _, one in process.observer.fallbacks(NOW) if one.name == "commands-dropped"]
    assert dropped.times >= process.port.dropped()
