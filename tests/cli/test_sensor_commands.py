"""`bunraku sensors` against a control port: tables, values, changes of the key file, clear refusals."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import yaml
from rich.console import Console

from appliance.cli.sensors import box_keys
from appliance.cli.sensors.control_client import Answer, ControlClient, NoBoxError, Roll
from appliance.cli.sensors.table import SensorTable
from appliance.sensor.keys import create_keys, load_keys
from appliance.sensor.link import SensorState
from appliance.sensor.wire import HAS_PROFILE, IS_NDOF
from appliance.show_control.orders import Order
from appliance.show_control.packet import Message, datagram
from appliance.show_control.sensor_roster import RosterLine
from appliance.stage.sensor_lines import roster_lines
from tests.command import Command
from tests.show_control.doubles import ControlInThread, StageDouble, until

LEFT = SensorState(
    *("left-wrist", 0x1A2B3C4D, "linked", "192.168.4.7:2390", 49.96, 0.0123, 0.0042, 0.013),
    *(12, 0b00111011, "1.0.0", "00112233445566778899aabbccddeeff", HAS_PROFILE, 77, ""),
)
LOST = LEFT._replace(name="head", state="lost", rate_hz=0.0, round_trip_s=None, age_s=192.0, battery=255)
SPARE = SensorState(
    *("spare-1", 5, "absent", "", 0.0, 0.0, None, None, 255, 0, "", "", 0, 0, "Its firmware is older.")
)


class RunningBox:
    """Show control, and a stage double that answers."""

    def __init__(self, folder: Path, key_file: Path | None = None) -> None:
        runtime = folder / "runtime"
        runtime.mkdir(mode=0o700)
        self.stage = StageDouble(runtime)
        self.stage.answer = lambda order: (self.done, f"{order.name} it is.")
        self.done = True
        self.control = ControlInThread(runtime, key_file or folder / "sensors.keys")
        self.box_file = folder / "box.yaml"
        settings = {
            "runtime": str(runtime),
            "sensors": {"keys": "sensors.keys"},
            "control": {"host": "0.0.0.0", "port": self.control.port, "senders": ["10.0.0.1"]},
        }
        self.box_file.write_text(yaml.safe_dump(settings))
        self.stage.__enter__()
        until(lambda: self.control.process.handler.status(0, time.monotonic()).state == "dancing")

    @property
    def orders(self) -> list[Order]:
        return self.stage.orders

    def report_sensors(self, states: list[SensorState], neutral_of: Callable[[str], str], now: float) -> None:
        """The stage reports its sensors."""
        self.stage.tell(sensors=roster_lines(states, neutral_of), looked_at=now)

    def close(self) -> None:
        self.control.close()
        self.stage.__exit__(None, None, None)


@pytest.fixture
def box(tmp_path: Path) -> Iterator[RunningBox]:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "head", "spare-1"])
    box = RunningBox(tmp_path)
    box.report_sensors(
        [LEFT, LOST, SPARE],
        lambda name: {"left-wrist": "wanted", "head": "kept"}.get(name, ""),
        time.monotonic(),
    )
    yield box
    box.close()


def test_the_table_has_everything_that_the_box_knows(box: RunningBox, bunraku: Command) -> None:
    out, _ = bunraku("sensors", "--box", box.box_file)
    *first, heading, left, head, spare = out.splitlines()
    assert re.split(r"  +", heading.strip()) == [
        *("name", "state", "rate", "loss", "round trip", "age", "battery"),
        *("calibration", "neutral", "firmware", "id", "way"),
    ]
    assert re.split(r"  +", left.strip()) == [
        *("left-wrist", "linked", "50 Hz", "1.2 %", "4.2 ms", "13 ms", "12 %"),
        *("gyro 3 accel 2", "wanted", "1.0.0", "1a2b3c4d", "192.168.4.7:2390"),
    ]
    assert re.split(r"  +", head.strip())[:7] == ["head", "lost", "-", "-", "-", "3 min", "-"]
    assert "absent" in spare
    assert "Its firmware is older." in first


def test_a_narrow_terminal_gets_two_tables_and_loses_nothing() -> None:
    line = RosterLine(
        *("a-name-of-24-letters-abc", "1a2b3c4d", "linked", "192.168.100.107:23900", 50.0, 0.5, 0.2, 0.7),
        *(87, 0b11010110, IS_NDOF, "1.0.0", "00", "taken", ""),
    )
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    console.print(SensorTable([line]))
    shown = console.export_text()
    assert all(len(row) <= 80 for row in shown.splitlines())
    assert "…" not in shown
    words = "a-name-of-24-letters-abc linked 50.0 200.0 700 87 gyro accel mag taken 1.0.0 1a2b3c4d"
    assert all(word in shown for word in words.split())


def test_programs_get_values_and_nulls(box: RunningBox, bunraku: Command) -> None:
    out, _ = bunraku("sensors", "--json", "--box", box.box_file)
    told = json.loads(out)
    assert told["box"] is True
    left, head, spare = told["sensors"]
    assert left == {
        "name": "left-wrist",
        "id": "1a2b3c4d",
        "state": "linked",
        "way": "192.168.4.7:2390",
        "rate_hz": 49.96,
        "loss": 0.0123,
        "round_trip_s": 0.0042,
        "age_s": 0.013,
        "battery_percent": 12,
        "calibration": {"system": 0, "gyro": 3, "accel": 2, "mag": 3},
        "has_profile": True,
        "fusion": "imuplus",
        "firmware": "1.0.0",
        "imu": "00112233445566778899aabbccddeeff",
        "neutral": "wanted",
        "complaint": None,
    }
    assert (head["round_trip_s"], head["age_s"], head["battery_percent"]) == (None, 192.0, None)
    assert (spare["calibration"], spare["neutral"]) == (None, None)


def test_a_box_that_is_still_starting_or_hangs_is_reported(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    box = RunningBox(tmp_path)
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "still starting" in out
    out, _ = bunraku("sensors", "--json", "--box", box.box_file)
    assert json.loads(out) == {"box": True, "age_s": None, "sensors": []}
    box.report_sensors([LEFT], lambda name: "", time.monotonic() - 60.0)
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "This is 60 s old: the box hangs" in out
    box.close()


def test_without_a_box_it_lists_the_key_file(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "head"])
    box_file = tmp_path / "box.yaml"
    box_file.write_text("sensors: {keys: sensors.keys}\ncontrol: null\n")
    out, _ = bunraku("sensors", "--box", box_file)
    assert "has no control port" in out
    assert re.search(r"^left-wrist  [0-9a-f]{8}", out, re.MULTILINE)
    assert load_keys(tmp_path / "sensors.keys")["head"].key.hex() not in out
    (tmp_path / "sensors.keys").chmod(0o644)
    out, _ = bunraku("sensors", "--box", box_file)
    assert "chmod 600" in out
    out, _ = bunraku("sensors", "--json", "--box", box_file)
    told = json.loads(out)
    assert (told["box"], [sensor["state"] for sensor in told["sensors"]]) == (False, [None, None])


@pytest.mark.parametrize(
    ("words", "name", "sensor"),
    [
        (["strobe", "left-wrist"], "strobe", "left-wrist"),
        (["neutral"], "neutral", ""),
        (["neutral", "head"], "neutral", "head"),
        (["heading", "head"], "heading", "head"),
    ],
)
def test_commands_reach_the_box_and_its_answer_is_printed(
    box: RunningBox, bunraku: Command, words: list[str], name: str, sensor: str
) -> None:
    out, _ = bunraku("sensors", *words, "--box", box.box_file)
    assert out == f"{name} it is.\n"
    assert box.orders == [Order(name, text=sensor)]
    box.done = False
    _, err = bunraku("sensors", *words, "--box", box.box_file, status=2)
    assert err == f"bunraku: {name} it is.\n"


def test_a_late_answer_of_the_stage_replaces_the_refusal(box: RunningBox) -> None:
    handler = box.control.process.handler

    def late(order: Order) -> tuple[bool, str]:
        until(lambda: handler.refused == 1)  # by then the client has been told that the stage does not answer
        return True, "It is."

    box.stage.answer = late
    client = ControlClient(("127.0.0.1", box.control.port), patience_s=20.0)
    assert client.ask("/sensors/strobe", "left-wrist") == Answer(True, "It is.")


def test_a_stage_that_never_answers_is_reported_after_the_timeout(box: RunningBox) -> None:
    box.stage.obeys = False
    client = ControlClient(("127.0.0.1", box.control.port), patience_s=3.0)
    answer = client.ask("/sensors/strobe", "left-wrist")
    assert not answer.done and "does not answer" in answer.words


def test_changes_of_the_key_file_reach_the_box(box: RunningBox, tmp_path: Path, bunraku: Command) -> None:
    before = load_keys(tmp_path / "sensors.keys")
    out, _ = bunraku("sensors", "replace", "left-wrist", "spare-1", "--box", box.box_file)
    assert "left-wrist is now the sensor that was spare-1" in out
    assert "The running box took it." in out
    out, _ = bunraku("sensors", "rename", "spare-1", "spare-2", "--box", box.box_file)
    assert "spare-1 is now spare-2" in out
    out, _ = bunraku("sensors", "revoke", "head", "--box", box.box_file)
    assert "head is revoked" in out
    after = load_keys(tmp_path / "sensors.keys")
    assert {name: key.key for name, key in after.items()} == {
        "left-wrist": before["spare-1"].key,
        "spare-2": before["left-wrist"].key,
    }
    assert [order.name for order in box.orders] == ["reload"] * 3
    assert box.orders[-1].keys == after


def test_a_change_that_the_box_refuses_sets_the_exit_status(box: RunningBox, bunraku: Command) -> None:
    box.done = False
    out, _ = bunraku("sensors", "revoke", "head", "--box", box.box_file, status=1)
    assert "head is revoked" in out
    assert "did not take it. reload it is." in out


class Clock:
    """Time that passes only in a wait."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.mark.parametrize("silent", [1, 20])
def test_restarting_show_control_is_asked_again(
    box: RunningBox, monkeypatch: pytest.MonkeyPatch, bunraku: Command, silent: int
) -> None:
    rolls, roll = [0], ControlClient.roll

    def silent_first(running: ControlClient) -> Roll:
        rolls[0] += 1
        if rolls[0] <= silent:
            raise NoBoxError("No box answers.")
        return roll(running)

    monkeypatch.setattr(ControlClient, "roll", silent_first)
    monkeypatch.setattr(box_keys, "time", Clock())
    out, _ = bunraku("sensors", "revoke", "head", "--box", box.box_file)
    assert "The running box took it." in out
    assert [order.name for order in box.orders] == ["reload"]


def test_a_stage_that_dances_without_show_control_has_not_taken_it(
    box: RunningBox, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:

    def no_box(client: ControlClient) -> Roll:
        raise NoBoxError("No box answers.")

    clock = Clock()
    monkeypatch.setattr(ControlClient, "roll", no_box)
    monkeypatch.setattr(box_keys, "time", clock)
    out, _ = bunraku("sensors", "revoke", "head", "--box", box.box_file, status=1)
    assert "head is revoked" in out
    assert "A box dances here, but its show control did not answer." in out
    assert clock.now > 102.0
    assert box.orders == []


def test_without_a_stage_nothing_waits_for_show_control(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    clock = Clock()
    monkeypatch.setattr(box_keys, "time", clock)
    create_keys(tmp_path / "sensors.keys", ["head"])
    box_file = tmp_path / "box.yaml"
    settings = {"runtime": str(tmp_path / "none"), "sensors": {"keys": "sensors.keys"}}
    box_file.write_text(yaml.safe_dump({**settings, "control": {"port": 1}}))
    out, _ = bunraku("sensors", "revoke", "head", "--box", box_file)
    assert "No box answers on 127.0.0.1:1. The change counts when it starts." in out
    assert clock.now == 100.0


def test_a_box_with_another_key_file_is_named(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["head"])
    box = RunningBox(tmp_path, key_file=tmp_path / "others.keys")
    out, _ = bunraku("sensors", "revoke", "head", "--box", box.box_file, status=1)
    assert f"reads another key file ({tmp_path / 'others.keys'})" in out
    assert box.orders == []
    box.close()


def test_faults_of_the_key_file_of_a_running_box_are_reported(
    box: RunningBox, tmp_path: Path, bunraku: Command
) -> None:
    keys = tmp_path / "sensors.keys"
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "has other sensors than the running box. Run: bunraku sensors reload" in out
    keys.write_text(
        "".join(
            f"{one.name}: {{device: {one.device_id}, key: {one.device_id:032x}}}\n" for one in (LEFT, SPARE)
        )
        + f"head: {{device: {LOST.device_id + 1}, key: {7:032x}}}\n"
    )
    states = [LEFT, SPARE, LOST._replace(device_id=LOST.device_id + 1)]
    box.report_sensors(states, lambda _: "", time.monotonic())
    keys.chmod(0o644)
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "has other sensors" not in out
    assert "can be read by other users" in out
    keys.write_text("left-wrist: {devise: 7}\n")
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "unknown field 'devise'" in out
    assert "goes on with the keys that it has" in out
    _, err = bunraku("sensors", "reload", "--box", box.box_file, status=2)
    assert "unknown field 'devise'" in err
    assert box.orders == []


def test_a_key_file_changed_by_hand_reaches_the_box(box: RunningBox, bunraku: Command) -> None:
    out, _ = bunraku("sensors", "reload", "--box", box.box_file)
    assert "The running box took it." in out
    assert [order.name for order in box.orders] == ["reload"]


@contextmanager
def watching(box: RunningBox) -> Iterator[subprocess.Popen[str]]:
    """`bunraku sensors --watch` in a pipe; killed after a minute, which ends every read."""
    command = [sys.executable, "-m", "appliance.cli", "sensors", "--watch", "--box", str(box.box_file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        watchdog = threading.Timer(60.0, process.kill)
        watchdog.start()
        try:
            yield process
        finally:
            watchdog.cancel()
            process.kill()


def await_table(process: subprocess.Popen[str]) -> None:
    """Read up to the next table's row of left-wrist."""
    assert process.stdout is not None
    while not (line := process.stdout.readline()).startswith("left-wrist"):
        assert line, "the command has ended"


def test_a_closed_pipe_ends_watching(box: RunningBox) -> None:
    with watching(box) as process:
        await_table(process)
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()  # as `head` does
        process.wait(60)
        assert process.stderr.read() == ""


def test_watching_goes_on_until_it_is_interrupted(box: RunningBox) -> None:
    with watching(box) as process:
        for _ in range(3):
            await_table(process)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 0, err


def test_an_interruption_that_python_swallows_ends_watching_too(
    box: RunningBox, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    asked = []

    def swallow(*_: object) -> Roll:
        asked.append(True)
        assert len(asked) == 1, "it goes on"
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        return Roll(roster_lines([LEFT], lambda _: ""), 0.0, None)

    monkeypatch.setattr(ControlClient, "roll", swallow)
    monkeypatch.setattr(time, "sleep", lambda _: None)
    bunraku("sensors", "--watch", "--box", box.box_file)


def test_a_missing_folder_and_a_full_disk_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    keys = tmp_path / "sensors.keys"
    create_keys(keys, ["head"])
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space left")))
    _, err = bunraku("sensors", "revoke", "head", "--keys", keys, status=2)
    assert "No space left. Nothing was changed. Free some space" in err
    nowhere = str(tmp_path / "nowhere" / "sensors.keys")
    # before it asks for a password or opens a port
    _, err = bunraku("provision", "--name", "head", "--network", "stage", "--keys", nowhere, status=2)
    assert "There is no folder" in err


def test_without_a_box_a_change_counts_later(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["head"])
    box_file = tmp_path / "box.yaml"
    box_file.write_text("sensors: {keys: sensors.keys}\ncontrol: null\n")
    out, _ = bunraku("sensors", "revoke", "head", "--box", box_file)
    assert "the change counts when it starts again" in out
    assert load_keys(tmp_path / "sensors.keys") == {}


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["revoke", "haed"], "Did you mean 'head'?"),
        (["rename", "head", "left-wrist"], "already"),
        (["rename", "head", "two words"], "without spaces"),
        (["replace", "head", "spare-9"], "no sensor 'spare-9'"),
        (["replace", "head"], "Name a spare"),
        (["replace", "head", "spare-1", "--port", "/dev/ttyACM0"], "Name a spare"),
        (["revoke", "head", "--keys", "other.keys"], "not both"),
    ],
)
def test_a_refusal_is_one_clear_line(
    box: RunningBox, tmp_path: Path, bunraku: Command, words: list[str], complaint: str
) -> None:
    before = (tmp_path / "sensors.keys").read_bytes()
    _, err = bunraku("sensors", *words, "--box", box.box_file, status=2)
    assert complaint in err
    assert len(err.splitlines()) == 1
    assert (tmp_path / "sensors.keys").read_bytes() == before
    assert box.orders == []


def test_a_missing_key_file_or_box_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    monkeypatch.chdir(tmp_path)
    box_file = tmp_path / "box.yaml"
    box_file.write_text("control: {port: 1}\n")
    _, err = bunraku("sensors", "--box", box_file, status=2)
    assert "names no key file" in err
    _, err = bunraku("sensors", "revoke", "head", "--keys", "sensors.keys", status=2)
    assert "There is no key file sensors.keys" in err
    box_file.write_text("sensors: {keys: nowhere/sensors.keys}\ncontrol: {port: 1}\n")
    _, err = bunraku("sensors", "revoke", "head", "--box", box_file, status=2)
    assert "There is no folder" in err
    _, err = bunraku("sensors", "strobe", "head", "--box", box_file, status=2)
    assert "No box answers on 127.0.0.1:1." in err
    _, err = bunraku("sensors", "--watch", "strobe", "head", status=2)
    assert "behind 'strobe'" in err


def test_provision_refuses_wrong_options_before_it_opens_a_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin", open("/dev/null"))  # noqa: SIM115, PTH123
    for words, complaint in (
        (["--name", "two words"], "without spaces"),
        (["--name", "head", "--axes", "24"], "two hexadecimal numbers"),
        (["--name", "head", "--axes", "20,00"], "no axes"),
        (["--name", "head", "--password-file", "p"], "needs a network"),
        (["--name", "head", "--network", "n", "--password-file", "p"], "p: the password cannot be read"),
        (["--name", "head", "--network", "n"], "No password came"),
        (["--name", "head"], "There is no serial port /dev/nowhere"),
    ):
        assert complaint in bunraku("provision", "--port", "/dev/nowhere", *words, status=2).err
    assert list(tmp_path.iterdir()) == []


class Impostor:
    """Another program on the control port while no box runs, with replies of the test's choice."""

    def __init__(self, folder: Path, replies: list[Message]) -> None:
        self._replies = replies
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.box_file = folder / "box.yaml"
        control = {"host": "127.0.0.1", "port": self._socket.getsockname()[1]}
        self.box_file.write_text(yaml.safe_dump({"sensors": {"keys": "sensors.keys"}, "control": control}))
        threading.Thread(target=self._answer, daemon=True).start()

    def _answer(self) -> None:
        _, asker = self._socket.recvfrom(4096)
        for reply in self._replies:
            self._socket.sendto(datagram(reply), asker)


ESCAPES = "\x1b]0;mine\x07\x1b[2J\x9b31m"


def test_an_impostor_cannot_control_the_terminal(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    line = ("name", "1", *(ESCAPES,) * 2, 50.0, 0.0, 0.0, 0.0, 9, 0, 0, *(ESCAPES,) * 4)
    listed: list[Message] = [("/sensors/sensor", *line), ("/sensors/end", 1, 0.1, ESCAPES)]
    out, _ = bunraku("sensors", "--box", str(Impostor(tmp_path, listed).box_file))
    assert "mine" in out
    told: list[Message] = [("/sensors/reply", "/sensors/strobe", 1, ESCAPES)]
    words, _ = bunraku("sensors", "strobe", "head", "--box", str(Impostor(tmp_path, told).box_file))
    assert "mine" in words
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", out + words)


@pytest.mark.parametrize(
    "replies",
    [
        [("/sensors/end", 0, "x", 7)],
        [("/sensors/end", "0", 0.1, "")],
        [("/sensors/sensor", *range(15)), ("/sensors/end", 1, 0.1, "")],
        [("/sensors/sensor", *"abcdefghijklmno"), ("/sensors/end", 1, 0.1, "")],
        [
            ("/sensors/sensor", *"abcd", float("nan"), float("inf"), 0.0, 0.0, 1, 1, 1, *"lmno"),
            ("/sensors/end", 1, 0.1, ""),
        ],
    ],
)
def test_nonsense_from_an_impostor_does_not_count_as_a_box(
    tmp_path: Path, bunraku: Command, replies: list[Message], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ControlClient.__init__, "__defaults__", (0.2,))
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    out, _ = bunraku("sensors", "--box", str(Impostor(tmp_path, replies).box_file))
    assert "No box answers" in out
