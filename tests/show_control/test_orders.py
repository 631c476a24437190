"""Orders over real sockets: nobody waits, nothing raises, what is too old is not done."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.box.orders import Answer, Order, OrderInbox, OrderSender
from tests.show_control.doubles import Clock

NOW = Clock().now
KEY = (0x1A2B3C4D, bytes(range(16)))


@pytest.mark.parametrize(
    "order",
    [
        Order("heading"),
        Order("jump", (12.5,), ask=7, until=NOW),
        Order("hold", (0.0, 1.0, 0.0, 1.5), "lShldr", quiet=True),
        Order("reload", keys={"left-wrist": KEY}),
        Order("strobe", text="Größe 'x' \" \\ 雪"),
    ],
)
def test_an_order_arrives_whole(sender: OrderSender, inbox: OrderInbox, order: Order) -> None:
    assert inbox.take() is None
    assert sender.send("stage", order) == "sent"
    taken = inbox.take()
    assert taken == order
    assert taken is not None
    assert (taken.keys, taken.ask, taken.quiet, taken.until) == (
        *(dict(order.keys), order.ask, order.quiet, order.until),
    )
    assert KEY[1].hex() not in repr(taken)


def test_an_answer_comes_back_to_who_asked(sender: OrderSender, inbox: OrderInbox) -> None:
    inbox.answer(Order("heading"), False, "nobody waits")
    assert sender.take() is None
    inbox.answer(Order("heading", ask=1, quiet=True), True, "done")
    inbox.answer(Order("heading", ask=2, quiet=True), False, "no")
    inbox.answer(Order("heading", ask=3), True, "yes")
    assert [sender.take() for _ in range(4)] == [
        Answer(1, True, "done"),
        Answer(2, False, "no"),
        Answer(3, True, "yes"),
        None,
    ]


def test_what_its_asker_no_longer_waits_for_is_not_done(
    sender: OrderSender, inbox: OrderInbox, clock: Clock
) -> None:
    sender.send("stage", Order("neutral", until=NOW))
    sender.send("stage", Order("heading", until=NOW + 1.0))
    clock.now += 0.5
    assert inbox.take() == Order("heading")
    assert inbox.take() is None


@pytest.mark.parametrize(
    "datagram",
    [
        *(b"", b"[]", b"{}", b"null", b"\xff\xfe", b"{", b"[" * 60_000, b'"text"'),
        json.dumps({"name": 1, "values": ["x"], "text": "", "ask": 0, "quiet": 0, "until": 0}).encode(),
        json.dumps({"name": "x", "values": 1, "text": "", "ask": 0, "quiet": 0, "until": 0}).encode(),
        json.dumps(
            {"name": "x", "values": [], "text": "", "ask": 0, "quiet": 0, "until": 1e9, "keys": {"a": 1}}
        ).encode(),
        *(
            b'{"name": "x", "values": [%b], "text": "", "ask": %b, "quiet": 0, "until": 1e9, "keys": %b}'
            % parts
            for parts in ((b"NaN", b"0", b"{}"), (b"", b"Infinity", b"{}"), (b"", b"0", b"[1]"))
        ),
    ],
)
def test_what_is_no_order_is_passed_over(folder: Path, inbox: OrderInbox, datagram: bytes) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as somebody:
        somebody.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as _:
            descriptor = os.open(folder, os.O_PATH)
            somebody.sendto(datagram, f"/proc/self/fd/{descriptor}/stage.sock")
            os.close(descriptor)
    sender = OrderSender(folder)
    assert sender.send("stage", Order("heading")) == "sent"
    assert inbox.take() == Order("heading")
    sender.close()


def test_nobody_there_and_nobody_taking_is_told_apart_and_never_waited_for(
    folder: Path, sender: OrderSender
) -> None:
    assert sender.send("projector", Order("grid", (1.0,))) == "absent"
    inbox = OrderInbox(folder, "projector")
    sent = 0
    while sender.send("projector", Order("grid", (1.0,))) == "sent":
        sent += 1
        assert sent < 100_000
    assert sender.send("projector", Order("grid", (1.0,))) == "full"
    assert inbox.take() is not None
    assert sender.send("projector", Order("grid", (1.0,))) == "sent"
    inbox.close()
    assert sender.send("projector", Order("grid", (1.0,))) == "absent"


def test_who_was_killed_leaves_a_socket_that_the_next_one_takes_over(
    folder: Path, sender: OrderSender
) -> None:
    script = (
        "import sys, time\nfrom pathlib import Path\nfrom appliance.box.orders import OrderInbox\n"
        "inbox = OrderInbox(Path(sys.argv[1]), 'stage')\nprint('open', flush=True)\ntime.sleep(60)\n"
    )
    killed = subprocess.Popen([sys.executable, "-c", script, str(folder)], stdout=subprocess.PIPE)
    assert killed.stdout is not None
    assert killed.stdout.readline() == b"open\n"
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    assert (folder / "stage.sock").exists()
    assert sender.send("stage", Order("heading")) == "absent"
    inbox = OrderInbox(folder, "stage")
    assert sender.send("stage", Order("heading")) == "sent"
    successor = OrderInbox(folder, "stage")
    inbox.close()  # the first one leaves its successor's socket alone
    assert sender.send("stage", Order("neutral")) == "sent"
    assert successor.take() == Order("neutral")
    successor.close()
    assert not (folder / "stage.sock").exists()


def test_a_folder_with_a_long_name_will_do(tmp_path: Path) -> None:
    deep = tmp_path / ("a" * 100) / ("b" * 100)
    deep.mkdir(parents=True)
    inbox, sender = OrderInbox(deep, "stage"), OrderSender(deep)
    assert sender.send("stage", Order("heading")) == "sent"
    assert inbox.take() == Order("heading")
    inbox.close()
    sender.close()


def test_without_a_place_for_the_socket_it_says_so(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        OrderInbox(tmp_path / "nowhere", "stage")
