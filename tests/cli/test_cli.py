"""The command: errors of the user are one clear message and status 2; a broken plug-in costs only itself."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from appliance.cli.app import parser, plug_ins
from appliance.dancer.material import map_reach
from appliance.pose.bvh import write_bvh
from appliance.recorder.export import export
from appliance.recorder.journal_reader import read_journal
from appliance.sensor.keys import create_keys
from appliance.show.bundle import bundled_shows, write_checksums
from appliance.show.show import load_show
from hw_sim.bundled_shows import show_folder
from tests.bundles import swaying_phrase, write_show
from tests.command import Command
from tests.recorder.night import Night


def write_box(folder: Path, text: str = "control: null\nsensors: {udp: null}") -> Path:
    """A box file; by default without ports: another box may dance on this machine."""
    box = folder / "box.yaml"
    box.write_text(text + "\n")
    return box


def packed_show(folder: Path, **options: Any) -> Path:
    """A show with its checksums."""
    show = write_show(folder / "show", **options)
    write_checksums(show)
    return show


def test_version(bunraku: Command) -> None:
    assert bunraku("version").out.startswith("bunraku ")


def test_help_names_the_commands(bunraku: Command) -> None:
    output = bunraku("--help").out
    assert all(command in output for command in ("play", "check", "filmstrip", "version"))


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("show.yaml", "name: x\ndancers: {}\n", r"show.yaml:2.*Unknown key 'dancers'.*'dancer'"),
        (
            "show.yaml",
            "name: x\ndancer: {coding_iterations: 100}\n",
            r"show.yaml:2.*coding_iterations' is 100",
        ),
        ("show.yaml", "name: x\nhands: [{sensor: a, joint: lShlder}]\n", "lShldr"),
        ("show.yaml", "name: x\ndancer: {network: other.onnx}\n", "no file 'other.onnx'"),
        ("puppet.onnx", "nonsense", "puppet.onnx.*cannot be read as a network"),
        ("phrase.bvh", "HIERARCHY\n", "phrase.bvh"),
    ],
)
def test_a_broken_show_is_refused_with_file_and_cause(
    tmp_path: Path, bunraku: Command, file: str, text: str, complaint: str
) -> None:
    show = write_show(tmp_path / "show")
    (show / file).write_text(text)
    output = bunraku(
        "play", "--show", show, "--box", str(write_box(tmp_path)), "--seconds", "1", status=2
    ).err
    assert re.search(complaint, output.replace("\n", " "))


def test_a_broken_box_file_is_refused_with_its_line(tmp_path: Path, bunraku: Command) -> None:
    box = write_box(tmp_path, "limits:\n  tick_budget: 5")
    output = bunraku("play", "--show", str(write_show(tmp_path / "show")), "--box", box, status=2).err
    assert "box.yaml:2" in output
    assert "tick_budget_ms" in output


def test_a_phrase_shorter_than_a_window_is_refused(tmp_path: Path, bunraku: Command) -> None:
    show = write_show(tmp_path / "show")
    write_bvh(show / "phrase.bvh", swaying_phrase().excerpt(0.0, 0.1))
    output = bunraku(
        "play", "--show", show, "--box", str(write_box(tmp_path)), "--seconds", "1", status=2
    ).err
    assert "5 poses" in output


def test_check_passes_a_sound_show_and_reports_its_cost(tmp_path: Path, bunraku: Command) -> None:
    show = packed_show(tmp_path)
    output = bunraku("check", show).out
    assert "the bundle is whole" in output
    assert "3 coding iterations cost" in output


def test_check_reads_a_box_file_against_the_show(tmp_path: Path, bunraku: Command) -> None:
    show = packed_show(tmp_path, lights={"fixtures": [{"name": "wash", "profile": "led-par", "address": 1}]})
    box = write_box(tmp_path, "sensors: {udp: null}")
    assert "Universe 1 has no wire, so these stay dark: wash" in bunraku("check", show, "--box", box).out
    box.write_text("outputs:\n  posistagenet: [{joints: [Chset]}]\nlights:\n  places: [{fixture: wahs}]\n")
    output = bunraku("check", show, "--box", box, status=2).err
    assert "box.yaml:2: The show's skeleton has no joint 'Chset'. Did you mean 'Chest'?" in output
    assert "box.yaml:4: The show has no fixture 'wahs'. Did you mean 'wash'?" in output


@pytest.mark.parametrize("section", ["pair: {role: first, peer: [127.0.0.2]", "locked: {leader: 127.0.0.2"])
def test_check_and_play_refuse_a_box_without_the_secret_of_its_pair(
    section: str, tmp_path: Path, bunraku: Command
) -> None:
    text = f"control: null\nsensors: {{udp: null}}\n{section}, secret: pair.key}}"
    show, box = packed_show(tmp_path), write_box(tmp_path, text)
    for command in (("check", show), ("play", "--alone", "--show", show, "--seconds", "0.2")):
        said = bunraku(*command, "--box", box, status=2).err
        assert f"Make it: bunraku pair secret {tmp_path / 'pair.key'}" in said
    (tmp_path / "pair.key").write_text("00" * 16)
    assert "the bundle is whole" in bunraku("check", show, "--box", box).out


def test_check_refuses_a_changed_file(tmp_path: Path, bunraku: Command) -> None:
    show = packed_show(tmp_path)
    (show / "phrase.bvh").write_text((show / "phrase.bvh").read_text() + "\n")
    assert "phrase.bvh" in bunraku("check", show, status=2).err


def test_check_and_play_say_the_same_of_a_changed_show(tmp_path: Path, bunraku: Command) -> None:
    show, box = packed_show(tmp_path), write_box(tmp_path)
    play = ("play", "--alone", "--show", show, "--box", box, "--seconds", "0.2")
    assert "as it was packed" not in bunraku(*play).out
    (show / "phrase.bvh").write_text((show / "phrase.bvh").read_text() + "\n")
    output = f"{show} is not as it was packed. It is danced as it is; a box takes it from no stick."
    assert output in bunraku("check", show, status=2).err
    assert output in bunraku(*play).out
    bunraku("pack", show)
    assert "as it was packed" not in bunraku(*play).out


def test_check_and_play_refuse_the_same_show(tmp_path: Path, bunraku: Command) -> None:
    show, box = packed_show(tmp_path), write_box(tmp_path)
    longer = swaying_phrase()
    longer = replace(longer, skeleton=replace(longer.skeleton, offsets=1.5 * longer.skeleton.offsets))
    write_bvh(show / "phrase.bvh", longer)
    for command in (("check", show), ("play", "--alone", "--show", show, "--box", box, "--seconds", "0.2")):
        said = bunraku(*command, status=2).err
        assert "This show cannot be danced." in said
        assert "bones are not as long" in said


def test_check_refuses_iterations_that_the_budget_cannot_hold(tmp_path: Path, bunraku: Command) -> None:
    show = packed_show(tmp_path, network="heavy")
    box = write_box(tmp_path, "limits: {tick_budget_ms: 0.5}")
    assert "3 coding iterations do not fit" in bunraku("check", show, "--box", box, status=2).err


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            "head: {device: 7, key: 000102030405060708090a0b0c0d0e0f}\n",
            "no sensor 'left-wrist' in the key file",
        ),
        ("left-wrist: {device: 7}\n", "sensors.keys:1: sensor 'left-wrist' has no key"),
        (None, "There is no key file"),
    ],
    ids=["revoked", "damaged", "absent"],
)
def test_without_a_sensors_key_check_refuses_and_play_dances(
    keys: str | None, said: str, tmp_path: Path, bunraku: Command
) -> None:
    show = packed_show(tmp_path)
    box = write_box(
        tmp_path, "sensors: {udp: {port: 0}, keys: sensors.keys}\ncontrol: null\noutputs: {osc: []}"
    )
    if keys is not None:
        (tmp_path / "sensors.keys").write_text(keys)
    assert said in bunraku("check", show, "--box", box, status=2).err
    output = bunraku("play", "--show", show, "--box", box, "--seconds", "0.2").out
    assert said in output
    assert "the dancer moves freely" in output
    assert re.search(r"Danced [1-9]\d* ticks", output)


@pytest.mark.parametrize(
    ("udp", "said"),
    [
        ("{host: 127.0.0.1, port: 0}", "it listens to this machine only"),
        ("{host: 0.0.0.0, port: 0}", ""),
        ("null", "it listens to no network"),
    ],
)
def test_a_box_that_no_wearable_reaches_is_reported(
    udp: str, said: str, tmp_path: Path, bunraku: Command
) -> None:
    show = packed_show(tmp_path)
    box = write_box(
        tmp_path, f"sensors: {{udp: {udp}, keys: sensors.keys}}\ncontrol: null\noutputs: {{osc: []}}"
    )
    create_keys(tmp_path / "sensors.keys", ["left-wrist"])
    for output in (
        bunraku("check", show, "--box", box).out,
        bunraku("play", "--show", show, "--box", box, "--seconds", "0.2").out,
    ):
        assert ("No wearable on Wi-Fi reaches the box" in output) == bool(said)
        assert said in output


def test_a_filmstrip_of_a_recording_and_of_a_journal(tmp_path: Path, bunraku: Command) -> None:
    show = write_show(tmp_path / "show")
    night = Night(show, tmp_path / "runtime")
    night.dance(100)
    folder = night.saved(tmp_path / "night.journal")
    exported = export(folder, tmp_path / "night.bunraku")
    for source in (show / "phrase.bvh", exported):
        picture = tmp_path / "picture.png"
        assert str(picture) in bunraku("filmstrip", source, "--out", picture, "--seconds", "1").out
        assert picture.read_bytes().startswith(b"\x89PNG")
        picture.unlink()


def test_a_filmstrip_of_nothing_is_refused(tmp_path: Path, bunraku: Command) -> None:
    assert "cannot be read" in bunraku("filmstrip", tmp_path / "absent.journal", status=2).err
    show = write_show(tmp_path / "show")
    assert "nothing was danced" in bunraku("filmstrip", show / "phrase.bvh", "--start", "99", status=2).err


def test_a_broken_plug_in_costs_only_its_own_commands(capsys: pytest.CaptureFixture[str]) -> None:
    broken = EntryPoint("studio", "tests.stage.no_such_module:app", "bunraku.commands")
    mine = EntryPoint("mine", "tests.cli.test_cli:plugged", "bunraku.commands")
    assert "emote" in parser("emote", plug_ins([broken, mine])).commands
    [output] = capsys.readouterr().err.splitlines()
    assert output.startswith("bunraku: the commands of 'studio' are not available here (No module named")


plugged = typer.Typer()


@plugged.command()
def emote() -> None:
    """A command of a plug-in."""


@plugged.command()
def rest() -> None:
    """Another one."""


def test_the_box_starts_without_torch_and_without_the_plug_ins() -> None:
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "from appliance.cli.app import main\n"
        "try: main(['version'])\n"
        "except SystemExit: pass\n"
        "print(sorted(m for m in sys.modules if m.startswith(('hw_sim', 'appliance.studio', 'onnxruntime'))))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_plug_in_s_command_loads_none_of_the_box_s_own() -> None:
    code = (
        "import sys; from appliance.cli.app import main\n"
        "try: main(['emulate', '--help'])\n"
        "except SystemExit: pass\n"
        "print(sorted(m for m in sys.modules if m.startswith('appliance.cli.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Usage: bunraku emulate" in done.stdout
    loaded = done.stdout.splitlines()[-1]
    assert "appliance.cli.app" in loaded and "appliance.cli.project" not in loaded


@pytest.mark.parametrize("command", ["console", "firewall", "preflight"])
def test_what_needs_the_box_file_alone_loads_no_numbers(command: str, tmp_path: Path) -> None:
    (tmp_path / "box.yaml").write_text("control: null\n")
    code = (
        "import sys; from pathlib import Path; from appliance.show.box import load_box\n"
        f"import appliance.cli.{command}\n"
        "assert load_box(Path(sys.argv[1])).control is None\n"
        "assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code, tmp_path / "box.yaml"], check=True)


def test_pack_vouches_for_a_changed_show(tiny_show: Path, tmp_path: Path, bunraku: Command) -> None:
    show = tmp_path / "mine"
    shutil.copytree(tiny_show, show)
    (show / "show.yaml").write_text((show / "show.yaml").read_text().replace("name: tiny", "name: mine"))
    assert "show.yaml" in bunraku("check", show, status=2).err
    assert "packed" in bunraku("pack", show).out
    assert "mine: the bundle is whole" in bunraku("check", show).out


def test_pack_refuses_a_show_that_cannot_be_danced(tiny_show: Path, tmp_path: Path, bunraku: Command) -> None:
    show = tmp_path / "mine"
    shutil.copytree(tiny_show, show)
    before = (show / "SHA256SUMS").read_text()
    (show / "puppet.onnx").write_bytes(b"nonsense")
    assert "puppet.onnx" in bunraku("pack", show, status=2).err
    assert (show / "SHA256SUMS").read_text() == before


@pytest.mark.parametrize(("joint", "warned"), [("Hips", True), ("Chest", False)])
def test_a_hand_on_the_hips_turns_the_figure_and_both_commands_say_so(
    tmp_path: Path, bunraku: Command, joint: str, warned: bool
) -> None:
    show = packed_show(tmp_path, hands=[{"turning": {}, "joint": joint}])
    play = ("play", "--alone", "--show", show, "--box", write_box(tmp_path), "--seconds", "0.2")
    for command in (("check", show), play):
        said = bunraku(*command).out
        assert ("'Hips' is the root of the skeleton: a hand there turns the whole figure" in said) == warned
        assert ("To lead the body hold 'Chest'" in said) == warned


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("play --alone --window", "--window does nothing with --alone"),
        ("project --offscreen 64x64 --key", "--key does nothing without --raw or --frames"),
        ("kept --out a.bvh", "--out does nothing without the NAME"),
        ("sound --show x", "--show does nothing without --file"),
        ("emulate --serial /dev/none --host 10.0.0.1 --port 1", "--host, --port do nothing with --serial"),
        ("emulate --baud 9600", "--baud does nothing without --serial"),
        ("emulate --joint head", "--joint does nothing without the motion 'trace'"),
        ("filmstrip a.journal --facing x", "--facing does nothing with a journal"),
        ("filmstrip a.bvh --show default", "--show does nothing without --look"),
    ],
)
def test_it_is_named_and_nothing_is_done(arguments: str, message: str, bunraku: Command) -> None:
    said = " ".join(bunraku(*arguments.split(), status=2).err.replace("│", " ").split())
    assert message in said and "out." in said, said


def test_an_option_that_the_user_did_not_write_is_no_reason(bunraku: Command) -> None:
    """A default counts as left out, also where it is not empty."""
    assert (
        "does nothing" not in bunraku("emulate", "--serial", "/dev/none", "--keys", "/absent/x", status=2).err
    )


SHOWS = bundled_shows()


@pytest.mark.parametrize("given", [("martial",), ("--show", "martial")])
def test_check_takes_its_name(bunraku: Command, tmp_path: Path, given: tuple[str, ...]) -> None:
    output = bunraku("check", *given, "--box", write_box(tmp_path)).out
    assert f"{load_show(SHOWS['martial']).config.name}: the bundle is whole." in output


def test_check_says_that_a_map_leads_nowhere(
    bunraku: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = write_box(tmp_path)
    assert "map is dead" not in bunraku("check", "--box", box).out
    monkeypatch.setattr(map_reach, "DEAD", 100.0)  # times its poses' difference: no map gets so far
    assert "pose.onnx: The map is dead: from corner to corner" in bunraku("check", "--box", box).out


def test_check_takes_one_show(bunraku: Command) -> None:
    assert "name one show" in bunraku("check", "martial", "--show", "default", status=2).err


@pytest.mark.parametrize("name", SHOWS)
def test_it_dances_and_its_journal_knows_it(
    bunraku: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    box, journal = write_box(tmp_path), tmp_path / "dance"
    bunraku("play", "--show", name, "--box", box, "--seconds", 1, "--alone", "--journal", journal)
    danced = read_journal(journal)
    assert danced.header["show"] == load_show(SHOWS[name]).config.name
    assert len(danced.ticks) > 20
    assert np.ptp(danced.ticks["pose"], axis=0).max() > 0.01
    assert "All are the same, bit for bit." in bunraku("replay", journal).out


def test_a_misspelt_name_is_refused_with_the_nearest(bunraku: Command) -> None:
    assert "Did you mean 'martial'" in bunraku("play", "--show", "marital", status=2).err


def test_the_simulation_finds_it_without_the_box_s_modules(tmp_path: Path) -> None:
    assert {name: show_folder(Path(name)) for name in SHOWS} == SHOWS
    assert show_folder(None) == SHOWS["default"]
    assert show_folder(tmp_path) == tmp_path
