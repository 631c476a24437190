"""Commands come in by real OSC datagrams; what is no command is counted and changes nothing."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.udp_client import SimpleUDPClient

from appliance.sensor.keys import SensorKey, create_keys, load_keys
from appliance.sensor.link import SensorState
from appliance.stage.control import Command, Control, command, datagram
from appliance.stage.roster import Roster

LEFT = SensorState(
    *("left-wrist", 0x1A2B3C4D, "linked", "192.168.4.7:2390", 50.0, 0.01, 0.0042, 0.013),
    *(87, 0b00110011, "1.0.0", "00112233445566778899aabbccddeeff", 1, 77, ""),
)
SPARE = SensorState("spare-1", 5, "absent", "", 0.0, 0.0, None, None, 255, 0, "", "", 0, 0, "Say something.")


@pytest.fixture
def control(tmp_path: Path) -> Iterator[Control]:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "spare-1"])
    roster = Roster("sensors.keys")
    roster.refresh([LEFT, SPARE], lambda name: "taken" if name == "left-wrist" else "", time.monotonic())
    control = Control("127.0.0.1", 0, roster, tmp_path / "sensors.keys")
    yield control
    control.close()


def asked(control: Control, address: str, arguments: list[object], count: int = 1) -> list[list[object]]:
    """The next messages that come back to whoever sent this one: address, then arguments."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asker:
        asker.settimeout(10.0)
        asker.sendto(datagram((address, *arguments)), ("127.0.0.1", control.port))
        answers = []
        for _ in range(count):
            message = OscMessage(asker.recv(4096))
            answers.append([message.address, *message.params])
        return answers


def next_command(control: Control) -> Command:
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        taken = control.take()
        if taken is not None:
            return taken
        time.sleep(0.001)
    raise AssertionError("no command came")


def test_commands_arrive_in_order(control: Control) -> None:
    client = SimpleUDPClient("127.0.0.1", control.port)
    client.send_message("/player/stop", [])
    client.send_message("/player/jump", 12.5)
    client.send_message("/iterations", [12, 11])
    client.send_message("/mocap/setjointrot", ["lShldr", 0.0, 1.0, 0.0, 1.5])
    assert next_command(control) == Command("stop")
    assert next_command(control) == Command("jump", (12.5,))
    assert next_command(control) == Command("iterations", (12.0, 11.0))
    assert next_command(control) == Command("hold", (0.0, 1.0, 0.0, 1.5), "lShldr")


@pytest.mark.parametrize(
    ("address", "arguments", "complaint"),
    [
        ("/player/go", [], "is no command"),
        ("/player/jump", [], "takes 1 numbers"),
        ("/player/jump", ["soon"], "takes 1 numbers"),
        ("/player/jump", [-1.0], "from 0 to"),
        ("/player/rate", [float("nan")], "from -4 to 4"),
        ("/player/rate", [5.0], "from -4 to 4"),
        ("/iterations", [1, 2, 3], "takes 2 numbers"),
        ("/iterations", [65, 2], "from 0 to 64"),
        ("/mocap/setjointrot", [0.1, 0.0, 1.0, 0.0, 1.5], "begins with the joint"),
        ("/mocap/setjointrot", ["lShldr", 1.0], "takes 4 numbers"),
        ("/player/excerpt", [1.0, 2.0, 3.0], "takes 1 to 2 numbers"),
        ("/sensors/strobe", [], "takes a sensor's name."),
        ("/sensors/strobe", ["a", "b"], "takes a sensor's name."),
        ("/sensors/neutral", [1], "or nothing for all"),
        ("/sensors/heading", [""], "or nothing for all"),
        ("/sensors/reload", ["now"], "takes 0 numbers"),
        ("/sensors/strobe", ["\x1b[2J"], "no control characters"),
        ("/mocap/releasejoint", ["\x9b31m"], "no control characters"),
        ("/player/\x1b[2J", [], "no control characters"),
    ],
)
def test_what_is_no_command_is_refused_in_words(
    address: str, arguments: list[object], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        command(address, arguments)


def test_nonsense_is_counted_and_the_port_goes_on_listening(control: Control) -> None:
    noise = random.Random(5)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(100):
            sender.sendto(noise.randbytes(noise.randrange(64)), ("127.0.0.1", control.port))
        sender.sendto(b"/player/jump\0\0\0\0,s\0\0soon\0\0\0\0", ("127.0.0.1", control.port))
    SimpleUDPClient("127.0.0.1", control.port).send_message("/player/start", [])
    assert next_command(control) == Command("start")
    assert control.refused > 0
    assert control.reason


def bundle(address: str, count: int) -> bytes:
    builder = OscBundleBuilder(IMMEDIATELY)
    for _ in range(count):
        builder.add_content(OscMessageBuilder(address).build())
    return bytes(builder.build().dgram)


def test_a_bundle_full_of_questions_is_answered_once_and_holds_up_nobody(control: Control) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.settimeout(0.5)
        begun = time.monotonic()
        for address in ("/sensors/reload", "/sensors/list"):
            sender.sendto(bundle(address, 150), ("127.0.0.1", control.port))
        SimpleUDPClient("127.0.0.1", control.port).send_message("/player/stop", [])
        assert [next_command(control).name, next_command(control).name] == ["reload", "stop"]
        assert time.monotonic() - begun < 5.0
        assert [OscMessage(sender.recv(4096)).address for _ in range(3)][-1] == "/sensors/end"
        with pytest.raises(TimeoutError):
            sender.recv(4096)
    assert control.refused == 2 * 149


def test_a_key_file_that_has_not_changed_is_not_read_again(
    control: Control, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[Path] = []

    def read(path: Path) -> dict[str, SensorKey]:
        reads.append(path)
        return load_keys(path)

    monkeypatch.setattr("appliance.stage.control.load_keys", read)
    client = SimpleUDPClient("127.0.0.1", control.port)
    for _ in range(20):
        client.send_message("/sensors/reload", [])
        assert len(next_command(control).keys) == 2
    assert len(reads) == 1
    (tmp_path / "sensors.keys").unlink()
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "spare-1", "spare-2"])
    client.send_message("/sensors/reload", [])
    assert len(next_command(control).keys) == 3


def test_a_reason_may_be_shown_on_any_terminal(control: Control) -> None:
    SimpleUDPClient("127.0.0.1", control.port).send_message("/\x1b]0;mine\x07\x9b31m", [])
    until = time.monotonic() + 10.0
    while not control.reason and time.monotonic() < until:
        time.sleep(0.001)
    assert control.reason.isprintable()


def test_a_taken_port_raises_and_a_closed_one_is_free_again() -> None:
    control = Control("127.0.0.1", 0, Roster())
    with pytest.raises(OSError, match="in use"):
        Control("127.0.0.1", control.port, Roster())
    control.close()
    Control("127.0.0.1", control.port, Roster()).close()


def test_the_roster_is_told_to_who_asks(control: Control) -> None:
    first, second, end = asked(control, "/sensors/list", [], 3)
    assert first[:5] == ["/sensors/sensor", "left-wrist", "1a2b3c4d", "linked", "192.168.4.7:2390"]
    assert first[5:9] == pytest.approx([50.0, 0.01, 0.0042, 0.013])
    assert first[9:] == [87, 0b00110011, 1, "1.0.0", "00112233445566778899aabbccddeeff", "taken", ""]
    assert second[7:10] == [-1.0, -1.0, 255]
    assert second[-2:] == ["", "Say something."]
    assert end[:2] == ["/sensors/end", 2]
    assert 0.0 <= end[2] < 60.0
    assert end[3] == "sensors.keys"
    assert control.take() is None  # the tick has nothing to do with it


def test_who_asks_hears_what_came_of_it(control: Control) -> None:
    replies: list[list[list[object]]] = []
    asking = threading.Thread(
        target=lambda: replies.append(asked(control, "/sensors/neutral", ["left-wrist"])), daemon=True
    )
    asking.start()
    order = next_command(control)
    assert order == Command("neutral", sensor="left-wrist")
    control.answer(order, True, "Stand still.")
    asking.join(10.0)
    assert replies == [[["/sensors/reply", "/sensors/neutral", 1, "Stand still."]]]
    control.answer(Command("stop"), True, "nobody waits for this")


def test_a_reload_brings_the_keys_along(control: Control, tmp_path: Path) -> None:
    SimpleUDPClient("127.0.0.1", control.port).send_message("/sensors/reload", [])
    order = next_command(control)
    assert order.name == "reload"
    assert order.keys == load_keys(tmp_path / "sensors.keys")
    assert order.keys["left-wrist"].key.hex() not in repr(order)


@pytest.mark.parametrize(
    ("text", "complaint"), [("left-wrist: {", "not valid YAML here"), (None, "No such file")]
)
def test_a_reload_of_a_bad_file_changes_nothing_and_is_told(
    control: Control, tmp_path: Path, text: str | None, complaint: str
) -> None:
    path = tmp_path / "sensors.keys"
    path.write_text(text) if text is not None else path.unlink()
    [[_, about, done, words]] = asked(control, "/sensors/reload", [])
    assert (about, done) == ("/sensors/reload", 0)
    assert complaint in str(words)
    assert "goes on with the keys that it has" in str(words)
    assert control.take() is None
    assert control.refused == 1


def test_a_box_without_a_key_file_says_so() -> None:
    control = Control("127.0.0.1", 0, Roster())
    [[_, _, done, words]] = asked(control, "/sensors/reload", [])
    control.close()
    assert not done
    assert "no key file" in str(words)


def test_what_is_no_command_about_sensors_is_told_too(control: Control) -> None:
    [[_, about, done, words]] = asked(control, "/sensors/strobe", [])
    assert (about, done) == ("/sensors/strobe", 0)
    assert "takes a sensor's name" in str(words)
    [[_, about, done, words]] = asked(control, "/sensors/dance", [])
    assert "is no command" in str(words)
