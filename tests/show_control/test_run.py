"""Show control that is held up in the middle of its turn, and a stage that dies or follows too late."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from appliance.box.orders import Order, OrderInbox
from appliance.levers.lever import Lever
from appliance.levers.table import GOING, ITERATIONS, LIGHTS, LOOK, MASTER, PHRASE
from appliance.outputs.shared_frame import FrameWriter
from appliance.show_control.order_dispatch import ANSWER_S, PATIENCE_S
from appliance.show_control.port import open_port
from appliance.show_control.run import ControlProcess
from appliance.show_control.settings import ControlSettings
from tests.show_control.doubles import HOST, Asker, Clock, facts


@pytest.fixture
def stage(folder: Path) -> Iterator[FrameWriter]:
    with closing(FrameWriter(folder, facts())) as writer:
        yield writer


@pytest.fixture
def process(folder: Path, clock: Clock, stage: FrameWriter) -> Iterator[ControlProcess]:
    settings = ControlSettings(str(folder), open_port(HOST, 0).detach())
    with closing(ControlProcess(settings, clock)) as process:
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


def report(stage: FrameWriter, generation: int, message: str = "") -> None:
    """The stage says which show state its dance follows."""
    stage.write_health({"state": "dancing", "applied": [generation, message]})


def test_a_command_is_carried_out_however_long_it_was_held_up_before(
    process: ControlProcess, clock: Clock, inbox: OrderInbox, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    hold_up(process, clock, 5.0, monkeypatch)
    asker.tell("/sensors/heading")
    process.turn()
    inbox.answer(called(inbox), True, "")
    process.turn()
    assert asker.hear() == ["/sensors/reply", "/sensors/heading", 1, "Done."]


@pytest.mark.parametrize(
    ("command", "lever"),
    [
        (("/stop", 2.0), GOING),
        (("/master", 0.5, 3.0), MASTER),
        (("/look", "ink", 4.0), LOOK),
        (("/lights", "cold", 4.0), LIGHTS),
        (("/cue", "storm"), LOOK),
    ],
)
def test_a_fade_begins_when_its_command_has_come(
    process: ControlProcess,
    clock: Clock,
    asker: Asker,
    command: tuple[Any, ...],
    lever: Lever[Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hold_up(process, clock, 5.0, monkeypatch)
    asker.tell(*command)
    began = clock.now
    process.turn()
    assert process.handler.show_state[lever].since == began + 5.0


def test_a_command_is_answered_when_the_stage_follows_the_newest_or_what_came_before_it(
    process: ControlProcess, stage: FrameWriter, asker: Asker
) -> None:
    process.turn()
    generations = []
    for message in (("/iterations", 12, 11), ("/hold", "lShldr", 0), ("/cue", "storm")):
        asker.tell(*message)
        process.turn()
        generations.append(process.handler.show_state.generation)
    report(stage, generations[0], "At most 8 fit.")
    process.turn()
    assert asker.hear() == ["/reply", "/iterations", 1, "At most 8 fit."]
    report(stage, generations[2], "The phrase plays already.")
    process.turn()
    assert asker.hear() == ["/reply", "/hold", 1, "The hand of lShldr lets go."]
    assert asker.hear() == ["/reply", "/cue", 1, "Cue storm. The phrase plays already."]


def test_a_stage_that_does_not_follow_is_told_once_and_the_cue_stays_in_force(
    process: ControlProcess, clock: Clock, stage: FrameWriter, asker: Asker
) -> None:
    asker.tell("/cue", "storm")
    process.turn()
    clock.now += PATIENCE_S + ANSWER_S
    process.turn()
    assert asker.hear(0.1) is None
    clock.now += 0.1
    process.turn()
    assert asker.hear()[:3] == ["/reply", "/cue", 0]  # type: ignore[index]
    declared = process.handler.show_state
    assert (declared.cue, declared[LOOK].value, declared[PHRASE].value) == ("storm", "ink", "quiet")
    report(stage, declared.generation)
    process.turn()
    assert process.handler.show_state == declared
    assert asker.hear(0.1) is None


def test_the_next_stage_answers_for_one_that_died(
    folder: Path, process: ControlProcess, clock: Clock, stage: FrameWriter, asker: Asker
) -> None:
    asker.tell("/cue", "storm")
    process.turn()
    stage.close()
    clock.now += 0.3
    with closing(FrameWriter(folder, facts())) as next_one:
        process.turn()
        report(next_one, process.handler.show_state.generation)
        process.turn()
    assert asker.hear() == ["/reply", "/cue", 1, "Cue storm."]
    assert process.handler.show_state.cue == "storm"


def test_another_show_does_not_get_what_was_declared_for_the_one_before(
    folder: Path, process: ControlProcess, clock: Clock, stage: FrameWriter, asker: Asker
) -> None:
    asker.tell("/cue", "storm")
    process.turn()
    stage.close()
    clock.now += 0.3
    with closing(FrameWriter(folder, facts(show_name="Another", looks=("ink",)))):
        process.turn()
        clock.now += 0.3
        process.turn()
        now = process.handler.show_state
        assert (now.show, {*now.settings}, now[LOOK].value) == (
            *("Another", {"master", "look", "card", "lights"}, "ink"),
        )
        asker.tell("/iterations", 4, 3)
        process.turn()
        now = process.handler.show_state
        assert (now.show, now[ITERATIONS].value) == ("Another", (4, 3))
        assert now[ITERATIONS].generation == now.generation


def test_an_error_about_a_foreign_sensor_is_told_and_commands_are_heard(
    process: ControlProcess, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(now: float) -> None:
        raise IndexError("list index out of range")

    monkeypatch.setattr(process._foreign, "take", fails)
    asker.tell("/ping")
    process.turn()
    assert asker.hear() == ["/pong"]
    assert "IndexError" in process.handler.failure
