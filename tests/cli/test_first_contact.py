"""A first dance: the hand leads, the picture shows it, and nothing is said that nobody asked for."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from appliance.cli.pictures import RecordedDance, load_dance
from appliance.cli.rehearsal import PICTURED_S, pictured_from
from hw_sim.peers import free_ports
from tests.bundles import swaying_phrase, write_show
from tests.system.processes import is_running

DEADLINE_S = 60.0
pytestmark = pytest.mark.realtime


def rehearsal(folder: Path, *options: str) -> subprocess.Popen[str]:
    """`play --emulate` of a small show, with ports of its own; receivers are not named."""
    (port,) = free_ports(1)
    box = folder / "box.yaml"
    box.write_text(f"control: null\nconsole: null\nsensors: {{udp: {{host: 127.0.0.1, port: {port}}}}}\n")
    show = write_show(folder / "show")
    command = (sys.executable, "-m", "appliance.cli", "play", "--alone", "--emulate", "--show", show)
    return subprocess.Popen(
        [*command, "--box", box, *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def said_until(process: subprocess.Popen[str], text: str) -> str:
    """What it printed, up to the line with these words."""
    assert process.stdout is not None
    said = ""
    for line in process.stdout:
        said += line
        if text in line:
            return said
    raise AssertionError(said)


def test_a_default_receiver_is_nothing_to_warn_of_and_no_emulator_outlives_a_kill(tmp_path: Path) -> None:
    with rehearsal(tmp_path) as process:
        said = said_until(process, "Sensor left-wrist: neutral pose taken")
        assert "The dance goes to 127.0.0.1:9004 (ai-toolbox), should a program listen there." in said
        assert "receiver-gone" not in said
        assert "does not get the dance" not in said
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        emulators = [
            int(pid) for pid in children if b"emulate\0--keys" in Path(f"/proc/{pid}/cmdline").read_bytes()
        ]
        assert len(emulators) == 1
        process.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + DEADLINE_S
    while is_running(emulators[0]):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_first_seconds_show_a_hand_that_leads(tmp_path: Path) -> None:
    kept = ("--journal", tmp_path / "journal", "--filmstrip", tmp_path / "dance.png")
    with rehearsal(tmp_path, "--seconds", "4", *map(str, kept)) as process:
        said_until(process, "held joints highlighted")
    dance = load_dance(tmp_path / "journal")
    assert dance.holds is not None
    led = np.flatnonzero(dance.holds.max(axis=(1, 2)) > 0.5) / dance.recordings[0].fps
    assert len(led) and led[0] < 1.7  # standing still for the 1.5 s of a new sensor takes longer


@pytest.mark.parametrize(
    ("seconds", "led_from_s", "begins_s"), [(5.0, 2.0, 2.0), (30.0, 2.0, 20.0), (5.0, None, 0.0)]
)
def test_the_picture_begins_where_the_hand_leads(
    seconds: float, led_from_s: float | None, begins_s: float
) -> None:
    recording = swaying_phrase(seconds)
    holds = np.zeros((len(recording), 1, len(recording.skeleton)), np.float32)
    if led_from_s is not None:
        holds[round(50 * led_from_s) :, 0, 2] = 1.0
    assert pictured_from(RecordedDance((recording,), holds, "x")) == pytest.approx(begins_s, abs=0.03)
    assert PICTURED_S == 10.0
