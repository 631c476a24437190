"""Show control as the process that a box runs: lean, one in a folder, ended by a signal."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from appliance.box.show_state import ShowStateReader
from appliance.levers.show_state import ShowState
from tests.show_control.doubles import PATIENCE_S, Asker, control_process

HEAVY = ("onnxruntime", "pydantic", "typer", "rich", "yaml", "moderngl", "sdl2")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_it_and_what_is_in_force_stays(
    folder: Path, tmp_path: Path, number: signal.Signals
) -> None:
    with control_process(folder, tmp_path / "words.txt") as (process, port):
        asker = Asker(port)
        assert asker.ask("/blackout", 1)[2] == 1
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == 0
        asker.close()
    assert ShowStateReader(folder).read() == ShowState(blackout=True)
    assert (tmp_path / "words.txt").read_text() in ("", "Blackout is in force. /blackout 0 lifts it.\n")
    assert not (folder / "control.sock").exists()


def test_it_loads_nothing_that_only_others_need() -> None:
    """It has to be there when everything else hangs: small, and started in a moment."""
    script = (
        "import sys, appliance.show_control.__main__, appliance.show_control.run, appliance.box.log\n"
        f"print(*({set(HEAVY)!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_second_one_in_the_same_folder_says_whose_place_it_is(folder: Path, tmp_path: Path) -> None:
    with control_process(folder, tmp_path / "words.txt") as (_, port):
        asker = Asker(port)
        assert asker.ask("/ping") == ["/pong"]
        with control_process(folder, tmp_path / "second.txt") as (second, _):
            assert second.wait(PATIENCE_S) == 1
        assert "Another show control is at work in" in (tmp_path / "second.txt").read_text()
        assert asker.ask("/ping") == ["/pong"]
        asker.close()


def test_without_its_folder_it_says_what_is_missing(tmp_path: Path) -> None:
    with control_process(tmp_path / "nowhere", tmp_path / "words.txt") as (process, _):
        assert process.wait(PATIENCE_S) == 1
    output = (tmp_path / "words.txt").read_text()
    assert "show control has no place there (No such file or directory)" in output
    assert "Traceback" not in output
