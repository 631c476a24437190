"""Commands of `bunraku sensors` against a control port: changes of the key file, clear refusals."""

from __future__ import annotations

import errno
import os
import re
import socket
import threading
import time
from pathlib import Path

import pytest
import yaml

from appliance.box.orders import Order
from appliance.cli.sensors import box_keys
from appliance.cli.sensors.control_client import ControlClient, NoBoxError, Reply
from appliance.release import choice
from appliance.release.choice import Choice, ShowAndBox
from appliance.sensor.keys import create_keys, load_keys
from appliance.show_control.packet import Message, datagram
from tests.bundles import write_show
from tests.cli.running_box import LEFT, LOST, SPARE, RunningBox
from tests.command import Command
from tests.show_control.doubles import until


@pytest.mark.parametrize(
    ("arguments", "name", "sensor"),
    [
        (["strobe", "left-wrist"], "strobe", "left-wrist"),
        (["neutral"], "neutral", ""),
        (["neutral", "head"], "neutral", "head"),
        (["heading", "head"], "heading", "head"),
    ],
)
def test_commands_reach_the_box_and_its_answer_is_printed(
    box: RunningBox, bunraku: Command, arguments: list[str], name: str, sensor: str
) -> None:
    out, _ = bunraku("sensors", *arguments, "--box", box.box_file)
    assert out == f"{name} it is.\n"
    assert box.orders == [Order(name, text=sensor)]
    box.done = False
    _, err = bunraku("sensors", *arguments, "--box", box.box_file, status=2)
    assert err == f"bunraku: {name} it is.\n"


def test_a_late_answer_of_the_stage_replaces_the_refusal(box: RunningBox) -> None:
    handler = box.control.process.handler

    def late(order: Order) -> tuple[bool, str]:
        until(lambda: handler.refused == 1)  # by then the client has been told that the stage does not answer
        return True, "It is."

    box.stage.answer = late
    client = ControlClient(("127.0.0.1", box.control.port), patience_s=20.0)
    assert client.ask("/sensors/strobe", "left-wrist") == Reply(True, "It is.")


def test_a_stage_that_never_answers_is_reported_after_the_timeout(box: RunningBox) -> None:
    box.stage.obeys = False
    client = ControlClient(("127.0.0.1", box.control.port), patience_s=3.0)
    answer = client.ask("/sensors/strobe", "left-wrist")
    assert not answer.done and "does not answer" in answer.message


def test_changes_of_the_key_file_reach_the_box(box: RunningBox, tmp_path: Path, bunraku: Command) -> None:
    before = load_keys(tmp_path / "sensors.keys")
    out, _ = bunraku("sensors", "replace", "left-wrist", "spare-1", "--box", box.box_file)
    assert "left-wrist is now the sensor that was spare-1" in out
    assert "The running box took it." in out
    out, _ = bunraku("sensors", "rename", "spare-1", "spare-2", "--box", box.box_file)
    assert "spare-1 is now spare-2" in out
    out, _ = bunraku("sensors", "revoke", "head", "--anyway", "--box", box.box_file)
    assert "head is revoked" in out
    after = load_keys(tmp_path / "sensors.keys")
    assert {name: key.key for name, key in after.items()} == {
        "left-wrist": before["spare-1"].key,
        "spare-2": before["left-wrist"].key,
    }
    assert [order.name for order in box.orders] == ["reload"] * 3
    assert box.orders[-1].keys == {name: (key.device_id, key.key) for name, key in after.items()}


def test_a_change_that_the_box_refuses_sets_the_exit_status(box: RunningBox, bunraku: Command) -> None:
    box.done = False
    out, _ = bunraku("sensors", "revoke", "spare-1", "--box", box.box_file, status=1)
    assert "spare-1 is revoked" in out
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
    asked, ask = [0], ControlClient.ask

    def silent_first(control: ControlClient, address: str) -> Reply:
        asked[0] += 1
        if asked[0] <= silent:
            raise NoBoxError("No box answers.")
        return ask(control, address)

    monkeypatch.setattr(ControlClient, "ask", silent_first)
    monkeypatch.setattr(box_keys, "time", Clock())
    out, _ = bunraku("sensors", "revoke", "spare-1", "--box", box.box_file)
    assert "The running box took it." in out
    assert [order.name for order in box.orders] == ["reload"]


def test_a_stage_that_dances_without_show_control_has_not_taken_it(
    box: RunningBox, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:

    def no_box(client: ControlClient, address: str) -> Reply:
        raise NoBoxError("No box answers.")

    clock = Clock()
    monkeypatch.setattr(ControlClient, "ask", no_box)
    monkeypatch.setattr(box_keys, "time", clock)
    out, _ = bunraku("sensors", "revoke", "spare-1", "--box", box.box_file, status=1)
    assert "spare-1 is revoked" in out
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
    assert "No box runs here that could say whether its show wears head." in out
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
    ("arguments", "complaint"),
    [
        (["revoke", "haed"], "Did you mean 'head'?"),
        (["rename", "spare-1", "left-wrist"], "already"),
        (["rename", "spare-1", "two words"], "without spaces"),
        (["replace", "head", "spare-9"], "no sensor 'spare-9'"),
        (["replace", "head"], "or the --port of a new one. Spares: spare-1."),
        (["replace", "head", "spare-1", "--port", "/dev/ttyACM0"], "Name a spare"),
        (["revoke", "head", "--keys", "other.keys"], "not both"),
    ],
)
def test_a_refusal_is_one_clear_line(
    box: RunningBox, tmp_path: Path, bunraku: Command, arguments: list[str], complaint: str
) -> None:
    before = (tmp_path / "sensors.keys").read_bytes()
    _, err = bunraku("sensors", *arguments, "--box", box.box_file, status=2)
    assert complaint in err
    assert len(err.splitlines()) == 1
    assert (tmp_path / "sensors.keys").read_bytes() == before
    assert box.orders == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["replace", "left-wrist", "head"],
        ["replace", "spare-1", "head"],  # the names the wrong way round
        ["revoke", "head"],
        ["rename", "head", "spare-2"],
    ],
)
def test_a_sensor_of_the_show_is_taken_from_it_only_when_told_so(
    box: RunningBox, tmp_path: Path, bunraku: Command, arguments: list[str]
) -> None:
    before = (tmp_path / "sensors.keys").read_bytes()
    _, err = bunraku("sensors", *arguments, "--box", box.box_file, status=2)
    assert "head is a sensor of this show (lost)" in err
    assert "Nothing was changed. Spares: spare-1." in err and "--anyway" in err
    assert (tmp_path / "sensors.keys").read_bytes() == before
    assert box.orders == []
    bunraku("sensors", *arguments, "--anyway", "--box", box.box_file)
    assert (tmp_path / "sensors.keys").read_bytes() != before
    assert [order.name for order in box.orders] == ["reload"]


def test_a_box_that_is_off_still_knows_the_sensors_of_its_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bunraku: Command
) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "spare-1"])
    box_file = tmp_path / "box.yaml"
    settings = {"runtime": str(tmp_path / "none"), "sensors": {"keys": "sensors.keys"}}
    box_file.write_text(yaml.safe_dump({**settings, "control": {"port": 1}}))
    show = write_show(tmp_path / "show")  # left-wrist holds a joint of it
    Choice((ShowAndBox(show, box_file),)).write(tmp_path / choice.CHOSEN)
    monkeypatch.setattr(choice, "RUN", tmp_path)
    _, err = bunraku("sensors", "revoke", "left-wrist", "--box", box_file, status=2)
    assert "left-wrist is a sensor of this show (the box does not run now)" in err
    out, _ = bunraku("sensors", "revoke", "spare-1", "--box", box_file)
    assert "spare-1 is revoked" in out and "No box runs here" not in out


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
    _, err = bunraku("sensors", "revoke", "spare-1", "--box", box_file, status=2)
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
    for arguments, complaint in (
        (["--name", "two words"], "without spaces"),
        (["--name", "head", "--axes", "24"], "two hexadecimal numbers"),
        (["--name", "head", "--axes", "20,00"], "no axes"),
        (["--name", "head", "--password-file", "p"], "needs a network"),
        (["--name", "head", "--network", "n", "--password-file", "p"], "p: the password cannot be read"),
        (["--name", "head", "--network", "n"], "No password came"),
        (["--name", "head"], "There is no serial port /dev/nowhere"),
    ):
        assert complaint in bunraku("provision", "--port", "/dev/nowhere", *arguments, status=2).err
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
    reported: list[Message] = [("/sensors/reply", "/sensors/strobe", 1, ESCAPES)]
    message, _ = bunraku("sensors", "strobe", "head", "--box", str(Impostor(tmp_path, reported).box_file))
    assert "mine" in message
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", message)
