"""Files of a public project: workflows call what exists, with few rights; templates and hooks can be read."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
TEMPLATES = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.md"))
TARGETS = set(re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE))
SETTING = re.compile(r"[A-Z_]+=")


def steps(workflow: Path) -> Iterator[dict[str, Any]]:
    for job in yaml.safe_load(workflow.read_text())["jobs"].values():
        yield from job["steps"]


def make_targets(command: str) -> list[str]:
    """Targets that a shell command asks make for."""
    found = []
    for line in command.splitlines():
        words = line.split()
        if "make" in words and "apt-get" not in words:
            after = words[words.index("make") + 1 :]
            found += [word for word in after if not SETTING.match(word) and not word.startswith("-")]
    return found


def test_there_are_workflows_for_each_push_each_night_and_each_tag() -> None:
    # YAML 1.1 reads the key `on` as true.
    started = {path.stem: set(yaml.safe_load(path.read_text())[True]) for path in WORKFLOWS}
    assert started == {
        "quick": {"push", "pull_request"},
        "nightly": {"schedule", "workflow_dispatch"},
        "release": {"push"},
    }


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_has_few_rights_a_limit_and_pinned_actions(workflow: Path) -> None:
    document = yaml.safe_load(workflow.read_text())
    assert document["permissions"] == {"contents": "read"}
    for job in document["jobs"].values():
        assert 0 < job["timeout-minutes"] <= 240  # an arm64 machine in software takes hours
        assert job["runs-on"] == "ubuntu-24.04"
    for step in steps(workflow):
        used = step.get("uses", "x@v1")
        assert re.fullmatch(r"[\w./-]+@(v\d+|[0-9a-f]{40})", used), used
        if used.startswith("actions/checkout"):
            assert step["with"]["persist-credentials"] is False
    assert "://" not in workflow.read_text()


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_every_target_and_script_of_a_workflow_exists(workflow: Path) -> None:
    commands = [step["run"] for step in steps(workflow) if "run" in step]
    asked = [target for command in commands for target in make_targets(command)]
    assert set(asked) <= TARGETS, set(asked) - TARGETS
    scripts = [command for command in commands if re.fullmatch(r"[\w./-]+", command)]
    assert asked or scripts
    for script in scripts:
        assert (ROOT / script).is_file(), script
        assert (ROOT / script).stat().st_mode & 0o111, script


def test_an_unknown_target_is_found() -> None:
    assert make_targets("make test-quick PYTHON=python\nmake --jobs=2 nonsense") == ["test-quick", "nonsense"]
    assert "test-quick" in TARGETS and "nonsense" not in TARGETS


def test_the_quick_workflow_runs_on_each_python_of_the_project() -> None:
    document = yaml.safe_load((ROOT / ".github/workflows/quick.yml").read_text())
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    assert wanted == ">=3.11,<3.14"
    assert document["jobs"]["quick"]["strategy"]["matrix"]["python"] == ["3.11", "3.12", "3.13"]


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.stem)
def test_a_template_of_an_issue_has_a_name_and_a_purpose(template: Path) -> None:
    _, front, body = template.read_text().split("---\n", 2)
    assert {"name", "about", "labels"} <= yaml.safe_load(front).keys()
    assert body.strip()


def test_hooks_and_updates_can_be_read_and_hooks_need_no_host() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    assert [one["repo"] for one in hooks["repos"]] == ["local"]
    assert all(hook["language"] == "system" for hook in hooks["repos"][0]["hooks"])
    updates = yaml.safe_load((ROOT / ".github/dependabot.yml").read_text())
    assert {one["package-ecosystem"] for one in updates["updates"]} == {"github-actions", "npm", "pip"}


def test_the_lock_of_the_page_s_checks_pins_exactly_and_names_no_registry() -> None:
    lock = (ROOT / "package-lock.json").read_text()
    assert '"resolved"' not in lock
    packages = json.loads(lock)["packages"]
    wanted = json.loads((ROOT / "package.json").read_text())["devDependencies"]
    assert packages[""]["devDependencies"] == wanted
    for name, version in wanted.items():
        assert packages[f"node_modules/{name}"]["version"] == version
    assert all("integrity" in one for name, one in packages.items() if name)


def test_no_file_for_contributors_names_a_private_address() -> None:
    for name in ("CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md"):
        assert not re.search(r"[\w.]+@[\w-]+\.\w", (ROOT / name).read_text()), name
