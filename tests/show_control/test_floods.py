"""Floods, bundles full of commands, a box that answers back, a stage that hangs: nobody else waits."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from appliance.levers.table import ITERATIONS, MASTER
from appliance.show_control import order_dispatch
from appliance.show_control.packet import MOST_MESSAGES
from tests.show_control.doubles import Asker, ControlInThread, StageDouble
from tests.show_control.in_force import declared, show_state


def bundle(address: str, count: int) -> bytes:
    builder = OscBundleBuilder(IMMEDIATELY)
    for _ in range(count):
        builder.add_content(OscMessageBuilder(address).build())
    return bytes(builder.build().dgram)


def test_a_bundle_full_of_questions_is_answered_once(stage: StageDouble, asker: Asker) -> None:
    asker.socket.send(bundle("/sensors/list", 60))
    asker.socket.send(bundle("/looks", 60))
    heard = [asker.hear() for _ in range(1 + 59 + 5 + 59)]
    assert [message[0] for message in heard if message].count("/sensors/end") == 1
    assert [message for message in heard if message and message[0] == "/end"] == [["/end", "/looks", 4]]
    assert asker.ask("/ping") == ["/pong"]


def test_a_desk_may_send_all_its_levers_at_once(folder: Path, stage: StageDouble, asker: Asker) -> None:
    builder = OscBundleBuilder(IMMEDIATELY)
    for lever in range(70):
        message = OscMessageBuilder("/master")
        message.add_arg(lever / 70)
        builder.add_content(message.build())
    asker.socket.send(builder.build().dgram)
    heard = [asker.hear() for _ in range(70)]
    assert all(message is not None and message[:3] == ["/reply", "/master", 1] for message in heard)
    assert show_state(folder)[MASTER].value == pytest.approx(69 / 70)


def test_a_bundle_that_is_too_long_is_refused_as_one(folder: Path, stage: StageDouble, asker: Asker) -> None:
    asker.socket.send(bundle("/player/start", MOST_MESSAGES + 1))
    heard = asker.hear()
    assert heard is not None
    assert f"at most {MOST_MESSAGES} messages" in heard[3]
    assert asker.ask("/ping") == ["/pong"]
    assert show_state(folder).generation == 0


def test_what_a_box_says_is_never_answered_so_that_two_boxes_do_not_talk_for_ever(
    control: ControlInThread, asker: Asker
) -> None:
    answers = [
        *(
            "/reply",
            "/pong",
            "/end",
            "/sensors/reply",
            "/sensors/sensor",
            "/sensors/end",
            "/bunraku/status/state",
        ),
        *("/cues/cue", "/phrases/phrase", "/looks/look", "/hands/hand"),
    ]
    for address in answers:
        asker.tell(address, "x")
    assert asker.ask("/ping") == ["/pong"]
    assert control.process.handler.refused == len(answers)


def test_a_flood_of_declarations_leaves_the_newest_in_force(
    folder: Path, control: ControlInThread, stage: StageDouble, asker: Asker
) -> None:
    other = Asker(control.port)
    stage.obeys = False
    for number in range(1000):
        asker.tell("/iterations", 1 + number % 50, 1)
        if number % 50 == 49:  # so that the kernel drops none on the way
            assert other.ask("/ping") == ["/pong"]
    stage.obeys = True
    assert other.ask("/iterations", 7, 6)[2] == 1
    other.close()
    assert declared(folder, ITERATIONS) == ((7, 6), 0.0)
    assert "this one gets no answer" in control.process.handler.reason


def test_a_flood_of_orders_leaves_the_stage_at_four_a_tick(
    control: ControlInThread, stage: StageDouble, asker: Asker
) -> None:
    begun = time.monotonic()
    other = Asker(control.port)
    for number in range(3000):
        asker.tell("/player/jump", number)
        if number % 50 == 49:  # so that the kernel drops none on the way
            assert other.ask("/ping") == ["/pong"]
    assert other.ask("/hold", "lShldr", 0)[:3] == ["/reply", "/hold", 1]
    other.close()
    ticks = (time.monotonic() - begun) / 0.02
    assert len(stage.orders) <= 4 * (ticks + 2)
    assert "Too many commands came at once" in control.process.handler.reason


def test_a_stage_that_hangs_holds_up_no_answer(
    control: ControlInThread, stage: StageDouble, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many clients ask a silent stage; one that asks show control itself is answered at once."""
    monkeypatch.setattr(order_dispatch, "PATIENCE_S", 0.5)
    stage.obeys = False
    askers = [Asker(control.port) for _ in range(5)]
    waiting = [threading.Thread(target=asker.ask, args=("/cue", "storm"), daemon=True) for asker in askers]
    for one in waiting:
        one.start()
    quick = Asker(control.port)
    assert quick.ask("/panic")[2] == 1
    for one in waiting:
        one.join()
    for one in (quick, *askers):
        one.close()
