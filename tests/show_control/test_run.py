"""Show control that is held up in the middle of its turn, and a stage that dies or answers too late."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from appliance.outputs.shared_frame import FrameWriter
from appliance.show_control.order_dispatch import ANSWER_S, PATIENCE_S
from appliance.show_control.orders import Order, OrderInbox
from appliance.show_control.port import open_port
from appliance.show_control.run import ControlProcess
from appliance.show_control.settings import Settings
from tests.show_control.doubles import HOST, Asker, Clock, facts

GIVEN_UP_S = PATIENCE_S + ANSWER_S + 0.1


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def stage(folder: Path) -> Iterator[FrameWriter]:
    with closing(FrameWriter(folder, facts())) as writer:
        yield writer


@pytest.fixture
def inbox(folder: Path, clock: Clock) -> Iterator[OrderInbox]:
    with closing(OrderInbox(folder, "stage", clock)) as inbox:
        yield inbox


@pytest.fixture
def process(folder: Path, clock: Clock, stage: FrameWriter) -> Iterator[ControlProcess]:
    settings = Settings(str(folder), open_port(HOST, 0).detach())
    with closing(ControlProcess(settings, lambda words: None, clock)) as process:
        yield process


@pytest.fixture
def asker(process: ControlProcess) -> Iterator[Asker]:
    with closing(Asker(process.port.number)) as asker:
        yield asker


def hold_up(process: ControlProcess, clock: Clock, for_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on it is stopped for so long whenever it takes a datagram."""
    take = process.port.take

    def held_up() -> Any:
        found = take()
        clock.now += for_s if found is not None else 0.0
        return found

    monkeypatch.setattr(process.port, "take", held_up)


def called(inbox: OrderInbox) -> Order:
    order = inbox.take()
    assert order is not None
    return order


def call(cue: str, process: ControlProcess, inbox: OrderInbox, asker: Asker) -> Order:
    """Ask for a cue: what the stage is ordered, and has taken."""
    asker.tell("/cue", cue)
    process.turn()
    return called(inbox)


def begin(folder: Path, cue: str) -> FrameWriter:
    """A stage that goes on in a cue."""
    stage = FrameWriter(folder, facts())
    stage.write_health({"state": "dancing", "cue": cue})
    return stage


def test_a_command_is_carried_out_however_long_it_was_held_up_before(
    process: ControlProcess, clock: Clock, inbox: OrderInbox, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    hold_up(process, clock, 5.0, monkeypatch)
    asker.tell("/iterations", 5, 4)
    process.turn()
    inbox.answer(called(inbox), True, "")
    process.turn()
    assert asker.hear() == ["/reply", "/iterations", 1, "Done."]


def test_what_follows_from_a_command_is_ordered_from_now_on_too(
    process: ControlProcess, clock: Clock, inbox: OrderInbox, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    hold_up(process, clock, 5.0, monkeypatch)
    asker.tell("/stop", 0)
    process.turn()
    assert inbox.take() == Order("stop")


@pytest.mark.parametrize(
    ("command", "since"),
    [
        (("/stop", 2.0), "going_since"),
        (("/master", 0.5, 3.0), "master_since"),
        (("/look", "ink", 4.0), "look_since"),
        (("/lights", "cold", 4.0), "lights_since"),
    ],
)
def test_a_fade_begins_when_its_command_has_come(
    process: ControlProcess,
    clock: Clock,
    asker: Asker,
    command: tuple[Any, ...],
    since: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hold_up(process, clock, 5.0, monkeypatch)
    asker.tell(*command)
    began = clock.now
    process.turn()
    assert getattr(process.desk.show_state, since) == began + 5.0


def test_the_fades_of_a_cue_begin_when_the_stage_has_answered(
    process: ControlProcess, clock: Clock, inbox: OrderInbox, asker: Asker
) -> None:
    order = call("storm", process, inbox, asker)
    clock.now += PATIENCE_S
    inbox.answer(order, True, "")
    process.turn()
    show_state = process.desk.show_state
    assert (show_state.look_since, show_state.lights_since, show_state.master_since) == (clock.now,) * 3


def test_a_cue_that_is_answered_too_late_is_followed_and_told_but_for_what_was_set_meanwhile(
    process: ControlProcess, clock: Clock, inbox: OrderInbox, asker: Asker
) -> None:
    order = call("storm", process, inbox, asker)
    clock.now += GIVEN_UP_S
    asker.tell("/look", "lines")
    process.turn()
    assert asker.hear()[:3] == ["/reply", "/look", 1]  # type: ignore[index]
    assert asker.hear()[:3] == ["/reply", "/cue", 0]  # type: ignore[index]
    assert process.desk.show_state.cue == ""
    inbox.answer(order, True, "")
    process.turn()
    assert asker.hear() == ["/reply", "/cue", 1, "Cue storm."]
    show_state = process.desk.show_state
    assert (show_state.cue, show_state.look, show_state.lights, show_state.master) == (
        "storm",
        "lines",
        "cold",
        0.5,
    )


@pytest.mark.parametrize("away_s", [0.2, 3.0])
@pytest.mark.parametrize(("began_in", "followed"), [("storm", "storm"), ("1", "1"), ("", "1")])
def test_a_cue_is_followed_if_the_stage_died_before_it_answered_and_the_next_one_goes_on_in_it(
    folder: Path,
    process: ControlProcess,
    clock: Clock,
    stage: FrameWriter,
    inbox: OrderInbox,
    asker: Asker,
    away_s: float,
    began_in: str,
    followed: str,
) -> None:
    inbox.answer(call("1", process, inbox, asker), True, "")
    process.turn()
    assert asker.hear()[3] == "Cue 1."  # type: ignore[index]
    call("storm", process, inbox, asker)
    stage.close()
    clock.now += away_s
    process.turn()
    with closing(begin(folder, began_in)):
        for _ in range(2):
            clock.now += GIVEN_UP_S
            process.turn()
    assert asker.hear()[:3] == ["/reply", "/cue", 0]  # type: ignore[index]
    assert process.desk.show_state.cue == followed
    if followed == "storm":
        assert asker.hear()[:3] == ["/reply", "/cue", 1]  # type: ignore[index]
        assert (process.desk.show_state.look, process.desk.show_state.master) == ("ink", 0.5)


def test_a_cue_that_nobody_has_done_is_not_followed_though_a_stage_once_began_in_it(
    folder: Path, process: ControlProcess, clock: Clock, stage: FrameWriter, inbox: OrderInbox, asker: Asker
) -> None:
    stage.write_health({"state": "dancing", "cue": "storm"})
    process.turn()
    inbox.answer(call("1", process, inbox, asker), True, "")
    asker.tell("/cue", "storm")
    process.turn()
    clock.now += GIVEN_UP_S
    process.turn()
    stage.close()
    with closing(FrameWriter(folder, facts())) as next_one:
        for _ in range(2):
            clock.now += GIVEN_UP_S
            process.turn()
            assert process.desk.show_state.cue == "1"
            next_one.write_health({"state": "dancing", "cue": "1"})
