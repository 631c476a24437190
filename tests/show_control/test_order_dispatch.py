"""Orders on their way to stage and projector: at most four a tick, and what came of each is told."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from appliance.box.orders import Order, OrderInbox, OrderSender
from appliance.show_control.order_dispatch import (
    ANSWER_S,
    AT_ONCE,
    EVERY_S,
    LATE_S,
    PATIENCE_S,
    WAITING,
    OrderDispatch,
)
from tests.show_control.doubles import Clock, until

NOW = Clock().now


class Heard:
    """What came of dispatch: whether it was done, in words."""

    def __init__(self) -> None:
        self.all: list[tuple[bool, str]] = []

    def __call__(self, done: bool, message: str) -> None:
        self.all.append((done, message))


def test_a_flood_reaches_the_stage_at_four_a_tick_and_the_oldest_gives_way(
    sender: OrderSender, inbox: OrderInbox
) -> None:
    dispatch, heard = OrderDispatch(sender), Heard()
    for number in range(500):
        dispatch.dispatch_order("stage", Order("jump", (float(number),), quiet=True), NOW, heard)
    taken = []
    for turn in range(1, 30):
        got = []
        while (order := inbox.take()) is not None:
            got.append(order.values[0])
        assert len(got) <= AT_ONCE
        taken += got
        dispatch.exchange(NOW + turn * EVERY_S)
    assert taken[:AT_ONCE] == [0.0, 1.0, 2.0, 3.0]
    assert taken[AT_ONCE:] == [float(number) for number in range(500 - WAITING, 500)]
    assert len(heard.all) == 500 - WAITING - AT_ONCE
    assert all(not done and "Too many commands" in message for done, message in heard.all)


def test_a_stage_that_does_not_answer_is_told_after_half_a_second_and_once(
    sender: OrderSender, inbox: OrderInbox, clock: Clock
) -> None:
    dispatch, heard = OrderDispatch(sender), Heard()
    dispatch.dispatch_order("stage", Order("strobe", text="storm"), NOW, heard)
    dispatch.exchange(NOW + PATIENCE_S + ANSWER_S)
    assert heard.all == []
    assert dispatch.due(NOW) == pytest.approx(NOW + PATIENCE_S + ANSWER_S)
    dispatch.exchange(NOW + PATIENCE_S + ANSWER_S + 0.01)
    [(done, message)] = heard.all
    assert not done
    assert "The stage does not answer, and nothing is changed" in message
    assert dispatch.due(NOW) == math.inf
    clock.now += PATIENCE_S + 0.02
    assert inbox.take() is None  # as it was told
    dispatch.exchange(NOW + 1.0)
    assert len(heard.all) == 1


def test_what_is_carried_out_at_the_last_moment_is_told_as_done(
    sender: OrderSender, inbox: OrderInbox, clock: Clock
) -> None:
    dispatch, heard = OrderDispatch(sender), Heard()
    dispatch.dispatch_order("stage", Order("strobe", text="storm"), NOW, heard)
    clock.now += PATIENCE_S
    order = inbox.take()
    assert order is not None
    dispatch.exchange(clock.now + 0.02)  # before the answer
    inbox.answer(order, True, "Cue storm.")
    dispatch.exchange(clock.now + 0.03)
    assert heard.all == [(True, "Cue storm.")]


@pytest.mark.parametrize("quiet", [False, True])
@pytest.mark.parametrize(
    ("late_s", "done", "corrected"),
    [
        (0.2, True, [(True, "Cue storm.")]),
        (LATE_S, True, [(True, "Cue storm.")]),
        (LATE_S + 1.0, True, []),
        (0.2, False, []),
    ],
)
def test_what_was_told_as_not_done_is_corrected_when_it_was_done_after_all(
    sender: OrderSender,
    inbox: OrderInbox,
    quiet: bool,
    late_s: float,
    done: bool,
    corrected: list[tuple[bool, str]],
) -> None:
    """The stage was held up in the middle of the order, which it had taken in time."""
    dispatch, heard = OrderDispatch(sender), Heard()
    dispatch.dispatch_order("stage", Order("strobe", text="storm", quiet=quiet), NOW, heard)
    order = inbox.take()
    assert order is not None
    for now in (order.until + ANSWER_S + 0.01, order.until + late_s - 0.01):
        dispatch.exchange(now)
    [(reported, message)] = heard.all
    assert not reported and "does not answer" in message
    for _ in range(2):
        inbox.answer(order, done, "Cue storm.")
        dispatch.exchange(order.until + late_s)
    assert heard.all[1:] == corrected


def test_an_answer_to_a_show_control_that_died_is_not_taken_for_one_to_the_next(
    folder: Path, inbox: OrderInbox
) -> None:
    orders, heard = [], Heard()
    for _ in range(2):
        sender = OrderSender(folder)
        dispatch = OrderDispatch(sender)
        dispatch.dispatch_order("stage", Order("strobe", text="storm"), NOW, heard)
        orders.append(inbox.take())
        if len(orders) == 1:
            sender.close()
    before, now = orders
    assert before is not None and now is not None
    inbox.answer(before, True, "what the first one asked for")
    dispatch.exchange(NOW)
    assert heard.all == []
    inbox.answer(now, True, "Cue storm.")
    dispatch.exchange(NOW)
    assert heard.all == [(True, "Cue storm.")]
    sender.close()


def test_what_waits_for_a_full_socket_is_told_too(sender: OrderSender, inbox: OrderInbox) -> None:
    while sender.send("stage", Order("heading", until=NOW)) == "sent":
        pass
    dispatch, heard = OrderDispatch(sender), Heard()
    dispatch.dispatch_order("stage", Order("heading"), NOW, heard)
    dispatch.exchange(NOW + PATIENCE_S + 0.1)
    assert [done for done, _ in heard.all] == [False]
    assert "does not answer" in heard.all[0][1]


def test_of_quiet_orders_refusals_and_silence_are_told_alone(sender: OrderSender, inbox: OrderInbox) -> None:
    dispatch, heard, quiet = OrderDispatch(sender), Heard(), Heard()
    dispatch.dispatch_order("stage", Order("strobe", text="storm"), NOW, heard)
    dispatch.dispatch_order("stage", Order("jump", (1.0,), quiet=True), NOW, quiet)
    dispatch.dispatch_order("stage", Order("jump", (9.0,), quiet=True), NOW, quiet)
    dispatch.dispatch_order("stage", Order("jump", (1.0,), quiet=True), NOW, quiet)
    for done in (True, True, False):
        order = inbox.take()
        assert order is not None
        inbox.answer(order, done, f"{order.name} {done}")
    until(lambda: (dispatch.exchange(NOW), bool(quiet.all))[1])
    dispatch.exchange(NOW + 1.0)
    assert heard.all == [(True, "strobe True")]
    refused, silent = quiet.all
    assert refused == (False, "jump False")
    assert not silent[0] and "does not answer" in silent[1]


def test_without_anybody_there_it_is_told_at_once(sender: OrderSender) -> None:
    dispatch, heard = OrderDispatch(sender), Heard()
    for place in ("stage", "projector", "lights"):
        dispatch.dispatch_order(place, Order("x"), NOW, heard)
    assert [done for done, _ in heard.all] == [False] * 3
    for (_, message), cure in zip(
        heard.all, ("bunraku play", "bunraku project", "bunraku lights"), strict=True
    ):
        assert cure in message
