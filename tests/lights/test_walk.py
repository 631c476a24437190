"""`bunraku lights test` and `show`: every attribute is walked, alone, and the rig can be looked at."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from appliance.box.runtime_folder import Claim
from appliance.lights.patch import Patch
from appliance.lights.walk import Walk, introduction, steps, walk
from appliance.show.bundle import default_show_path
from hw_sim.dmx.artnet import ArtNetReceiver
from hw_sim.peers import HOST
from tests.command import Command
from tests.lights.rigs import lights
from tests.logged import said

PAR = {"name": "par", "profile": "led-par", "mode": "RGBW", "address": 1}
HEAD = {"name": "head", "profile": "moving-wash", "address": 21, "place": [2, 4, 0]}
LAMP = {"name": "lamp", "profile": "rgb", "universe": 2, "address": 1}
RULES = [{"reads": "place", "drives": "aim"}, {"reads": "speed", "drives": "dimmer"}]


def patch_of(*fixtures: dict[str, Any]) -> Patch:
    return Patch(lights(fixtures).fixtures, None)


def walked(patch: Patch, fixtures: tuple[str, ...] = (), attribute: str | None = None) -> Any:
    """All levels of a walk at 40 Hz, and what was said."""
    shown: list[dict[int, bytes]] = []
    said.clear()

    def show(levels: dict[int, bytes]) -> float:
        shown.append(levels)
        return len(shown) / 40.0

    walk(patch, list(steps(patch, fixtures, attribute)), 1.0, 40.0, show, lambda: False)
    return shown, said.copy()


def test_every_attribute_of_every_fixture_is_walked_in_the_order_of_the_patch() -> None:
    _, said = walked(patch_of(PAR, HEAD, LAMP))
    assert said[0] == "par (led-par): universe 1, channels 1 to 6"
    assert [line.split(",")[0].strip() for line in said[1:7]] == [
        *("dimmer", "red", "green", "blue", "white", "strobe")
    ]
    assert said[7] == "head (moving-wash): universe 1, channels 21 to 32"
    assert said[8].startswith("  pan, channel 21 and 22:")
    assert said[-6].startswith("  aim, points at the origin of the stage")
    assert said[-5] == "lamp (rgb): universe 2, channels 1 to 3"
    assert said[-1].startswith("  dimmer, by its colours")


def test_each_attribute_goes_through_its_whole_range_while_its_fixture_alone_is_lit() -> None:
    shown, _ = walked(patch_of(PAR, HEAD), ("par",), "red")
    levels = np.array([list(one[1]) for one in shown])
    assert levels[:, 1].max() > 245 and levels[-1, 1] == 0
    assert levels[1:-1, 0].min() == 255  # its dimmer is open
    assert levels[:, 2:5].max() == 0  # the other colours are off
    assert levels[:, 24:26].max() == 0  # the head is dark
    assert not any(shown[-1][1])


def test_pan_goes_to_both_ends_and_aim_points_at_the_stage() -> None:
    patch = patch_of({**HEAD, "pan_limits": [-100, 100]})
    shown, _ = walked(patch, (), "pan")
    pan = np.array([one[1][20] * 256 + one[1][21] for one in shown[1:-1]]) / 65535 * 540 - 270
    assert pan.min() == pytest.approx(-100, abs=2)
    assert pan.max() == pytest.approx(100, abs=2)
    moving = Walk(patch)
    [step] = steps(patch, (), "aim")
    for _ in range(100):
        moving.levels(step, 0.5, 0.025)
    wanted = np.array([0, 1.2, 0]) - [2, 4, 0]
    np.testing.assert_allclose(patch.heads.beams()[0], wanted / np.linalg.norm(wanted), atol=1e-3)


def held_up(patch: Patch, attribute: str) -> Any:
    """Levels (passes, 512) of a walk of which each tenth pass comes a second late."""
    shown: list[list[int]] = []
    now = 0.0

    def show(levels: dict[int, bytes]) -> float:
        nonlocal now
        shown.append(list(levels[1]))
        now += 0.025 if len(shown) % 10 else 1.0
        return now

    walk(patch, list(steps(patch, (), attribute)), 0.4, 40.0, show, lambda: False)
    return np.array(shown)


def test_a_delayed_walk_skips_no_peak() -> None:
    assert held_up(patch_of(PAR), "red")[:, 1].max() > 230


def test_a_delayed_head_reaches_both_ends_and_moves_no_faster() -> None:
    patch = patch_of(HEAD)
    levels = held_up(patch, "pan")[1:-1]
    pan = (levels[:, 20] * 256 + levels[:, 21]) / 65535 * 540
    assert np.ptp(pan) > 530
    assert np.abs(np.diff(pan)).max() <= patch.heads.axes.slew.max() * 0.041


def test_a_walk_at_a_slow_rate_takes_no_longer() -> None:
    shown: list[dict[int, bytes]] = []

    def show(levels: dict[int, bytes]) -> float:
        shown.append(levels)
        return len(shown) / 5.0

    patch = patch_of(PAR)
    walk(patch, list(steps(patch, (), "red")), 2.0, 5.0, show, lambda: False)
    assert len(shown) == 2 + 10


def test_an_introduction_names_universe_and_channels() -> None:
    assert introduction(patch_of(LAMP), "lamp") == "lamp (rgb): universe 2, channels 1 to 3"


@pytest.fixture
def show(tmp_path: Path) -> Path:
    """The show that comes along, with a rig."""
    folder = tmp_path / "show"
    shutil.copytree(default_show_path(), folder)
    rig = {"fixtures": [PAR, HEAD], "mappings": [{"name": "warm", "rules": RULES}]}
    with (folder / "show.yaml").open("a") as file:
        file.write(yaml.safe_dump({"lights": rig}))
    return folder


def box(folder: Path, port: int) -> Path:
    (folder / "run").mkdir(mode=0o700, exist_ok=True)
    wires = [{"universe": 1, "wire": "artnet", "host": HOST, "port": port}]
    values = {"runtime": str(folder / "run"), "outputs": {"dmx": wires}}
    path = folder / "box.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "appliance.cli", "lights", *arguments]


def test_the_walk_reaches_the_wire_and_ends_in_zeros(show: Path, tmp_path: Path) -> None:
    with ArtNetReceiver(HOST) as receiver:
        file = box(tmp_path, receiver.port)
        arguments = ("test", "--show", str(show), "--box", str(file), "--fixture", "par", "--seconds", "0.4")
        done = subprocess.run(command(*arguments), capture_output=True, text=True, check=True)
        packets = [packet.levels for _, packet in receiver.poll(0.2)]
    assert "6 steps of 0.4 s" in done.stdout
    assert "par (led-par): universe 1, channels 1 to 6" in done.stdout
    for channel in range(6):
        assert max(levels[channel] for levels in packets) > 200, channel
    assert not any(packets[-1])


def test_ctrl_c_ends_the_walk_in_the_dark(show: Path, tmp_path: Path) -> None:
    with ArtNetReceiver(HOST) as receiver:
        file = box(tmp_path, receiver.port)
        arguments = ("test", "--show", str(show), "--box", str(file), "--seconds", "600")
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        walking = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, env=environment)
        packets = []
        until = time.monotonic() + 60.0
        while not any(any(levels) for levels in packets):
            assert time.monotonic() < until and walking.poll() is None
            packets += [packet.levels for _, packet in receiver.poll(0.5)]
        walking.terminate()
        assert walking.wait(60.0) == 0
        packets += [packet.levels for _, packet in receiver.poll(0.5)]
        walking.stdout.close()
    assert not any(packets[-1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("--fixture", "pra"), "Did you mean 'par'?"), (("--attribute", "dimer"), "Did you mean 'dimmer'?")],
)
def test_unknown_names_are_refused_with_the_nearest(
    show: Path, tmp_path: Path, arguments: tuple[str, ...], message: str, bunraku: Command
) -> None:
    file = box(tmp_path, 9)
    said = " ".join(
        bunraku("lights", "test", "--show", show, "--box", file, *arguments, status=2).err.split()
    )
    assert message in said and arguments[0] in said and "show.yaml" not in said


def test_a_walk_beside_running_lights_is_refused(show: Path, tmp_path: Path, bunraku: Command) -> None:
    file = box(tmp_path, 9)
    claim = Claim(tmp_path / "run", "lights")
    assert "Another lights runs" in bunraku("lights", "test", "--show", show, "--box", file, status=2).err
    claim.close()


def test_a_box_without_a_wire_is_told_what_to_add(show: Path, tmp_path: Path, bunraku: Command) -> None:
    for command in (["lights", "test"], ["lights"]):
        output = bunraku(*command, "--show", show, status=os.EX_CONFIG).err
        assert "No wire leads to the lights. Add one under outputs: dmx:" in output


def test_the_rig_is_printed_and_drawn(show: Path, tmp_path: Path, bunraku: Command) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "rig.png"
    said = bunraku("lights", "show", "--show", show, "--box", box(tmp_path, 9), "--out", picture).out
    for text in ("par", "led-par", "21 to 32", "hanging", "rig.png"):
        assert text in said
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_picture_shows_where_heads_point_in_the_chosen_mapping(
    show: Path, tmp_path: Path, bunraku: Command
) -> None:
    pytest.importorskip("matplotlib")
    text = (show / "show.yaml").read_text()
    away = "  - {name: away, rules: [{reads: steady, drives: aim, at: [-3, 0, 3]}]}\n"
    (show / "show.yaml").write_text(text.replace("  mappings:\n", f"  mappings:\n{away}"))
    pictures = []
    for mapping in ("away", "warm"):
        pictures.append(tmp_path / f"{mapping}.png")
        bunraku("lights", "show", "--show", show, "--out", pictures[-1], "--mapping", mapping)
    assert pictures[0].read_bytes() != pictures[1].read_bytes()
    assert (
        "Did you mean 'warm'?" in bunraku("lights", "show", "--show", show, "--mapping", "wram", status=2).err
    )


def test_wires_without_fixtures_are_told(tmp_path: Path) -> None:
    from appliance.show.box import load_box
    from appliance.show.show import load_show
    from appliance.show.venue_rig import unwired

    [sentence] = unwired(load_show(default_show_path()).config, load_box(box(tmp_path, 9)))
    assert "wires for lights, but this show has no fixtures" in sentence
    assert unwired(load_show(default_show_path()).config, load_box(None)) == []
