"""Three distributions of one version: each installs alone, and names the cure for commands of the others."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_string
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from typer.main import get_command

from appliance.cli.app import plug_ins
from appliance.cli.distributions import DISTRIBUTIONS, PLUG_INS
from hw_sim.peers import free_ports
from tests.conftest import ROOT

FOLDERS = {"bunraku": ".", "bunraku-sim": "distributions/sim", "bunraku-studio": "distributions/studio"}
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
OWN = ("appliance", "hw_sim", "bunraku", "__editable__")


def test_the_table_of_commands_is_what_the_distributions_bring() -> None:
    points = {point.name: point for point in entry_points(group=PLUG_INS)}
    for one in DISTRIBUTIONS:
        declared = tomllib.loads((ROOT / FOLDERS[one.name] / "pyproject.toml").read_text())["project"]
        assert declared["name"] == one.name
        assert declared["entry-points"][PLUG_INS] == {one.plug_in: points[one.plug_in].value}
        [group] = plug_ins([points[one.plug_in]])
        assert set(get_command(group).commands) == set(one.commands)  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The wheels of this working tree, built without an index."""
    folder = tmp_path_factory.mktemp("distributions")
    tracked = ["pyproject.toml", "README.md", "LICENSE", "appliance", "hw_sim", "distributions"]
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z", *tracked],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if listed.returncode:
        pytest.skip("this is no git checkout")
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).exists():
            (folder / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / "tree" / name, follow_symlinks=False)
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-index"]
    build += ["--no-deps", "--no-build-isolation", "--wheel-dir", folder / "wheels"]
    sources = [f"./{path}" for path in FOLDERS.values()]
    done = subprocess.run([*build, *sources], cwd=folder / "tree", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return {name: next((folder / "wheels").glob(f"{name.replace('-', '_')}-*.whl")) for name in FOLDERS}


def test_each_file_is_in_one_wheel_and_none_is_missing(wheels: dict[str, Path]) -> None:
    owner: dict[str, str] = {}
    for name, wheel in wheels.items():
        for file in zipfile.ZipFile(wheel).namelist():
            assert file not in owner, f"{file} is in {name} and in {owner[file]}"
            owner[file] = name
    for file in (path for top in ("appliance", "hw_sim") for path in (ROOT / top).rglob("*.py")):
        name = str(file.relative_to(ROOT))
        studio, sim = name.startswith("appliance/studio/"), name.startswith("hw_sim/")
        assert owner[name] == ("bunraku-studio" if studio else "bunraku-sim" if sim else "bunraku"), name


def test_all_have_one_version_and_ask_for_it_exactly(wheels: dict[str, Path]) -> None:
    for name, wheel in wheels.items():
        with zipfile.ZipFile(wheel) as content:
            [file] = [one for one in content.namelist() if one.endswith(".dist-info/METADATA")]
            facts = message_from_string(content.read(file).decode())
        assert (facts["Name"], facts["Version"]) == (name, VERSION)
        needed = {one.name: str(one.specifier) for one in map(Requirement, facts.get_all("Requires-Dist"))}
        own = {one: specifier for one, specifier in needed.items() if one.startswith("bunraku")}
        assert own == ({} if name == "bunraku" else {"bunraku": f"=={VERSION}"})
        assert ("torch" in needed) == (name == "bunraku-studio")


class Place:
    """A virtual environment that sees this one's packages, but nothing of Bunraku."""

    def __init__(self, folder: Path, without: tuple[str, ...] = ()) -> None:
        self.folder = folder
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
        self.bin = folder / "venv/bin"
        lib = Path("lib", f"python{sys.version_info.major}.{sys.version_info.minor}", "site-packages")
        self.packages, others = folder / "venv" / lib, folder / "others"
        others.mkdir()
        for path in (Path(sys.prefix) / lib).iterdir():
            if not path.name.startswith(OWN + without) and path.suffix != ".pth":
                (others / path.name).symlink_to(path)
        (self.packages / "others.pth").write_text(f"{others}\n")

    def install(self, wheel: Path) -> None:
        pip = [sys.executable, "-m", "pip", "--python", self.bin / "python", "install", "--quiet"]
        options = ["--disable-pip-version-check", "--no-index", "--no-deps"]
        subprocess.run([*pip, *options, wheel], check=True)

    def bunraku(self, *arguments: str | Path, status: int = 0) -> str:
        """What it prints; it runs in a folder that has no checkout."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
        command = [self.bin / "bunraku", *arguments]
        done = subprocess.run(command, cwd=self.folder, env=kept, capture_output=True, text=True)
        assert done.returncode == status, done.stdout + done.stderr
        assert "Traceback" not in done.stderr, done.stderr
        return done.stdout + done.stderr


def test_the_box_then_the_simulation_then_the_studio(wheels: dict[str, Path], tmp_path: Path) -> None:
    place = Place(tmp_path)
    [port] = free_ports(1)
    box = tmp_path / "box.yaml"
    box.write_text(
        f"runtime: {tmp_path / 'run'}\nsensors: {{udp: {{host: 127.0.0.1, port: {port}}}}}\n"
        "outputs: {osc: []}\ncontrol: null\n"
    )
    play = ("play", "--alone", "--box", box, "--seconds", "1")

    place.install(wheels["bunraku"])
    page = place.bunraku("--help")
    for one in DISTRIBUTIONS:
        assert f"Not installed here: {one.name}" in page
        output = place.bunraku(one.commands[0], "--help", status=2)
        assert output.startswith(
            f"bunraku: '{one.commands[0]}' comes with {one.name}, which is not installed here."
        )
        assert output.endswith(f"Install it: pip install {one.name}\n")
    assert "Did you mean 'convert'?" in place.bunraku("gltf", status=2)
    assert "the bundle is whole" in place.bunraku("check")
    assert "Danced" in place.bunraku(*play, "--journal", tmp_path / "danced")
    place.bunraku("journal", "export", "--journal", tmp_path / "danced", "--bvh", "a.bvh", "--glb", "a.glb")
    assert "pip install bunraku-sim" in place.bunraku(*play, "--emulate", status=2)

    place.install(wheels["bunraku-sim"])
    assert "bunraku-sim" not in place.bunraku("--help")
    assert "Danced" in place.bunraku(*play, "--emulate")
    assert "pip install bunraku-studio" in place.bunraku("convert", "a.glb", "b.bvh", status=2)

    place.install(wheels["bunraku-studio"])
    assert "Not installed here" not in place.bunraku("--help")
    place.bunraku("convert", "a.glb", "b.bvh")
    assert (tmp_path / "b.bvh").read_text().startswith("HIERARCHY")


def test_where_moderngl_has_no_wheel_everything_but_the_picture_works(
    wheels: dict[str, Path], tmp_path: Path
) -> None:
    """As `pipx install bunraku` on a processor for which it is left out: no compiler is needed."""
    place = Place(tmp_path, without=("moderngl", "_moderngl", "glcontext"))
    for name in ("bunraku", "bunraku-sim"):
        place.install(wheels[name])
    [port] = free_ports(1)
    box = tmp_path / "box.yaml"
    box.write_text(
        f"runtime: {tmp_path / 'run'}\nsensors: {{udp: {{host: 127.0.0.1, port: {port}}}}}\n"
        "outputs: {osc: []}\ncontrol: null\n"
    )
    assert "Danced" in place.bunraku("play", "--emulate", "--box", box, "--seconds", "1")
    assert " project " in place.bunraku("--help")
    for arguments in (("project",), ("project", "--window", "--seconds", "1")):
        said = place.bunraku(*arguments, status=2)
        assert "draws with moderngl, which is not installed here" in said
        assert "pip install 'bunraku[projector]'" in said


@pytest.mark.parametrize(
    ("machine", "system", "needed"),
    [
        ("x86_64", "linux", True),
        ("aarch64", "linux", False),
        ("arm64", "darwin", True),
        ("x86_64", "darwin", False),
        ("AMD64", "win32", True),
    ],
)
def test_moderngl_is_asked_for_where_it_has_wheels(machine: str, system: str, *, needed: bool) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    [asked] = [one for one in map(Requirement, project["dependencies"]) if one.name == "moderngl"]
    where = {"platform_machine": machine, "sys_platform": system}
    assert asked.marker is not None and asked.marker.evaluate(where) == needed
    assert Requirement(project["optional-dependencies"]["projector"][0]).marker is None
