"""`bunraku sensors` in the runtime folder of a box: tables, values for programs, and watching."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import yaml
from rich.console import Console

from appliance.box.roster import RosterLine
from appliance.cli.sensors import listing
from appliance.cli.sensors.table import SensorTable, duration
from appliance.sensor.keys import create_keys, load_keys
from appliance.sensor.wire import IS_NDOF, SIGNAL_SHIFT
from appliance.stage.sensor_lines import roster_lines
from tests.cli.running_box import LEFT, RunningBox
from tests.command import Command


def test_the_table_has_everything_that_the_box_knows(box: RunningBox, bunraku: Command) -> None:
    out, _ = bunraku("sensors", "--box", box.box_file)
    *first, heading, left, head, spare = out.splitlines()
    assert re.split(r"  +", heading.strip()) == [
        *("name", "state", "rate", "loss", "round trip", "age", "battery"),
        *("calibration", "neutral", "heading", "firmware", "id", "way"),
    ]
    assert re.split(r"  +", left.strip()) == [
        *("left-wrist", "linked", "50 Hz", "1.2 %", "4.2 ms", "13 ms", "12 %"),
        *("gyro 3 accel 2", "wanted", "+0°", "1.0.0", "1a2b3c4d", "192.168.4.7:2390"),
    ]
    assert re.split(r"  +", head.strip())[:7] == ["head", "lost", "-", "-", "-", "3 min", "-"]
    assert "absent" in spare
    assert "Its firmware is older." in first


def test_newer_wearables_tell_their_signal(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    box = RunningBox(tmp_path)
    box.report_sensors([LEFT._replace(flags=IS_NDOF | 8 | 5 << 4)], lambda _: "", time.monotonic())
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "signal" in out and "-70 dBm" in out
    out, _ = bunraku("sensors", "--json", "--box", box.box_file)
    (sensor,) = json.loads(out)["sensors"]
    assert (sensor["signal_dbm"], sensor["has_crystal"]) == (-70, True)
    box.close()


def test_a_drift_taken_out_and_the_time_that_a_battery_lasts_are_shown() -> None:
    (line,) = roster_lines([LEFT], lambda _: "taken", lambda _: -23.4, lambda _: 2700.0)
    console = Console(width=200, record=True, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    console.print(SensorTable([line]))
    shown = console.export_text()
    assert "-23°" in shown and "12 %, 45 min" in shown
    assert [duration(seconds) for seconds in (42.0, 90.0, 9000.0)] == ["42 s", "2 min", "2.5 h"]


def test_the_page_on_sensors_has_the_columns_that_are_printed() -> None:
    line = RosterLine(
        *("left-wrist", "1a2b3c4d", "linked", "192.168.4.7:2390", 50.0, 0.012, 0.0042, 0.013, 87, 0b00111100),
        *(6 << SIGNAL_SHIFT, "1.0.0", "", "taken", ""),
    )
    console = Console(width=200, record=True, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    console.print(SensorTable([line]))
    headings = re.split(r"\s{2,}", console.export_text().splitlines()[0].strip())
    page = (Path(__file__).resolve().parents[2] / "docs" / "sensors.md").read_text("utf-8")
    printed = re.search(r"(?m)^name  +state .+$", page)
    assert printed and re.split(r"\s{2,}", printed[0]) == headings
    explained = re.findall(
        r"`([a-z ]+)`", "".join(re.findall(r"(?m)^\| (`[a-z ]+`(?:, `[a-z ]+`)*) \|", page))
    )
    assert {*headings} - {*explained} == {"name", "firmware", "id"}


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
    reported = json.loads(out)
    assert reported["box"] is True
    left, head, spare = reported["sensors"]
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
        "battery_left_s": None,
        "calibration": {"system": 0, "gyro": 3, "accel": 2, "mag": 3},
        "has_profile": True,
        "fusion": "imuplus",
        "firmware": "1.0.0",
        "imu": "00112233445566778899aabbccddeeff",
        "neutral": "wanted",
        "heading_corrected_degrees": 0.0,
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


def test_a_box_without_a_control_port_is_listed(box: RunningBox, bunraku: Command) -> None:
    settings = yaml.safe_load(box.box_file.read_text())
    box.box_file.write_text(yaml.safe_dump({**settings, "control": None}))
    out, _ = bunraku("sensors", "--box", box.box_file)
    assert "linked" in out and "Its firmware is older." in out


def test_without_a_box_it_lists_the_key_file(tmp_path: Path, bunraku: Command) -> None:
    create_keys(tmp_path / "sensors.keys", ["left-wrist", "head"])
    box_file = tmp_path / "box.yaml"
    box_file.write_text("sensors: {keys: sensors.keys}\nruntime: none\n")
    out, _ = bunraku("sensors", "--box", box_file)
    assert "No box runs here. These sensors may come in" in out
    assert re.search(r"^left-wrist  [0-9a-f]{8}", out, re.MULTILINE)
    assert load_keys(tmp_path / "sensors.keys")["head"].key.hex() not in out
    (tmp_path / "sensors.keys").chmod(0o644)
    out, _ = bunraku("sensors", "--box", box_file)
    assert "chmod 600" in out
    out, _ = bunraku("sensors", "--json", "--box", box_file)
    reported = json.loads(out)
    assert (reported["box"], [sensor["state"] for sensor in reported["sensors"]]) == (False, [None, None])


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

    def swallow(*_: object) -> None:
        asked.append(True)
        assert len(asked) == 1, "it goes on"
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(listing, "running_stage", swallow)
    monkeypatch.setattr(time, "sleep", lambda _: None)
    bunraku("sensors", "--watch", "--box", box.box_file)
