"""`make test-quick` runs a set of tests that is written down, is not empty, and needs .venv only."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests import quick_rules

ROOT = Path(__file__).resolve().parents[1]
LINES = (ROOT / "tests" / "quick.txt").read_text().splitlines()
LISTED = [line for line in LINES if line.startswith("tests/")]
LEFT_OUT = [line.removeprefix("--ignore=") for line in LINES if line.startswith("--ignore=")]
# These start a real box, boot a machine, compile the firmware, load PyTorch, or open a browser or a window.
NEVER = ("system", "boot", "vm", "benchmarks", "deploy", "firmware", "studio", "projector", "keeper")


def files() -> set[str]:
    """Test files of the set."""
    found = set()
    for name in LISTED:
        path = ROOT / name
        below = path.rglob("test_*.py") if path.is_dir() else [path]
        found |= {str(one.relative_to(ROOT)) for one in below}
    return found - set(LEFT_OUT)


def test_every_line_names_what_is_there() -> None:
    assert [name for name in (*LISTED, *LEFT_OUT) if not (ROOT / name).exists()] == []
    assert len(set(LINES)) == len(LINES)
    assert [line for line in LINES if line not in LISTED and not line.startswith("--ignore=")] == [
        "-m",
        "not realtime and not programs and not boot",
    ]


def test_the_set_is_large_and_holds_itself() -> None:
    assert len(files()) >= 100
    assert "tests/test_quick.py" in files()
    assert "tests/stage/test_tick.py" in files()


def test_no_folder_that_needs_more_than_the_environment_is_in_the_set() -> None:
    assert [name for name in files() if name.split("/")[1] in NEVER or "browser" in name] == []


def test_make_runs_this_set_under_its_rules() -> None:
    recipe = subprocess.run(
        ["make", "--dry-run", "test-quick"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    (command,) = [line for line in recipe.splitlines() if "pytest" in line]
    assert "-p tests.quick_rules" in command and "@tests/quick.txt" in command
    assert "apt-get" not in recipe and "sudo" not in recipe.replace("sudo apt-get install -y python3", "")
    assert "ruff check ." in recipe and "ruff format --check ." in recipe


RULE_BREAKERS = """
import subprocess, sys, threading, time

def test_sleeps():
    time.sleep(0.11)

def test_starts_a_program():
    subprocess.run(["ls"], check=False, capture_output=True)

def test_starts_a_program_and_swallows_the_error():
    try:
        subprocess.run(["ip", "link"], check=False, capture_output=True)
    except OSError:
        pass

def test_loads_torch():
    try:
        import torch
    except ImportError:
        pass

def test_is_quick():
    time.sleep(0.01)
    subprocess.run([sys.executable, "-c", ""], check=True)
    subprocess.run(["git", "--version"], check=True, capture_output=True)
"""


def test_the_rules_fail_what_waits_or_needs_more(tmp_path: Path) -> None:
    (tmp_path / "test_rules.py").write_text(RULE_BREAKERS)
    (tmp_path / "torch.py").write_text("")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "tests.quick_rules", "--rootdir", tmp_path, tmp_path],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "4 failed, 1 passed" in done.stdout, done.stdout
    for broken in ("sleeps for 0.11 s", "starts ls", "starts ip", "loads PyTorch"):
        assert f"This test {broken}." in done.stdout, done.stdout


@pytest.mark.parametrize("command", ["olad", ["/usr/bin/ip", "link"], [b"Xvfb"], [Path("/sbin/mount")], []])
def test_programs_of_debian_packages_are_none_of_the_set(command: object) -> None:
    assert quick_rules.program_of(command) is not None


@pytest.mark.parametrize("command", ["git", ["/usr/bin/bash", "-c", "true"], [sys.executable], [b"make"]])
def test_programs_of_every_machine_are(command: object) -> None:
    assert quick_rules.program_of(command) is None
