"""The OSC receiver decodes what python-osc builds, dates it, and survives what nobody should send."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder

from hw_sim.osc_receiver import MalformedOscError, OscReceiver, decode


@pytest.fixture
def receiver() -> Iterator[OscReceiver]:
    with OscReceiver("127.0.0.1") as listening:
        yield listening


def send(receiver: OscReceiver, *datagrams: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for datagram in datagrams:
            sender.sendto(datagram, ("127.0.0.1", receiver.port))


def built(address: str, *arguments: tuple[str, object]) -> bytes:
    builder = OscMessageBuilder(address)
    for kind, value in arguments:
        builder.add_arg(value, kind)
    return builder.build().dgram


def test_every_argument_type_of_python_osc_is_decoded() -> None:
    arguments = [
        ("i", -7),
        ("f", 0.25),
        ("h", 1 << 40),
        ("d", 1e-9),
        ("s", "Hips"),
        ("b", b"\x01\x02\x03"),
        ("T", True),
        ("F", False),
        ("N", None),
    ]
    packet = built("/a/b", *arguments)
    assert decode(packet) == [("/a/b", [-7, 0.25, 1 << 40, 1e-9, "Hips", b"\x01\x02\x03", True, False, None])]


@given(st.text(alphabet=st.characters(min_codepoint=33, max_codepoint=126), max_size=40))
def test_strings_of_any_length_are_unpadded(text: str) -> None:
    assert decode(built("/s", ("s", text), ("i", 1))) == [("/s", [text, 1])]


def test_bundles_within_bundles_are_opened_in_order() -> None:
    inner = OscBundleBuilder(IMMEDIATELY)
    inner.add_content(OscMessageBuilder("/two").build())
    outer = OscBundleBuilder(IMMEDIATELY)
    outer.add_content(OscMessageBuilder("/one").build())
    outer.add_content(inner.build())
    outer.add_content(OscMessageBuilder("/three").build())
    assert [address for address, _ in decode(outer.build().dgram)] == ["/one", "/two", "/three"]


def test_arrivals_lie_between_sending_and_polling(receiver: OscReceiver) -> None:
    before = time.monotonic()
    send(receiver, built("/first"), built("/second", ("f", 1.0)))
    messages = receiver.poll(timeout=5.0)
    while len(messages) < 2:
        messages += receiver.poll(timeout=5.0)
    after = time.monotonic()
    assert [(address, arguments) for _, address, arguments in messages] == [
        ("/first", []),
        ("/second", [1.0]),
    ]
    arrivals = [arrival for arrival, _, _ in messages]
    assert before <= arrivals[0] <= arrivals[1] <= after


def test_a_poll_with_nothing_there_comes_back_empty(receiver: OscReceiver) -> None:
    assert receiver.poll(timeout=0.0) == []


def test_malformed_datagrams_are_counted_and_the_next_one_is_read(receiver: OscReceiver) -> None:
    send(receiver, b"", b"nonsense", built("/fine"))
    messages = receiver.poll(timeout=5.0)
    while not messages:
        messages = receiver.poll(timeout=5.0)
    assert [address for _, address, _ in messages] == ["/fine"]
    assert (receiver.datagrams, receiver.malformed) == (3, 2)


@pytest.mark.parametrize(
    ("packet", "what"),
    [
        (b"/a\0\0", "string without an end"),
        (b"a\0\0\0,\0\0\0", "slash"),
        (b"/a\0\0i\0\0\0", "comma"),
        (b"/a\0\0,i\0\0", "ends within a number"),
        (b"/a\0\0,\0\0\0\0\0\0\0", "too many"),
        (b"/a\0\0,y\0\0", "unknown type tag"),
        (b"/ab\0,\0x\0", "filled up with zeros"),
        (b"#bundle\0", "time tag"),
        (b"#bundle\0" + bytes(8) + b"\0\0\0\x40/a\0\0", "64 bytes"),
        (b"/a\0\0,b\0\0\x7f\0\0\0", "blob"),
    ],
)
def test_what_is_malformed_is_said(packet: bytes, what: str) -> None:
    with pytest.raises(MalformedOscError, match=what):
        decode(packet)


@given(st.binary(max_size=200) | st.binary(max_size=80).map(lambda tail: b"#bundle\0" + bytes(8) + tail))
@settings(max_examples=300)
def test_no_bytes_raise_anything_else(packet: bytes) -> None:
    try:
        messages = decode(packet)
    except MalformedOscError:
        return
    assert all(address.startswith("/") for address, _ in messages)


def test_a_taken_port_is_refused(receiver: OscReceiver) -> None:
    with pytest.raises(OSError, match="in use"):
        OscReceiver("127.0.0.1", receiver.port)
