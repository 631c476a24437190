"""The architecture holds: imports run one way, the box needs no torch, names and locks are as agreed."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
PACKAGES = ("appliance", "hw_sim", "tools")
LOCKS = ("requirements.txt", "requirements-test.txt")
TOP_LEVEL = {
    *(
        "appliance",
        "firmware",
        "hw_sim",
        "tools",
        "deploy",
        "distributions",
        "tests",
        "docs",
        ".ci",
        ".github",
    ),
    *("pyproject.toml", "README.md", "Makefile", "LICENSE", "CHANGELOG.md", ".gitignore", *LOCKS),
    *("CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md", ".pre-commit-config.yaml"),
    *(".clang-format", ".clang-format-ignore"),
    *("package.json", "package-lock.json", ".npmrc", "tsconfig.json", "eslint.config.js"),  # of the page
}


def tracked_files() -> list[str]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("this is no git checkout")
    return listed.stdout.splitlines()


def modules_of(package: str) -> list[str]:
    paths = sorted((ROOT / package).rglob("*.py"))
    return [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths
    ]


def test_imports_run_one_way() -> None:
    done = subprocess.run([BIN / "lint-imports"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert re.search(r"Contracts: [1-9]\d* kept, 0 broken", done.stdout)


# Packages that a box does not have: importing one fails, as it would there.
BLOCK = """
import importlib, sys
from importlib.abc import MetaPathFinder
BLOCKED = {"torch", "onnx", "onnxscript", "matplotlib", "pybvh", "pytest", "hypothesis"}
class Absent(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
"""
REPORT = """
assert not BLOCKED & set(sys.modules), BLOCKED & set(sys.modules)
print("imported", len(sys.argv) - 1)
"""


def run_blocked(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", BLOCK + code, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_every_module_of_the_box_and_the_simulation_loads_without_torch() -> None:
    box = [name for name in modules_of("appliance") if not name.startswith("appliance.studio")]
    names = [name for name in [*box, *modules_of("hw_sim")] if not name.endswith("__main__")]
    assert "appliance.stage.tick" in names
    done = run_blocked("for name in sys.argv[1:]:\n    importlib.import_module(name)\n" + REPORT, *names)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"imported {len(names)}\n"


def test_the_trap_for_torch_works() -> None:
    assert "No module named 'torch'" in run_blocked("import torch").stderr


def test_the_command_answers_without_torch() -> None:
    done = run_blocked("from appliance.cli.app import main\nmain(['--help'])")
    assert done.returncode == 0, done.stderr
    for command in ("play", "check", "filmstrip", "emulate"):
        assert re.search(rf"\b{command}\b", done.stdout), done.stdout


def test_top_level_names_are_as_agreed() -> None:
    assert {name.partition("/")[0] for name in tracked_files()} <= TOP_LEVEL


def test_every_module_has_a_one_line_summary() -> None:
    names = [name for package in PACKAGES for name in modules_of(package)]
    assert len(names) > 100
    without = [name for name in names if not summary_of(name).endswith((".", ":", "?"))]
    assert not without


def summary_of(module: str) -> str:
    """The first line of its docstring; empty without one."""
    path = ROOT / Path(*module.split("."))
    source = (path / "__init__.py" if path.is_dir() else path.with_suffix(".py")).read_text()
    return (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0]


def pins(lock: str) -> dict[str, str]:
    lines = [line for line in (ROOT / lock).read_text().splitlines() if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.]+", line) for line in lines), lines
    return {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}


@pytest.mark.parametrize("lock", LOCKS)
def test_locks_pin_exactly_and_name_no_host(lock: str) -> None:
    text = (ROOT / lock).read_text()
    assert "://" not in text
    assert "index" not in text.casefold()
    assert len(pins(lock)) > 10


@pytest.mark.parametrize(
    ("lock", "extras", "others"),
    [("requirements.txt", ["pictures"], ["sim"]), (LOCKS[1], ["pictures", "test"], ["sim", "studio"])],
)
def test_locks_hold_the_project_s_requirements(lock: str, extras: list[str], others: list[str]) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(r for extra in extras for r in project["optional-dependencies"][extra]),
    ]
    for other in others:
        file = ROOT / "distributions" / other / "pyproject.toml"
        wanted += tomllib.loads(file.read_text())["tool"]["bunraku"]["dependencies"]
    pinned = pins(lock)
    for requirement in map(Requirement, wanted):
        name = canonicalize_name(requirement.name)
        assert name in pinned, f"{requirement}: run 'make lock'"
        assert requirement.specifier.contains(pinned[name]), f"{requirement}: run 'make lock'"


def test_both_locks_agree_and_only_one_has_torch() -> None:
    box, everything = (pins(lock) for lock in LOCKS)
    assert box.items() <= everything.items()
    assert "torch" in everything
    assert "torch" not in box


def test_make_help_lists_the_targets() -> None:
    shown = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for target in ("run", "test", "test-quick", "lint-js", "bench", "dist", "lock", "clean", "help"):
        assert re.search(rf"^  make {target} +\S", shown, re.MULTILINE), shown


def test_continuous_integration_runs_make_test_and_nothing_after_it() -> None:
    lines = [line for line in (ROOT / ".ci" / "run").read_text().splitlines() if line.strip()]
    assert "set -euo pipefail" in lines
    assert lines[-1] == "make test"
