"""The process as a whole, without a box: its reports, trouble, and motor faders."""

from __future__ import annotations

import os
import pty
import re
import socket
import subprocess
import sys
import time
import tty
from contextlib import closing
from pathlib import Path

import pytest

from appliance.box.fallback import Fallbacks
from appliance.box.show_state import ShowStateWriter
from appliance.levers.show_state import ShowState
from appliance.levers.table import MASTER
from appliance.remote import art_net_timecode
from appliance.remote.fallback import OF_THE_REMOTE
from appliance.remote.linear_timecode import LtcInput
from appliance.remote.run import Remote
from appliance.remote.timecode import BY_NAME, at
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show_control.midi_bindings import MidiBindings, checked
from hw_sim.peers import HOST, free_ports
from tests.logged import said

DOCS = Path(__file__).resolve().parents[2] / "docs"


def remote_of(folder: Path, text: str, fallbacks: Fallbacks) -> Remote:
    (folder / "box.yaml").write_text(text)
    return Remote(load_box(folder / "box.yaml"), folder, fallbacks)


def test_what_cannot_be_heard_is_told(tmp_path: Path) -> None:
    fallbacks = Fallbacks(OF_THE_REMOTE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((HOST, 0))
        port = taken.getsockname()[1]
        text = f"timecode: {{source: art-net, port: {port}}}\nmidi: {{devices: [nanoKONTROL]}}\n"
        remote = remote_of(tmp_path, text, fallbacks)
        remote.turn(100.0)
        reported = remote.report(100.0)
        assert (reported["timecode"], reported["state"], reported["midi"]) == ("", "absent", [])
        assert f"UDP port {port} on {HOST} cannot be opened for timecode" in said[0]
        active = {one.name: one.about for one in fallbacks.happened(100.0) if one.active}
        assert active == {"timecode-unheard": "", "midi-away": "nanoKONTROL"}
    remote.turn(103.0)
    remote.report(103.0)
    assert said[1] == "Timecode can be heard again."
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as desk:
        for count in range(5):
            label = at(3600.0 + count / 25, BY_NAME["25"])
            desk.sendto(art_net_timecode.packed(label) + bytes(count % 2), (HOST, port))  # some are padded
            remote.turn(104.0 + count / 25)
    assert remote.report(104.16)["timecode"] == "01:00:00:04"
    remote.report(110.0)
    assert [one.name for one in fallbacks.happened(120.0) if one.active] == ["timecode-away", "midi-away"]
    remote.close()


def test_a_box_does_not_follow_the_code_that_it_sends_itself(tmp_path: Path) -> None:
    """A broadcast comes back to the machine that sends it: the code never ended, and hid the desk's."""
    (port,) = free_ports(1)
    text = f"timecode: {{source: art-net, port: {port}, send: [{{host: {HOST}, port: {port}}}]}}\n"
    remote = remote_of(tmp_path, text, Fallbacks(OF_THE_REMOTE))
    states = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as desk:
        for count in range(250):
            if count < 25:
                label = art_net_timecode.packed(at(3600.0 + count / 25, BY_NAME["25"]))
                desk.sendto(label, (HOST, port))
            remote.turn(100.0 + count / 25)
            states.append(remote.report(100.0 + count / 25)["state"])
    assert (states[24], states[-1]) == ("running", "absent")
    remote.close()


def test_a_motor_fader_follows_its_lever_but_not_the_hand_on_it(tmp_path: Path) -> None:
    desk, own = pty.openpty()
    tty.setraw(own)
    os.set_blocking(desk, False)
    (tmp_path / "midiC1D0").symlink_to(os.ttyname(own))
    bindings = MidiBindings(tmp_path)
    fader = {"device": "midiC1D0", "kind": "controller", "channel": 2, "number": 7, "address": "/master"}
    bindings.bind(checked(fader))
    text = f"midi: {{devices: ['{tmp_path / 'midiC1D0'}']}}\nstate: .\n"
    with closing(ShowStateWriter(tmp_path)) as writer:
        remote = remote_of(tmp_path, text, Fallbacks(OF_THE_REMOTE))
        writer.write(ShowState().to(MASTER, 0.5, 1.0))
        remote.turn(100.0)
        assert os.read(desk, 10) == b"\xb1\x07\x40"
        os.write(desk, b"\xb1\x07\x00")
        time.sleep(0.01)
        remote.turn(101.0)
        assert remote.report(101.0)["moved"]["number"] == 7
        writer.write(ShowState().to(MASTER, 0.8, 2.0))
        remote.turn(101.2)
        with pytest.raises(BlockingIOError):
            os.read(desk, 10)
        remote.turn(102.0)
        assert os.read(desk, 10) == b"\xb1\x07\x66"
        remote.close()
    os.close(desk)
    os.close(own)


def test_a_fader_that_is_plugged_in_later_is_moved_to_its_lever(tmp_path: Path) -> None:
    """Also one that comes back: it stands anywhere then."""
    device = tmp_path / "midiC1D0"
    bindings = MidiBindings(tmp_path)
    fader = {"device": "midiC1D0", "kind": "controller", "channel": 2, "number": 7, "address": "/master"}
    bindings.bind(checked(fader))
    text = f"midi: {{devices: ['{device}']}}\nstate: .\n"
    now = 100.0
    with closing(ShowStateWriter(tmp_path)) as writer:
        remote = remote_of(tmp_path, text, Fallbacks(OF_THE_REMOTE))
        writer.write(ShowState().to(MASTER, 0.5, 1.0))
        for _ in range(2):
            remote.turn(now)
            desk, own = pty.openpty()
            tty.setraw(own)
            os.set_blocking(desk, False)
            device.symlink_to(os.ttyname(own))
            remote.turn(now + 3.0)
            assert os.read(desk, 10) == b"\xb1\x07\x40"
            os.close(own)
            os.close(desk)
            device.unlink()
            now += 10.0
        remote.close()


def test_midi_timecode_that_comes_by_two_devices_is_one_code(tmp_path: Path) -> None:
    """A sequencer sends it to all of its outputs: each quarter frame comes twice."""
    desks, owns = zip(*(pty.openpty() for _ in range(2)), strict=True)
    for place, own in enumerate(owns):
        tty.setraw(own)
        (tmp_path / f"midiC{place}D0").symlink_to(os.ttyname(own))
    devices = [str(tmp_path / f"midiC{place}D0") for place in range(2)]
    text = f"timecode: {{source: mtc}}\nmidi: {{devices: {devices}}}\nstate: .\n"
    remote = remote_of(tmp_path, text, Fallbacks(OF_THE_REMOTE))
    remote.turn(100.0)
    pieces = [0x0A, 0x10, 0x25, 0x30, 0x40, 0x50, 0x61, 0x72]  # 01:00:05:10, 25 frames
    for turn in range(4):
        for piece, data in enumerate(pieces):
            for desk in desks:
                os.write(desk, bytes([0xF1, data + 2 * turn if piece == 0 else data]))
            time.sleep(0.005)
            remote.turn(100.0 + (8 * turn + piece) / 100)
    assert (remote.report(100.32)["state"], remote.report(100.32)["rate"]) == ("running", "25")
    remote.close()
    for one in (*desks, *owns):
        os.close(one)


def test_a_sound_input_that_is_not_there_is_told_and_tried_again() -> None:
    track = LtcInput("no such input")
    assert list(track.labels(10.0)) == []
    assert "The sound input for timecode cannot be opened" in track.trouble
    track.close()


def test_a_system_without_sound_is_no_end_of_the_process() -> None:
    """In a process of its own: PortAudio would abort it, and MIDI and opening hours with it."""
    program = """
from appliance.remote.linear_timecode import LtcInput
track = LtcInput(None)
print(list(track.labels(10.0)), track.trouble)
"""
    surroundings = {**os.environ, "ALSA_CONFIG_PATH": "/nonexistent"}
    command = [sys.executable, "-c", program]
    ran = subprocess.run(command, env=surroundings, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("[] The sound input for timecode cannot be opened (ALSA is not configured")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("timecode: {source: art-net, host: 0.0.0.0}", "no sender is listed"),
        ("timecode: {source: mtc}", "comes by MIDI"),
        ("timecode: {source: art-net, device: 3}", "the sound input of ltc"),
        ("timecode: {send: [{host: 10.0.0.1, rate: 26}]}", "26 frames"),
        ("midi: {network: {host: 0.0.0.0}}", "no sender is listed"),
        ("control: null\nmidi: {}", "has no port for them"),
    ],
)
def test_a_box_file_that_cannot_be_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "box.yaml").write_text(text + "\n")
    with pytest.raises(ConfigError, match=message) as refused:
        load_box(tmp_path / "box.yaml")
    assert re.search(r"box\.yaml:\d: ", str(refused.value))


def test_two_boxes_on_one_port_hear_the_same_broadcast() -> None:
    """As this box's own Art-Net wires beside its timecode: the port is shared."""
    (port,) = free_ports(1)
    with art_net_timecode.open_port(HOST, port), art_net_timecode.open_port(HOST, port):
        pass
