"""The page's process: what it loads, how much memory it takes, how it starts beside others and ends."""

from __future__ import annotations

import os
import signal
import socket
import time
from pathlib import Path

import pytest

from appliance.box.process_health import ProcessHealth
from appliance.cli.console import card_lines
from appliance.cli.page_address import open_console_port
from appliance.show.box import BoxConfig, load_box
from appliance.show.console import ConsoleConfig
from appliance.stage.stage_error import StageError
from hw_sim.peers import HOST
from tests.console.page import page_alone
from tests.system.processes import run, run_bunraku, wait_until

MOST_MB = 45.0
LOADED = "import sys, appliance.console.run; print(*sorted(sys.modules))"


def test_it_loads_neither_numbers_nor_networks() -> None:
    import sys

    loaded = run([sys.executable, "-c", LOADED]).stdout.split()
    assert "aiohttp" in loaded
    assert not {"numpy", "onnxruntime", "pydantic", "typer", "rich", "torch"} & set(loaded)


def test_it_takes_little_memory_tells_its_health_and_ends_when_asked(tmp_path: Path) -> None:
    with page_alone(tmp_path) as (page, process):
        assert page.get("/").status == 200
        status = Path(f"/proc/{process.process.pid}/status").read_text()
        resident_mb = (
            next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1024
        )
        assert resident_mb < MOST_MB
        health = ProcessHealth(tmp_path / "runtime")
        (member,) = wait_until(lambda: health.members(time.monotonic()))
        assert (member.process, member.late) == ("console", False)
        assert process.end(signal.SIGTERM) == 0
        assert not health.fallbacks(time.monotonic()), "it ended as it should"


def test_the_test_card_tells_address_and_pin_of_the_page_that_runs(tmp_path: Path) -> None:
    assert card_lines(BoxConfig(runtime=tmp_path / "runtime")) == (), "no page runs"
    with page_alone(tmp_path) as (page, _):
        assert card_lines(load_box(page.box_file)) == (f"page {page.origin}", f"pin {page.pin}")


def test_a_killed_page_is_told_as_a_fallback(tmp_path: Path) -> None:
    with page_alone(tmp_path) as (page, process):
        health = ProcessHealth(tmp_path / "runtime")
        wait_until(lambda: health.members(time.monotonic()))
        process.end(signal.SIGKILL)
        process.start()
        wait_until(page.is_open)
        wait_until(lambda: [one.name for _, one in health.fallbacks(time.monotonic())] == ["console-died"])


def test_a_box_file_without_a_page_is_no_failure(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("console: null\n")
    done = run_bunraku("console", "--box", tmp_path / "box.yaml")
    assert done.returncode == os.EX_CONFIG and "serves no page" in done.stderr


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("host: 0.0.0.0", "no device may open it"),
        ("host: hall.local", "is not an address in numbers"),
        ("{host: '::', viewers: [192.168.0]}", "neither an address nor a network"),
        ("port: 70000", "65535"),
        ("prot: 80", "port"),
    ],
)
def test_a_mistake_in_the_box_file_has_its_line_and_cure(tmp_path: Path, settings: str, message: str) -> None:
    if not settings.startswith("{"):
        settings = f"{{{settings}}}"
    (tmp_path / "box.yaml").write_text(f"console: {settings}\n")
    done = run_bunraku("console", "--box", tmp_path / "box.yaml")
    assert done.returncode == 2 and message in done.stderr and "box.yaml" in done.stderr


def test_a_taken_port_is_said_and_beside_a_stage_another_one_serves() -> None:
    with socket.create_server((HOST, 0)) as taken:
        wanted = ConsoleConfig(host=HOST, port=taken.getsockname()[1])
        with pytest.raises(StageError, match="cannot be opened for the page"):
            open_console_port(wanted)
        with open_console_port(wanted, or_any=True) as other:
            assert other.getsockname()[1] != wanted.port


def test_its_help_says_how_the_page_starts_and_what_each_command_does() -> None:
    output = " ".join(run_bunraku("console", "--help").stdout.split())
    assert "`bunraku play` starts it by itself and prints its address and PIN." in output
    assert "Example: bunraku console --box box.yaml" in output
    for command, sentence in (
        ("pin", "Print the PIN that a device gives once"),
        ("devices", "List the devices that gave the PIN"),
        ("revoke", "Forget a device: it needs the PIN again"),
    ):
        assert f" {command} {sentence}" in output
