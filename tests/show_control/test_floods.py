"""Floods, bundles full of commands, a box that answers back, a stage that hangs: nobody else waits."""

from __future__ import annotations

import math
import random
import threading
import time
from pathlib import Path

import pytest
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from appliance.box.orders import OrderSender
from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import ITERATIONS, LOOK, MASTER
from appliance.show_control import order_dispatch
from appliance.show_control.command_handler import CommandHandler
from appliance.show_control.key_file import KeyFile
from appliance.show_control.live_input import LiveInput
from appliance.show_control.order_dispatch import WAITING, OrderDispatch
from appliance.show_control.packet import MOST_MESSAGES, Message, datagram
from appliance.show_control.port import LARGEST_DATAGRAM, Address
from appliance.show_control.stage_observer import StageObserver
from tests.show_control.doubles import (
    Asker,
    ControlInThread,
    InboxDouble,
    StageDouble,
    control_process,
    until,
)
from tests.show_control.fuzz import datagrams
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


COUNT, MOST, OVER_THE_SOCKET = 20_000, 100_000, 10_000
SOMEBODY = ("127.0.0.1", 5000)


def test_nothing_that_comes_in_raises_or_sets_what_is_out_of_bounds(
    folder: Path, key_file: Path, stage: StageDouble, rng: random.Random, long_run: bool
) -> None:
    count = MOST if long_run else COUNT
    writer, sender, projector = ShowStateWriter(folder), OrderSender(folder), InboxDouble(folder, "projector")
    reported: list[int] = []

    def tell(to: Address, message: Message) -> None:
        reported.append(len(datagram(message)))

    dispatch = OrderDispatch(sender)
    handler = CommandHandler(
        ShowState(), StageObserver(folder), dispatch, KeyFile(key_file), tell, writer.write, LiveInput(folder)
    )
    reader = ShowStateReader(folder)
    now = time.monotonic()
    for number, received in enumerate(datagrams(rng.randrange(1 << 30), count)):
        handler.handle_datagram(received[:LARGEST_DATAGRAM], SOMEBODY, now + number / 1000)
        if number % 100 == 0:
            now = time.monotonic() - number / 1000
            dispatch.exchange(now + number / 1000)
            handler.follow_stage(now + number / 1000)
        assert 0.0 <= handler.show_state.level(now) <= 1.0
    assert all(len(way.waiting) <= WAITING for way in dispatch._ways.values())
    show_state = reader.read()
    assert show_state.settings == handler.show_state.settings
    assert all(
        math.isfinite(value) for fade in show_state.settings.values() for value in (fade.since, fade.seconds)
    )
    assert 0.0 <= show_state[MASTER].value <= 1.0
    assert show_state[LOOK].value in ("", "plaster", "lines", "ink", "cloud")
    assert handler.refused > count / 2
    assert len(reported) > count / 2
    assert max(reported) < 1500  # an answer is no weapon
    assert stage.orders  # some of them were commands
    assert all(math.isfinite(value) for order in stage.orders for value in order.values)
    projector.close()
    sender.close()
    writer.close()


def answers(asker: Asker) -> bool:
    """Whether a ping is answered; in a flood the kernel may drop one."""
    asker.tell("/ping")
    return asker.hear(0.5) == ["/pong"]


def own_kb(pid: int) -> int:
    """Memory of its own; pages of programs and libraries, which come and go, are not counted."""
    line = next(one for one in Path(f"/proc/{pid}/status").read_text().splitlines() if "RssAnon" in one)
    return int(line.split()[1])


def test_the_process_answers_after_all_that_and_has_not_grown(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "words.txt"
    with control_process(folder, output) as (process, port):
        flood, asker = Asker(port), Asker(port)
        assert asker.ask("/ping") == ["/pong"]
        before = 0
        for number, sent in enumerate(datagrams(4, OVER_THE_SOCKET)):
            flood.socket.send(sent[:65_000])
            if number % 20 == 19:
                until(lambda: answers(asker))
                while flood.hear(0.0) is not None:
                    pass
            if number == OVER_THE_SOCKET // 5:
                before = own_kb(process.pid)
        assert own_kb(process.pid) < before + 2048
        asker.tell("/panic", 1)
        until(lambda: (asker.hear() or [])[:3] == ["/reply", "/panic", 1])  # after pongs that were late
        assert ShowStateReader(folder).read().panic
        process.terminate()
        assert process.wait(60) == 0
        flood.close()
        asker.close()
    *news, said = output.read_text().splitlines()
    assert said.startswith("Commands: ") and said.isprintable()
    known = ("Panic is", "The show is stopped", "Blackout is", "Master is", "Picture and lights")
    assert all(line.startswith(known) for line in news), news  # nothing of what came in was said
