"""The real `bunraku provision` and `sensors`: box, key file and wearable agree; no secret leaks."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
import termios
import time
from pathlib import Path
from typing import Any

import pytest

from appliance.recorder import chunks
from appliance.recorder.journal_reader import segments_of
from appliance.sensor.keys import SensorKey, load_keys
from appliance.sensor.link import open_link
from appliance.sensor.provisioning.wearable_console import WearableConsole
from hw_sim.firmware_library import State
from tests.system.bench import NETWORK, PASSWORD, Bench
from tests.system.box import JOURNAL, Box, playing
from tests.system.processes import BUNRAKU, PATIENCE_S, run, run_bunraku, wait_until
from tests.system.snoop import Snoop

pytestmark = pytest.mark.realtime

ON_A_TERMINAL = (
    sys.executable,
    "-c",
    "import fcntl, os, sys, termios\n"
    "os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0)\n"
    "os.execv(sys.argv[1], sys.argv[1:])",
)


def bunraku(*arguments: str, stdin: str = "", status: int = 0) -> str:
    """The output of a command that ends with this status; repeated while a slow box does not answer."""
    command, output = arguments, ""

    def has_ended() -> bool:
        nonlocal command, output
        done = run_bunraku(*command, stdin=stdin)
        output += done.stdout + done.stderr
        assert "Traceback" not in done.stderr
        assert done.returncode == status or "not answer" in output, output
        if arguments[:2] not in (
            ("sensors", "strobe"),
            ("sensors", "neutral"),
        ):  # the key file is changed already
            command = ("sensors", "reload", "--box", arguments[arguments.index("--box") + 1])
        return done.returncode == status

    wait_until(has_ended, lambda: output)
    return output


def provision(bench: Bench, *arguments: str, status: int = 0, password: str = PASSWORD + "\n") -> str:
    network = ("--network", NETWORK) if password else ()
    return bunraku("provision", "--port", bench.device, *network, *arguments, stdin=password, status=status)


def resting_box(folder: Path) -> str:
    """The box file of a box that does not run; without a control port, no other box is asked."""
    path = folder / "resting.yaml"
    path.write_text("sensors: {keys: sensors.keys}\ncontrol: null\n")
    return str(path)


def await_state(box: Box, name: str, state: str) -> dict[str, Any]:
    """Wait until the box lists the sensor in this state."""

    def listed() -> dict[str, Any] | None:
        sensor = box.listed_sensors().get(name, {})
        return sensor if sensor.get("state") == state else None

    sensor = wait_until(listed, lambda: f"{name} is not {state}: {box.output}")
    assert sensor is not None
    return sensor


def test_a_running_box_lets_a_new_wearable_in_replaces_it_and_forgets_it(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path) as box, Bench(box.sensors) as bench:
        box.frames(1)
        said = provision(bench, "--name", "left-wrist", "--box", str(box.box_file))
        assert "The running box took it. The box knows 1 sensor now." in said
        assert f"looks for its box on '{NETWORK}'" in said
        assert "listens to this machine only" in said
        bench.pull_out()
        box.frame_that(lambda frame: frame[2] > 0)
        sensor = await_state(box, "left-wrist", "linked")
        assert sensor["firmware"] == "1.0.0"
        assert sensor["way"].startswith("127.0.0.1:")
        assert sensor["imu"]
        assert "flashes for 10 s" in bunraku("sensors", "strobe", "left-wrist", "--box", str(box.box_file))
        assert "stand still now" in bunraku("sensors", "neutral", "--box", str(box.box_file))
        table = bunraku("sensors", "--box", str(box.box_file))
        assert "gyro" in table
        assert "linked" in table

        with Bench(box.sensors) as spare:
            bench.plug_in()
            message = bunraku(
                *("sensors", "replace", "left-wrist", "--port", spare.device, "--network", NETWORK),
                *("--box", str(box.box_file)),
                stdin=PASSWORD + "\n",
            )
            assert "left-wrist has its new key" in message
            spare.pull_out()
            await_state(box, "left-wrist", "linked")
            assert spare.state == State.LINKED
            assert f"{box.listed_sensors()['left-wrist']['id']}" != sensor["id"]
            assert "left-wrist is revoked" in bunraku(
                "sensors", "revoke", "left-wrist", "--anyway", "--box", str(box.box_file)
            )
            assert box.listed_sensors() == {}
            box.await_output("but not left-wrist of this show: the dancer moves freely there")
            wait_until(lambda: spare.state != State.LINKED)
        assert box.end() == 0


def test_a_spare_takes_over_the_name_while_the_box_plays(show: Path, tmp_path: Path) -> None:
    with playing(show, tmp_path, names=["left-wrist", "spare-1"]) as box, Bench(box.sensors) as spare:
        box.frames(1)
        before = load_keys(tmp_path / "sensors.keys")
        provision(spare, "--name", "spare-1", "--box", str(box.box_file))
        spare.pull_out()
        await_state(box, "spare-1", "linked")
        message = bunraku("sensors", "replace", "left-wrist", "spare-1", "--box", str(box.box_file))
        assert "left-wrist is now the sensor that was spare-1" in message
        assert "took it" in message
        box.frame_that(lambda frame: frame[2] > 0)
        assert box.listed_sensors()["left-wrist"]["state"] == "linked"
        assert box.listed_sensors()["spare-1"]["id"] == f"{before['left-wrist'].device_id:08x}"
        assert box.end() == 0


def test_a_new_board_s_readings_are_accepted_by_cable(tmp_path: Path) -> None:
    with Bench() as bench:
        provision(bench, "--name", "left-wrist", "--box", resting_box(tmp_path))
        keys = load_keys(tmp_path / "sensors.keys")
        link, accepted = open_link(keys, serial=[(bench.device, 115200)]), []

        def drain() -> bool:
            accepted.extend(link.drain(time.monotonic()))
            link.send_due(time.monotonic())
            return len(accepted) >= 50

        wait_until(drain, "the readings stop", lambda: time.sleep(0.004))
        (state,) = link.states(time.monotonic())
        link.close()
    assert (state.state, state.way, state.firmware) == ("linked", bench.device, "1.0.0")


def test_provisioned_again_the_old_key_is_nowhere_in_the_flash(tmp_path: Path) -> None:
    keys = []
    with Bench() as bench:
        for _ in range(2):
            provision(bench, "--name", "left-wrist", "--box", resting_box(tmp_path))
            keys.append(load_keys(tmp_path / "sensors.keys")["left-wrist"].key)
        old, new = keys
        assert new != old
        assert new in bench.flash()
        assert old not in bench.flash()


def test_a_cable_pulled_at_the_save_is_mended_by_another_run(tmp_path: Path) -> None:
    keys = tmp_path / "sensors.keys"
    with Bench() as bench:
        provision(bench, "--name", "left-wrist", "--box", resting_box(tmp_path), password="")
        first = load_keys(keys)
        bench.pulls_at = b"save\n"
        message = provision(
            bench, "--name", "left-wrist", "--box", resting_box(tmp_path), password="", status=2
        )
        assert "may or may not have its new key" in message
        assert load_keys(keys) == first
        bench.plug_in()
        provision(bench, "--name", "left-wrist", "--box", resting_box(tmp_path), password="")
        second = load_keys(keys)["left-wrist"]
        assert (second.device_id, second.key != first["left-wrist"].key) == (
            first["left-wrist"].device_id,
            True,
        )
        with WearableConsole(bench.device) as console:
            console.identify()
            assert console.proves(second.key)
            assert not console.proves(first["left-wrist"].key)


def test_a_box_that_holds_the_cable_is_named(show: Path, tmp_path: Path) -> None:
    with Bench() as bench:
        settings = {"sensors": {"serial": [{"device": bench.device}]}}
        with playing(show, tmp_path, settings=settings) as box:
            box.frames(10)
            message = provision(
                bench, "--name", "left-wrist", "--box", str(box.box_file), password="", status=2
            )
            assert "in use by another program. Stop the running bunraku" in message
            assert box.end() == 0


def test_the_password_is_read_on_the_terminal_without_echo(tmp_path: Path) -> None:
    keys = tmp_path / "sensors.keys"
    with Bench() as bench:
        command = [*BUNRAKU, "provision", "--port", bench.device, "--name", "head"]
        command += ["--box", resting_box(tmp_path), "--network", NETWORK]
        master, slave = pty.openpty()
        process = subprocess.Popen([*ON_A_TERMINAL, *command], stdin=slave, stdout=slave, stderr=slave)
        os.close(slave)
        try:
            shown = read_until(master, b"open network): ")
            assert not termios.tcgetattr(master)[3] & termios.ECHO
            os.write(master, PASSWORD.encode() + b"\n")
            shown += read_until(master, b"head is ready")
            assert process.wait(PATIENCE_S) == 0
        finally:
            process.kill()
            process.wait()
            os.close(master)
        assert PASSWORD.encode() in bench.flash()
    assert PASSWORD.encode() not in shown
    assert load_keys(keys)["head"].key.hex().encode() not in shown


def read_until(master: int, wanted: bytes) -> bytes:
    shown, until = b"", time.monotonic() + PATIENCE_S
    while wanted not in shown:
        assert select.select([master], [], [], until - time.monotonic())[0], shown
        shown += os.read(master, 4096)
    return shown


def as_processes(*arguments: str, stdin: str) -> subprocess.CompletedProcess[str]:
    return run([*BUNRAKU, *arguments], input=stdin, timeout=120)


def test_no_secret_is_visible_to_other_users(
    show: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    password_file = tmp_path / "password"
    password_file.write_text(PASSWORD + "\n")
    password_file.chmod(0o600)
    monkeypatch.setattr(sys.modules[__name__], "run_bunraku", as_processes)  # others see those in /proc
    snoop, before, said = Snoop(tmp_path), os.umask(0), ""
    try:
        with playing(show, tmp_path, settings=JOURNAL) as box, Bench(box.sensors) as bench, snoop:
            box.frames(1)
            secrets = secrets_of(box.key)
            for name in ("left-wrist", "spare-1"):
                said += provision(
                    bench, "--name", name, "--password-file", str(password_file), "--box", str(box.box_file)
                )
                secrets += secrets_of(load_keys(tmp_path / "sensors.keys")[name])
            said += provision(bench, "--name", "x y", "--box", str(box.box_file), status=2)
            bench.pull_out()
            await_state(box, "spare-1", "linked")
            said += bunraku("sensors", "--box", str(box.box_file))
            said += bunraku("sensors", "--json", "--box", str(box.box_file))
            said += bunraku("sensors", "replace", "left-wrist", "spare-1", "--box", str(box.box_file))
            box.frame_that(lambda frame: frame[2] > 0)
            assert box.end() == 0
            said += box.output
    finally:
        os.umask(before)
    seen = b"".join(snoop.seen)
    segments = segments_of(tmp_path / "run.journal")
    recorded = [one.data for _, segment in segments for one in chunks.chunks(segment)]
    assert recorded
    assert NETWORK.encode() in seen  # the snoop works
    for secret in secrets:
        assert secret not in seen
        assert secret not in said.encode()
        for path in filter(Path.is_file, tmp_path.rglob("*")):
            assert secret not in path.read_bytes() or path.stat().st_mode & 0o077 == 0, path
        assert all(secret not in data for data in recorded)
    keys = [(name, mode) for name, mode in snoop.readable if "keys" in name]
    assert keys
    assert all(mode == 0o600 for _, mode in keys), keys


def secrets_of(sensor: SensorKey) -> list[bytes]:
    return [sensor.key, sensor.key.hex().encode(), sensor.key.hex().upper().encode(), PASSWORD.encode()]
