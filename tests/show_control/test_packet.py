"""What a datagram is read as: every well-formed one, and nothing that turns for ever or grows without end."""

from __future__ import annotations

import os
import resource
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as any_
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket

from appliance.outputs.osc.template import osc_string
from appliance.show_control.command import command
from appliance.show_control.packet import (
    DEEPEST_BUNDLE,
    MOST_MESSAGES,
    URGENT,
    Unread,
    messages_in,
    urgent_address,
)
from tests.show_control.doubles import Asker, control_process
from tests.show_control.fuzz import bundle, message

COUNT = 30_000
READ_WITHIN_S = 300.0
MEMORY_BYTES = 1 << 30  # of show control while it hears these; two of the larger ones would need more
BUNDLE = bundle()
TURNS_FOR_EVER = bytes.fromhex("2362756e646c65000000000000000001fffffffc")


@pytest.fixture(autouse=True)
def watchdog() -> Iterator[None]:
    """A parser that turns for ever fails its test, and holds up no other."""

    def end(*_: object) -> None:
        pytest.fail("not read in time")  # no Exception: the door lets it pass

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(int(READ_WITHIN_S))
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def grows_for_ever(text_bytes: int) -> bytes:
    """A message, and an element that leads back to it: python-osc reads it again and again."""
    inner = message("/look", "x" * text_bytes)
    return bundle(inner) + struct.pack(">i", -len(inner) - 8)


@pytest.mark.parametrize(
    "received",
    [
        TURNS_FOR_EVER,
        grows_for_ever(3),
        grows_for_ever(3000),
        bundle(TURNS_FOR_EVER),
        bundle(message("/go"), TURNS_FOR_EVER),
    ],
    ids=["turns", "grows", "grows in large pieces", "within a bundle", "behind a message"],
)
def test_one_datagram_does_not_deafen_show_control(folder: Path, tmp_path: Path, received: bytes) -> None:
    with control_process(folder, tmp_path / "words.txt") as (process, port):
        asker = Asker(port)
        assert asker.ask("/ping") == ["/pong"]
        resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        asker.socket.send(received)
        assert asker.hear() == ["/reply", "", 0, "This is no OSC."]
        assert asker.ask("/panic")[:3] == ["/reply", "/panic", 1]
        asker.close()


def test_datagrams_that_nobody_should_send_are_read_in_bounded_time_and_memory() -> None:
    seed = int.from_bytes(os.urandom(4), "little")
    command = [sys.executable, "-m", "tests.show_control.fuzz", str(seed), str(COUNT)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=READ_WITHIN_S)
    assert done.stdout == "all read\n", f"seed {seed}: {done.stdout}{done.stderr}"


@pytest.mark.parametrize("size", [-(2**31), -20, -8, -4, -1, 0, 1, 2, 3, 6, 12, 2**31 - 1])
def test_an_element_of_an_untrue_size_is_no_osc(size: int) -> None:
    assert messages_in(bundle(message("/go"))) == [("/go", [])]
    with pytest.raises(ValueError, match="no OSC"):
        messages_in(BUNDLE + struct.pack(">i", size) + message("/go"))


def test_bundles_are_as_deep_and_as_long_as_the_bounds_allow() -> None:
    nest = message("/go")
    for _ in range(DEEPEST_BUNDLE):
        nest = bundle(nest)
    assert messages_in(nest) == [("/go", [])]
    with pytest.raises(ValueError, match="no OSC"):
        messages_in(bundle(nest))
    assert len(messages_in(bundle(*[message("/go")] * MOST_MESSAGES))) == MOST_MESSAGES
    with pytest.raises(ValueError, match=f"at most {MOST_MESSAGES} messages"):
        messages_in(bundle(bundle(*[message("/go")] * MOST_MESSAGES), message("/go")))


def test_time_tags_are_now_and_bundles_are_flat() -> None:
    inner = OscBundleBuilder(2_050_000_000)
    inner.add_content(OscMessageBuilder("/go").build())
    outer = OscBundleBuilder(2_000_000_000)
    outer.add_content(inner.build())
    outer.add_content(OscMessageBuilder("/stop").build())
    assert messages_in(outer.build().dgram) == [("/go", []), ("/stop", [])]


_TEXTS = any_.text(any_.characters(exclude_characters="\0", exclude_categories=["Cs"]))
_VALUES = {
    "i": any_.integers(-(2**31), 2**31 - 1),
    "h": any_.integers(-(2**63), 2**63 - 1),
    "f": any_.floats(width=32, allow_nan=False),
    "d": any_.floats(allow_nan=False),
    "s": _TEXTS,
    "T": any_.just(True),
    "F": any_.just(False),
    "N": any_.none(),  # a trigger
}
_ARGUMENTS = any_.sampled_from(sorted(_VALUES)).flatmap(lambda tag: any_.tuples(any_.just(tag), _VALUES[tag]))


@given(any_.lists(any_.tuples(_TEXTS, any_.lists(_ARGUMENTS)), min_size=1, max_size=5), any_.booleans())
def test_what_is_well_formed_is_read_as_python_osc_reads_it(
    messages: list[tuple[str, list[tuple[str, Any]]]], is_bundle: bool
) -> None:
    builders = []
    for address, arguments in messages:
        builders.append(OscMessageBuilder(f"/{address}"))
        for tag, value in arguments:
            builders[-1].add_arg(value, tag)
    packet = OscBundleBuilder(0)
    for builder in builders:
        packet.add_content(builder.build())
    received = packet.build().dgram if is_bundle else builders[0].build().dgram
    expected = [
        (one.message.address, [value for value in one.message.params if value is not None])
        for one in OscPacket(received).messages
    ]
    assert messages_in(received) == expected


@pytest.mark.parametrize(
    ("behind", "arguments"),
    [
        (b"", []),
        (b",\0\0\0", []),
        (b",I\0\0", []),
        (b",N\0\0", []),
        (b",IiN\0\0\0\0" + struct.pack(">i", 1), [1]),
        (b",c\0\0\0\0\0A", [Unread("c")]),
        (b",fi\0" + struct.pack(">f", 0.5), [0.5, Unread()]),
        (b",f\0\0\x3f", [0.5]),  # the last zeros left out
        (b",b\0\0" + struct.pack(">i", -4), [Unread("b")]),
        (b",ib\0" + struct.pack(">iii", 7, 4, 1), [7, Unread("b")]),
        (b",[i]\0\0\0\0" + struct.pack(">i", 0), [Unread("[")]),
        (b",s\0\0no end", [Unread()]),
        (b",s\0\0\xff\xfe\0\0", [Unread()]),
        (b"no comma\0\0\0\0", [Unread()]),
        (b"no end", [Unread()]),
        (b",isx\0\0\0\0" + struct.pack(">i", 3), [3, Unread()]),
    ],
)  # fmt: skip
def test_an_argument_that_cannot_be_read_is_marked_and_panic_is_panic_whatever_it_is(
    behind: bytes, arguments: list[object]
) -> None:
    assert messages_in(b"/panic\0\0" + behind) == [("/panic", arguments)]
    assert command("/panic", arguments).values == ()
    if any(isinstance(one, Unread) for one in arguments):
        with pytest.raises(ValueError, match=r"^/blackout came with an argument .*: nothing is changed\."):
            command("/blackout", arguments)


@pytest.mark.parametrize("address", ["/cue", "/sensors/neutral", "/go", "/stop"])
@pytest.mark.parametrize("tag", "cbrmtX")
def test_a_command_that_was_not_read_whole_is_refused_by_its_type(address: str, tag: str) -> None:
    [(address, arguments)] = messages_in(osc_string(address) + osc_string(f",{tag}") + bytes(8))
    with pytest.raises(ValueError, match=f"^{address} came with an argument with OSC type {tag}: nothing"):
        command(address, arguments)


@pytest.mark.parametrize("tag", "IN")
@pytest.mark.parametrize("address", ["/go", "/cue", "/motion/again", "/sensors/list"])
def test_a_trigger_is_the_command_without_a_value(address: str, tag: str) -> None:
    """OSC's impulse, as ossia score sends it, and nil, as MadMapper does."""
    [(address, arguments)] = messages_in(osc_string(address) + osc_string(f",{tag}"))
    assert command(address, arguments).values == () and command(address, arguments).text == ""


@pytest.mark.parametrize("address", URGENT)
@pytest.mark.parametrize("behind", [b"", b"\0", b"\0\0\0\0\0", b"\n", b"\r\n", b"\0,\0", b",", b"\0,I\0"])
def test_what_is_urgent_is_heard_however_it_is_filled_up(address: str, behind: bytes) -> None:
    assert messages_in(address.encode() + behind) == [(address, [])]


@pytest.mark.parametrize("zeros", range(1, 9))
def test_what_is_urgent_has_its_arguments_wherever_its_address_ends(zeros: int) -> None:
    received = b"/blackout" + bytes(zeros) + b",i\0\0" + struct.pack(">i", 1)
    assert messages_in(received) == [("/blackout", [1])]


@pytest.mark.parametrize("received", [b"/panicked\0\0\0", b"/gold\0\0\0", b"/stop/it\0\0\0\0"])
def test_what_only_begins_like_it_is_another_address(received: bytes) -> None:
    assert urgent_address(received) == b""
    [(address, _)] = messages_in(received)
    assert address == received.rstrip(b"\0").decode()


def test_a_symbol_is_a_text() -> None:
    [(address, arguments)] = messages_in(osc_string("/cue") + osc_string(",S") + osc_string("threads"))
    assert command(address, arguments).text == "threads"


@pytest.mark.parametrize(
    "received", [b"", b"/", b"/cue", b"go\0\0", b"/\xff\0\0", b"\0\0\0\0", BUNDLE[:-1], BUNDLE[:8]]
)
def test_what_has_no_address_is_no_osc(received: bytes) -> None:
    with pytest.raises(ValueError, match=r"This is no OSC\."):
        messages_in(received)
