"""The preflight as a process: shows from a stick and releases, checked, and what is chosen or refused."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from appliance.dancer.phrase_cache import FOLDER, SUFFIX
from appliance.release.choice import APPLIANCE_BOX, EMBEDDED_SHOW
from appliance.show.box import load_box
from appliance.show.bundle import checksum_problems, write_checksums
from tests.system.box_folders import Machine
from tests.system.processes import run

HEAVY = {
    *("numpy", "onnxruntime", "yaml", "pydantic", "typer"),
    *("argparse", "subprocess", "dataclasses", "hashlib"),
}


def test_a_show_from_the_stick_is_chosen_and_the_built_in_box_file(machine: Machine) -> None:
    machine.bring("Spring")
    done = machine.preflight()
    assert (done.returncode, done.stderr) == (0, "")
    assert machine.dances == "Spring"
    box = load_box(machine.choice.first.box)
    assert (box.runtime, box.state) == (machine.run, machine.data / "state")
    assert box.sensors.udp is not None
    assert box.sensors.udp.host == "0.0.0.0"


def test_the_built_in_box_file_is_sound() -> None:
    box = load_box(APPLIANCE_BOX)
    assert box.sensors.keys == Path("/data/bunraku/keys/sensors.keys")
    assert (box.runtime, box.journal.folder) == (Path("/run/bunraku"), Path("/data/bunraku/journal"))


def test_a_show_that_was_checked_is_prepared_for_its_first_start(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    show = machine.choice.first.show
    assert list((show / FOLDER).glob(f"*{SUFFIX}")), "each power-on would read its phrase again"
    assert not checksum_problems(show)


def test_without_a_show_what_comes_with_the_box_is_chosen(machine: Machine) -> None:
    assert machine.preflight().returncode == 0
    assert machine.choice.first.show == EMBEDDED_SHOW


def test_a_typing_error_is_refused_with_file_line_and_cure(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    file = machine.stick / "show" / "show.yaml"
    file.write_text(file.read_text().replace("coding_iterations", "coding_iteratons"))
    write_checksums(machine.stick / "show")
    done = machine.preflight()
    assert done.returncode == 0
    assert machine.dances == "Spring"
    refused = " ".join(machine.choice.refused)
    assert f"{file}:" in refused
    assert "Did you mean 'coding_iterations'?" in refused
    assert set(machine.choice.refused) <= set(done.stdout.splitlines())


@pytest.mark.parametrize("name", ["puppet.onnx", "phrase.bvh"])
def test_a_damaged_file_is_refused(machine: Machine, name: str) -> None:
    show = machine.bring("Spring")
    with (show / name).open("r+b") as stream:
        stream.seek(100)
        stream.write(b"\0\1\2\3 damaged \0")
    machine.preflight()
    assert machine.choice.first.show == EMBEDDED_SHOW
    assert name in " ".join(machine.choice.refused)


def test_a_box_file_that_does_not_fit_leaves_the_show(machine: Machine) -> None:
    machine.bring("Spring")
    (machine.stick / "box.yaml").write_text("outputs:\n  osc:\n    - {hots: 10.0.0.1}\n")
    machine.preflight()
    assert machine.dances == "Spring"
    assert f"{machine.stick}/box.yaml:3" in " ".join(machine.choice.refused)


def test_a_missing_run_folder_is_reported(machine: Machine) -> None:
    machine.run.rmdir()
    done = machine.preflight()
    assert done.returncode == 1
    assert "The audience sees the show that comes with the box" in done.stdout


def test_a_wrong_option_ends_with_two(machine: Machine) -> None:
    assert machine.preflight("--stik=x").returncode == 2


def test_with_nothing_new_nothing_heavy_is_imported(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from appliance.cli.preflight import Options, preflight\n"
        f"folders = [Path(one) for one in {[str(one) for one in machine.options[:4]]}]\n"
        "assert preflight(Options(*folders), print, 10.0) == 0\n"
        f"print(*({HEAVY} & set(sys.modules)))\n"
    )
    done = run([sys.executable, "-c", code], check=True)
    assert done.stdout.strip() == ""


def test_a_release_that_can_dance(machine: Machine) -> None:
    done = machine.preflight("--check-release")
    assert done.returncode == 0, done.stderr
    assert "This release can dance here." in done.stdout
    assert not list(machine.run.iterdir())


def test_a_release_that_does_not_dance_the_boxs_show_is_refused(machine: Machine) -> None:
    machine.bring("Spring")
    machine.preflight()
    assert machine.dances == "Spring"  # else the next line would damage the embedded show
    (machine.choice.first.show / "puppet.onnx").write_bytes(b"what another release could read")
    done = machine.preflight("--check-release")
    assert done.returncode == 1
    assert "does not dance it" in done.stderr
