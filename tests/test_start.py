"""The quick start of `play` understands its options as the full parser does."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main

from appliance.cli import app as cli
from appliance.cli.play import PlayOptions
from appliance.start import options_of_play


def play_command() -> typer.main.TyperCommand:  # type: ignore[name-defined]
    group = typer.main.get_command(cli.command_line())
    return group.commands["play"]  # type: ignore[attr-defined,no-any-return]


@pytest.mark.parametrize(
    ("given", "understood"),
    [
        (["play"], {}),
        (["play", "--alone"], {"alone": True}),
        (
            ["play", "--alone", "--chosen", "/run/chosen.json"],
            {"alone": True, "chosen": Path("/run/chosen.json")},
        ),
        (["play", "--show=a", "--box", "b.yaml"], {"show": Path("a"), "box": Path("b.yaml")}),
        (["play", "--seconds", "2.5", "--journal", "j"], {"seconds": 2.5, "journal": Path("j")}),
    ],
)
def test_plain_options_of_play_are_understood(given: list[str], understood: dict[str, object]) -> None:
    assert options_of_play(given) == understood


@pytest.mark.parametrize(
    "line",
    [
        "",
        "check",
        "--help",
        "play --help",
        "play show",
        "play --emulate",
        "play --rehearse x.png",
        "play --shwo x",
        "play --show",
        "play --show --alone",
        "play --alone=yes",
        "play --seconds soon",
        "play --seconds 0.01",
        "play --seconds nan",
        "play --show a --chosen c",
        "play --box= --alone",
        "play -- --alone",
    ],
)
def test_everything_else_is_left_to_the_full_parser(line: str) -> None:
    assert options_of_play(line.split()) is None


def test_plain_options_are_known_to_the_parser_and_to_what_plays() -> None:
    line = "play --show a --box b --journal c --seconds 1 --alone"
    given = options_of_play(line.split()) or {}
    options = {parameter.name for parameter in play_command().params}
    assert given.keys() | {"chosen"} <= options == {one.name for one in dataclasses.fields(PlayOptions)}


def test_an_error_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("sensors: {udp: {prot: 1}}\n")
    play = [sys.executable, "-m", "appliance.start", "play"]
    command = [*play, "--alone", "--box", str(tmp_path / "box.yaml")]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == cli.REFUSED
    assert ran.stderr.startswith("bunraku: ") and "prot" in ran.stderr and "Traceback" not in ran.stderr


def test_play_loads_neither_parser_nor_simulation_nor_other_processes() -> None:
    """Loading modules prolongs the black stage after a crash."""
    loaded = loaded_by("appliance.start", "appliance.cli.play")
    needless = {"typer", "rich", "click", "hw_sim", "matplotlib", "onnx", "torch", "subprocess"}
    needless |= {f"appliance.{name}" for name in ("cli.emulation", "cli.app", "cli.companions", "projector")}
    assert not loaded & needless


def test_beside_its_companions_play_loads_no_web_server() -> None:
    """Only the page's own process needs it: 12 MB of locked memory."""
    loaded = loaded_by("appliance.cli.play", "appliance.cli.control", "appliance.cli.console")
    assert "aiohttp" not in loaded and "ssl" not in loaded


def loaded_by(*modules: str) -> set[str]:
    text = f"import sys, {', '.join(modules)}; print(*sorted(sys.modules))"
    ran = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return set(ran.stdout.split())
