"""Messages that no client should send: nothing raises, nothing grows, and the port goes on answering."""

from __future__ import annotations

import math
import random
import time
from pathlib import Path

from appliance.box.orders import OrderSender
from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import LOOK, MASTER
from appliance.show_control.command_handler import CommandHandler
from appliance.show_control.key_file import KeyFile
from appliance.show_control.live_input import LiveInput
from appliance.show_control.order_dispatch import WAITING, OrderDispatch
from appliance.show_control.packet import Message, datagram
from appliance.show_control.port import LARGEST_DATAGRAM, Address
from appliance.show_control.stage_observer import StageObserver
from tests.show_control.doubles import Asker, InboxDouble, StageDouble, control_process, until
from tests.show_control.fuzz import datagrams

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
        assert process.wait(20) == 0
        flood.close()
        asker.close()
    *news, said = output.read_text().splitlines()
    assert said.startswith("Commands: ") and said.isprintable()
    known = ("Panic is", "The show is stopped", "Blackout is", "Master is", "Picture and lights")
    assert all(line.startswith(known) for line in news), news  # nothing of what came in was said
