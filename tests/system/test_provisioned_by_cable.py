"""From a bare board to readings: `bunraku provision` and the compiled firmware on a pseudo-terminal."""

from __future__ import annotations

import contextlib
import os
import pty
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path
from types import TracebackType

import pytest

from appliance.sensor.keys import load_keys
from appliance.sensor.link import open_link
from hw_sim.firmware_library import CompiledWearable

pytestmark = pytest.mark.realtime

PATIENCE_S = 30.0
TURN_S = 0.001
NETWORK, PASSWORD = "stage", "row H seat 7"


class BoardOnACable:
    """A new board on `device`; a thread lets its virtual time keep step with the clock on the wall."""

    def __init__(self) -> None:
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)
        self.flash = b""  # when it is over
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._live, daemon=True)

    def __enter__(self) -> BoardOnACable:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_over.set()
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)

    def _live(self) -> None:
        wearable = CompiledWearable(seed=11)
        wearable.set_network(NETWORK, PASSWORD)
        wearable.set_access_point(True, 0)
        wearable.power(True)
        wearable.connect_cable(True)
        began = time.monotonic()
        waiting = b""
        while not self._is_over.wait(TURN_S):
            with contextlib.suppress(BlockingIOError):
                waiting += os.read(self._master, 4096)
            waiting = waiting[wearable.put_serial(waiting) :]
            wearable.step_until(round((time.monotonic() - began) * 1e6))
            said = wearable.take_serial()
            if said:
                os.write(self._master, said)
        self.flash = wearable.flash_image()
        wearable.close()


def provision(board: BoardOnACable, folder: Path, *options: str) -> str:
    password = folder / "password"
    password.write_text(PASSWORD + "\n")
    command = [sys.executable, "-m", "appliance.cli", "provision", "--port", board.device]
    command += ["--keys", str(folder / "sensors.keys"), "--password-file", str(password), *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout + ended.stderr


def test_a_new_board_is_provisioned_and_its_readings_are_believed(tmp_path: Path) -> None:
    with BoardOnACable() as board:
        said = provision(board, tmp_path, "--name", "left-wrist", "--network", NETWORK)
        keys = load_keys(tmp_path / "sensors.keys")
        assert list(keys) == ["left-wrist"]
        assert keys["left-wrist"].key.hex() not in said
        assert PASSWORD not in said
        link = open_link(keys, serial=[(board.device, 115200)])
        believed = 0
        end = time.monotonic() + PATIENCE_S
        while believed < 50 and time.monotonic() < end:
            believed += len(link.drain(time.monotonic()))
            link.tend(time.monotonic())
            time.sleep(0.004)
        (state,) = link.states(time.monotonic())
        link.close()
    assert believed >= 50
    assert (state.state, state.way, state.firmware) == ("linked", board.device, "1.0.0")
    assert keys["left-wrist"].key in board.flash


def test_provisioned_anew_the_old_key_is_worth_nothing(tmp_path: Path) -> None:
    with BoardOnACable() as board:
        provision(board, tmp_path, "--name", "left-wrist", "--network", NETWORK)
        old = load_keys(tmp_path / "sensors.keys")["left-wrist"]
        provision(board, tmp_path, "--name", "left-wrist", "--network", NETWORK)
        new = load_keys(tmp_path / "sensors.keys")["left-wrist"]
    assert new.key != old.key
    assert new.key in board.flash
    assert old.key not in board.flash
