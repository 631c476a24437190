"""`python -m hw_sim emulate` as people run it: a process, real sockets, a pseudo-terminal, real signals."""

from __future__ import annotations

import csv
import signal
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from appliance.sensor.keys import create_keys, load_keys
from appliance.sensor.link import SensorLink, SensorReading, open_link
from appliance.sensor.transports.udp import UdpIntake
from hw_sim.__main__ import main
from hw_sim.senders import UdpSender
from tests.hw_sim.conftest import Emulate
from tests.hw_sim.null_modem import NullModem

pytestmark = pytest.mark.realtime

PATIENCE_S = 60.0


@pytest.fixture
def keys_path(tmp_path: Path) -> Path:
    path = tmp_path / "sensors.keys"
    create_keys(path, ["left-wrist", "head"])
    return path


@pytest.fixture
def link(keys_path: Path) -> Iterator[SensorLink]:
    link = open_link(load_keys(keys_path), udp=("127.0.0.1", 0))
    yield link
    link.close()


def port_of(link: SensorLink) -> int:
    intake = link.intakes[0]
    assert isinstance(intake, UdpIntake)
    return intake.address[1]


def tick(link: SensorLink) -> list[SensorReading]:
    """What a box does with its sensors, without its dance."""
    readings = list(link.drain(time.monotonic()))
    link.send_due(time.monotonic())
    time.sleep(0.004)
    return readings


def hear_until(link: SensorLink, is_enough: Callable[[list[SensorReading]], bool]) -> list[SensorReading]:
    readings: list[SensorReading] = []
    end = time.monotonic() + PATIENCE_S
    while not is_enough(readings):
        assert time.monotonic() < end, "the sensor was never heard"
        readings += tick(link)
    return readings


def test_the_box_hears_what_the_log_says_was_sent(
    emulate: Emulate, link: SensorLink, keys_path: Path, tmp_path: Path
) -> None:
    log = tmp_path / "sent.csv"
    process = emulate(
        "--keys", keys_path, "--port", port_of(link), "--log", log, "--stand-still", 0,
        "--sensor", "left-wrist=dance", "--sensor", "head=still",
    )  # fmt: skip
    readings = hear_until(
        link, lambda heard: len(heard) > 100 and len({reading.sensor for reading in heard}) == 2
    )
    process.terminate()
    readings += hear_until(link, lambda _: process.poll() is not None)
    while last := tick(link):
        readings += last
    assert process.returncode == 0
    assert {reading.sensor for reading in readings} == {"left-wrist", "head"}
    with log.open() as file:
        sent = {(row["sensor"], int(row["sequence"])): row for row in csv.DictReader(file)}
    for reading in readings:
        row = sent[reading.sensor, reading.sequence]
        assert reading.arrival >= float(row["sent_s"]) - 0.001
        assert float(row["sampled_s"]) - float(row["power_on_s"]) >= 0.7
        alike = sum(a * float(row[name]) for a, name in zip(reading.orientation, "wzxy", strict=True))
        assert abs(alike) > 0.9999
    counts = {reason: count for reason, count in link.counts.items() if count}
    # A reader that stood still may take the later of two sockets first, and more at once than one drain does.
    assert counts.pop("accepted") + counts.pop("reordered", 0) == len(sent)
    assert set(counts) <= {"lost", "hello", "drain_limit"}


def test_each_sensor_speaks_from_an_address_of_its_own(
    emulate: Emulate, link: SensorLink, keys_path: Path
) -> None:
    process = emulate("--keys", keys_path, "--port", port_of(link))
    hear_until(link, lambda readings: len({reading.sensor for reading in readings}) == 2)
    senders = [state.way for state in link.states(time.monotonic())]
    process.terminate()
    assert process.wait(timeout=PATIENCE_S) == 0
    assert len(set(senders)) == 2


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_cleanly(
    emulate: Emulate, link: SensorLink, keys_path: Path, number: signal.Signals
) -> None:
    process = emulate("--keys", keys_path, "--port", port_of(link))
    hear_until(link, bool)
    process.send_signal(number)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert "readings sent" in said
    assert "Traceback" not in said


def test_over_a_cable_that_is_pulled_out_and_plugged_in_again(
    emulate: Emulate, keys_path: Path, tmp_path: Path
) -> None:
    with NullModem(tmp_path) as cable:
        link = open_link(load_keys(keys_path), serial=[(str(cable.far), 115200)])
        process = emulate("--keys", keys_path, "--serial", cable.near, "--sensor", "head")
        before = hear_until(link, bool)
        cable.pull_out()
        cable.plug_in()
        after = hear_until(link, bool)
        assert {reading.sensor for reading in before + after} == {"head"}
        assert after[-1].sequence > before[-1].sequence
        assert after[-1].boot_nonce == before[-1].boot_nonce
        process.terminate()
        assert process.wait(timeout=PATIENCE_S) == 0
        link.close()


def test_a_box_is_found_by_a_name_that_has_an_ipv6_address_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Null: `localhost` has ::1 first on most machines, where no box listens."""

    def found(host: str, port: int, family: int = 0, type: int = 0) -> list[Any]:
        both = [(socket.AF_INET6, ("::1", port, 0, 0)), (socket.AF_INET, ("127.0.0.1", port))]
        return [(one, type, 17, "", address) for one, address in both if family in (0, one)]

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as box:
        box.bind(("127.0.0.1", 0))
        box.settimeout(PATIENCE_S)
        monkeypatch.setattr(socket, "getaddrinfo", found)
        sender = UdpSender("localhost", box.getsockname()[1])
        assert sender.send_packet(b"hello") and box.recv(10) == b"hello"
        sender.close()


def test_the_first_run_writes_a_key_file_for_its_owner_alone(emulate: Emulate, tmp_path: Path) -> None:
    path = tmp_path / "new.keys"
    process = emulate("--keys", path, "--count", 3, "--seconds", 0, "--port", 9)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert list(load_keys(path)) == ["left-wrist", "sensor-2", "sensor-3"]
    assert path.stat().st_mode & 0o777 == 0o600
    assert "The box must read the same file" in said
    assert len(said.strip().splitlines()) == 1, "nothing is said about sensors that were not to send"
    assert all(sensor.key.hex() not in said for sensor in load_keys(path).values())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--sensor", "head=waltz"], "there are: turning, dance, still, step, trace"),
        (["--sensor", "head", "--sensor", "head"], "different sensors"),
        (["--sensor", "head", "--count", "1"], "either --sensor or --count"),
        (["--count", "5"], "has 2 sensors, not 5"),
        (["--motion", "step", "--step-degrees", "90"], "Give at most 40"),
        (["--motion", "trace"], "--trace"),
        (["--axis", "up"], "three numbers"),
        (["--axis", "0,0,0"], "length zero"),
        (["--seconds-per-turn", "0"], "stand still"),
        (["--host", "no.such.host.invalid"], "bunraku emulate: "),
        (["--serial", "/dev/none"], "a cable carries one sensor, not 2"),
        (["--log", "/no/such/folder/log.csv"], "there is no folder /no/such/folder"),
    ],
)
def test_a_wish_that_cannot_be_met_is_one_clear_line(
    keys_path: Path, options: list[str], message: str
) -> None:
    arguments = ["emulate", "--keys", str(keys_path), "--seconds", "0", *options]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert len(done.output.strip().splitlines()) == 1


def test_so_it_is_for_who_runs_it_as_a_process(emulate: Emulate, keys_path: Path) -> None:
    process = emulate("--keys", keys_path, "--seconds", 0, "--sensor", "left-wirst")
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    assert "Did you mean 'left-wrist'?" in said
    assert len(said.strip().splitlines()) == 1


def test_without_a_box_the_status_says_so(emulate: Emulate, keys_path: Path, tmp_path: Path) -> None:
    process = emulate(
        "--keys", keys_path, "--serial", tmp_path / "absent", "--sensor", "head", "--seconds", 0.3
    )
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "Nothing could be sent" in said
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    process = emulate("--keys", keys_path, "--port", port, "--seconds", 0.3)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert "No box took these sensors" in said
