"""MIDI: bindings, show control, and a cable and a network session as the other side sees them."""

from __future__ import annotations

import os
import pty
import socket
import struct
import tty
from pathlib import Path

import pytest

from appliance.remote.midi_messages import MidiParser
from appliance.remote.network_midi import NetworkMidi, commands_in
from appliance.remote.raw_midi import RawMidi
from appliance.remote.show_control_messages import command_of
from appliance.show_control.midi_bindings import MOST_BINDINGS, MidiBindings, Moved, checked, moved
from appliance.show_control.packet import Message
from hw_sim.peers import HOST, free_ports
from tests.system.processes import wait_until

CUES = ("walk in", "12", "end")
FADER = {"device": "desk", "kind": "controller", "channel": 1, "number": 7}


def bound(folder: Path, **values: object) -> MidiBindings:
    bindings = MidiBindings(folder)
    bindings.bind(checked({**FADER, **values}))
    return MidiBindings(folder)


def given(bindings: MidiBindings, *messages: bytes) -> list[Message]:
    seen = [what for one in messages if (what := moved("desk", one)) is not None]
    return [command for what in seen for command in bindings.commands(what)]


def test_a_fader_sets_a_lever_all_the_way(tmp_path: Path) -> None:
    bindings = bound(tmp_path, address="/master")
    assert given(bindings, b"\xb0\x07\x00", b"\xb0\x07\x7f") == [("/master", 0.0), ("/master", 1.0)]
    assert given(bindings, b"\xb0\x08\x7f", b"\xb1\x07\x7f") == []  # another fader, another channel
    half = bound(tmp_path, address="/master", low=0.2, high=0.6)
    assert given(half, b"\xb0\x07\x7f") == [("/master", 0.6)]
    assert len(half.all) == 1  # the newest of a control counts
    coarse = bound(tmp_path, kind="pitch", number=0, address="/seed", low=0, high=100)
    assert given(coarse, b"\xe0\x7f\x7f") == [("/seed", 100)]


def test_a_key_gives_its_command_once_when_it_is_pressed(tmp_path: Path) -> None:
    """Also a soft one; a button that sends 127 and 0 as a controller gives one command as well."""
    bindings = bound(tmp_path, kind="note", number=60, address="/cue", name="12")
    assert given(bindings, b"\x90\x3c\x05", b"\x90\x3c\x00", b"\x80\x3c\x40") == [("/cue", "12")]
    bindings.bind(checked({**FADER, "number": 20, "address": "/panic"}))
    assert given(bindings, b"\xb0\x14\x7f", b"\xb0\x14\x7f", b"\xb0\x14\x00") == [("/panic",)]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"address": "/mistress"}, "no command of this box"),
        ({"address": "/springs/wind"}, "several numbers"),
        ({"address": "/master", "high": 3}, "takes brightness"),
        ({"address": "/look"}, "takes look"),
        ({"address": "/master", "channel": 17}, "no control of a MIDI device"),
        ({"address": "/master", "colour": "red"}, "no binding"),
        ({"address": "/master", "number": "7"}, "no binding"),
    ],
)
def test_a_binding_that_cannot_be_is_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        checked({**FADER, **values})


def test_as_many_bindings_as_there_may_be_are_read_again(tmp_path: Path) -> None:
    """Names in another script: JSON has six letters for each of theirs, and a file too large is none."""
    longest = {"device": "ж" * 64, "kind": "note", "address": "/cue", "name": "ж" * 100}
    many = [
        checked({**longest, "channel": 1 + number // 128, "number": number % 128})
        for number in range(MOST_BINDINGS)
    ]
    MidiBindings(tmp_path)._write(many[1:])
    MidiBindings(tmp_path).bind(many[0])
    assert len(MidiBindings(tmp_path).all) == MOST_BINDINGS


def test_a_damaged_file_is_no_binding_and_is_written_anew(tmp_path: Path) -> None:
    (tmp_path / "midi-bindings.json").write_text('{"bindings": [{"device": 1}, 5], "more"')
    assert MidiBindings(tmp_path).all == ()
    assert len(bound(tmp_path, address="/master").all) == 1


@pytest.mark.parametrize(
    ("body", "command"),
    [
        (b"\x01", ("/cue",)),
        (b"\x01" + b"12", ("/cue", "12")),
        (b"\x01" + b"3\x001\x00", ("/cue", "end")),  # the third of the list
        (b"\x01" + b"99", ("/cue", "99")),  # refused by show control, which says so
        (b"\x04" + bytes(5) + b"12", ("/cue", "12")),
        (b"\x02", ("/stop",)),
        (b"\x03", ("/go",)),
        (b"\x08", ("/blackout", 1)),
        (b"\x09", ("/blackout", 0)),
        (b"\x0a", ("/cue", "walk in")),
        (b"\x10", None),
    ],
)
def test_show_control_messages(body: bytes, command: Message | None) -> None:
    for device, kind in ((5, 0x01), (0x7F, 0x7F), (5, 0x30)):
        assert command_of(bytes([0xF0, 0x7F, device, 2, kind]) + body + b"\xf7", 5, CUES) == command
    for device, kind in ((6, 0x01), (5, 0x10)):  # another device, sound
        assert command_of(bytes([0xF0, 0x7F, device, 2, kind]) + body + b"\xf7", 5, CUES) is None


def test_a_cable_that_is_unplugged_is_opened_again(tmp_path: Path) -> None:
    """A pseudo-terminal in the place of ALSA's raw device: both are read as bytes, without waiting."""
    desk, own = pty.openpty()
    tty.setraw(own)
    device = tmp_path / "midiC1D0"
    device.symlink_to(os.ttyname(own))
    midi = RawMidi([str(device), "Motor"], tmp_path)
    midi.look(0.0)
    assert (midi.names, midi.missing) == (("midiC1D0",), ("Motor",))
    os.write(desk, b"\xb0\x07")
    assert list(midi.messages()) == []
    os.write(desk, b"\x7f\x40")
    assert wait_until(lambda: list(midi.messages())) == [("midiC1D0", b"\xb0\x07\x7f")]
    midi.send("midiC1D0", b"\xb0\x07\x20")
    assert os.read(desk, 10) == b"\xb0\x07\x20"
    os.close(own)
    os.close(desk)
    assert list(midi.messages()) == []
    assert midi.names == ()
    desk, own = pty.openpty()
    tty.setraw(own)
    device.unlink()
    device.symlink_to(os.ttyname(own))
    midi.look(1.0)
    assert midi.names == ()
    midi.look(3.0)
    os.write(desk, b"\x90\x3c\x40")
    assert wait_until(lambda: list(midi.messages())) == [("midiC1D0", b"\x90\x3c\x40")]
    midi.close()


class Computer:
    """The side that opens a session, as macOS does: invitation to both ports, clock, MIDI."""

    def __init__(self, port: int, own: int = 0xCAFE) -> None:
        self.port, self.token, self.own = port, 0x1234, own
        self.sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
        first = free_ports(1)[0]
        for place, one in enumerate(self.sockets):
            one.bind((HOST, first + place))
            one.settimeout(2.0)
        self.sequence = 0

    def say(self, command: bytes, place: int) -> bytes:
        packet = struct.pack(">2s2sIII", b"\xff\xff", command, 2, self.token, self.own) + b"Studio Mac\0"
        self.sockets[place].sendto(packet, (HOST, self.port + place))
        return packet

    def midi(self, section: bytes) -> None:
        self.sequence += 1
        head = struct.pack(">BBHII", 0x80, 0xE1, self.sequence, 0, self.own)
        self.sockets[1].sendto(head + section, (HOST, self.port + 1))


def test_a_session_by_network_as_a_computer_opens_it() -> None:
    port = free_ports(1)[0]
    midi = NetworkMidi(HOST, port, "Bunraku")
    computer = Computer(port)
    now = 100.0
    for place in range(2):
        computer.say(b"IN", place)
        assert list(midi.messages(now)) == []
        answer = computer.sockets[place].recv(100)
        assert answer[:4] == b"\xff\xffOK"
        assert answer[8:12] == struct.pack(">I", computer.token)
        assert answer.endswith(b"Bunraku\0")
    clock = struct.pack(">2s2sIB3x3Q", b"\xff\xff", b"CK", computer.own, 0, 777, 0, 0)
    computer.sockets[1].sendto(clock, (HOST, port + 1))
    assert list(midi.messages(now)) == []
    answer = computer.sockets[1].recv(100)
    assert struct.unpack(">B3x2Q", answer[8:28]) == (1, 777, 1_000_000)
    computer.midi(b"\x03\x90\x3c\x40")
    computer.midi(b"\x06\x90\x3c\x00\x05\x3e\x41")  # a second one 5 ticks later, with running status
    assert list(midi.messages(now)) == [
        ("Studio Mac", one) for one in (b"\x90\x3c\x40", b"\x90\x3c\x00", b"\x90\x3e\x41")
    ]
    midi.send("Studio Mac", b"\xb0\x07\x20", now)
    received = computer.sockets[1].recv(100)
    assert (received[1] & 0x7F, received[12:]) == (0x61, b"\x03\xb0\x07\x20")
    assert computer.sockets[0].recv(100)[:4] == b"\xff\xffRS"
    assert list(midi.messages(now + 91.0)) == []  # the clock was not set for too long
    assert midi.names == ()
    midi.close()


def test_invitations_that_lead_to_nothing_make_room() -> None:
    """Null: sessions in use do not, and the ninth is refused."""
    port = free_ports(1)[0]
    midi = NetworkMidi(HOST, port, "Bunraku")

    def invited(own: int, now: float) -> Computer:
        computer = Computer(port, own)
        computer.say(b"IN", 0)
        assert list(midi.messages(now)) == []
        return computer

    in_use = [invited(number, 1.0) for number in range(7)]
    for computer in in_use:
        clock = struct.pack(">2s2sIB3x3Q", b"\xff\xff", b"CK", computer.own, 0, 777, 0, 0)
        computer.sockets[1].sendto(clock, (HOST, port + 1))
        assert list(midi.messages(1.0)) == []
    first, second = invited(100, 2.0), invited(101, 3.0)
    assert [one.sockets[0].recv(100)[2:4] for one in (first, second)] == [b"OK", b"OK"]
    first.say(b"IN", 1)
    second.say(b"IN", 1)
    assert list(midi.messages(3.0)) == []
    assert [one.sockets[1].recv(100)[2:4] for one in (first, second)] == [b"NO", b"OK"]
    second.midi(b"\x03\x90\x3c\x40")
    assert len(list(midi.messages(3.0))) == 1
    assert invited(102, 4.0).sockets[0].recv(100)[2:4] == b"NO"
    midi.close()


def test_a_session_s_name_is_no_longer_than_a_binding_takes() -> None:
    """60,000 letters did not fit the process's report, and ended it."""
    port = free_ports(1)[0]
    midi = NetworkMidi(HOST, port, "Bunraku")
    computer = Computer(port)
    for place in range(2):
        packet = struct.pack(">2s2sIII", b"\xff\xff", b"IN", 2, 1, computer.own) + b"N" * 60_000
        computer.sockets[place].sendto(packet, (HOST, port + place))
        assert list(midi.messages(1.0)) == []
    assert midi.names == ("N" * 64,)
    assert checked({**FADER, "device": midi.names[0], "address": "/master"})
    midi.close()


def test_only_listed_machines_open_a_session() -> None:
    """Anything else at these ports is nothing at all."""
    port = free_ports(1)[0]
    midi = NetworkMidi(HOST, port, "Bunraku")
    computer = Computer(port)
    computer.midi(b"\x03\x90\x3c\x40")  # without a session
    computer.sockets[0].sendto(b"\xff\xffIN", (HOST, port))
    computer.sockets[1].sendto(b"\x80\x61", (HOST, port + 1))
    assert list(midi.messages(0.0)) == []
    assert (midi.names, midi.strangers) == ((), 0)
    midi.close()


@pytest.mark.parametrize(
    ("section", "found"),
    [
        (b"\x00", b""),
        (b"\x23\x05\xc0\x01", b"\xc0\x01"),  # Z: a delta time before the first command
        (b"\x80\x04\x90\x3c\x40\xfe", b"\x90\x3c\x40"),  # the long head
        (b"\x05\xf0\x7f\x01\x02\xf7", b"\xf0\x7f\x01\x02\xf7"),
        (b"\x04\xf0\x7f\x01\xf0", b"\xf0\x7f\x01"),  # the first part of a long message
        (b"\x04\xf7\x02\x03\xf7", b"\x02\x03\xf7"),  # and its last part
        (b"\x04\xf7\x02\x03\xf5", b"\x02\x03\xf7"),  # the sender left its end out
        (b"\x09\x90\x3c\x40\x00\xf8\x00\x3e\x41", b"\x90\x3c\x40\x3e\x41"),  # a clock between two notes
        (b"\x08\x90\x3c\x40\x00\xf6\x00\x3e\x41", b"\x90\x3c\x40\xf6"),  # ends the running status
        (b"\x03\x90\x3c", b""),  # cut off
        (b"\x02\x3c\x40", b""),  # data without a status
    ],
)
def test_sections_of_commands(section: bytes, found: bytes) -> None:
    assert commands_in(section) == found


def test_a_long_message_that_is_cancelled_commands_nothing() -> None:
    """Null: its end instead, and the same parts are a command."""
    go = b"\xf0\x7f\x01\x02\x01\x01"
    parts = bytes([len(go) + 1]) + go + b"\xf0", b"\x03\xf7\x31"

    def heard(end: bytes) -> list[bytes]:
        parser = MidiParser()
        return [one for part in (parts[0], parts[1] + end) for one in parser.messages(commands_in(part))]

    assert heard(b"\xf7") == [go + b"\x31\xf7"]
    assert heard(b"\xf4") == []


def test_movements() -> None:
    assert moved("desk", b"\x90\x3c\x00") == Moved("desk", "note", 1, 60, 0.0)
    assert moved("desk", b"\xc5\x05") == Moved("desk", "program", 6, 5, 1.0)
    assert moved("desk", b"\xf6") is None
