"""Files of a public project: workflows call what exists, with few rights; templates and hooks can be read."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
TEMPLATES = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.md"))


def steps(workflow: Path) -> Iterator[dict[str, Any]]:
    for job in yaml.safe_load(workflow.read_text())["jobs"].values():
        yield from job["steps"]


def make_lines(command: str) -> list[str]:
    """Lines of a shell command that call make."""
    return [line.strip() for line in command.splitlines() if line.strip().startswith("make ")]


def run(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """In the repository; as from a shell, also where `make test` runs this test."""
    outer = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL")}
    return subprocess.run(
        words, cwd=ROOT, env=outer | environment, capture_output=True, text=True, check=False
    )


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
def test_make_and_the_shell_understand_every_step(workflow: Path) -> None:
    asked = 0
    for command in (step["run"] for step in steps(workflow) if "run" in step):
        assert run("bash", "-n", "-c", command).stderr == ""
        if re.fullmatch(r"[\w./-]+", command):
            assert (ROOT / command).stat().st_mode & 0o111, command
            asked += 1
        for line in make_lines(command):
            asked += 1
            done = run("make", "--dry-run", "--no-print-directory", *shlex.split(line)[1:])
            assert done.returncode == 0, done.stderr
            assert "warning" not in done.stderr
    assert asked


def test_make_says_what_is_no_target() -> None:
    assert make_lines("apt-get install make\nmake test-quick PYTHON=python\nsha256sum x >first\n") == [
        "make test-quick PYTHON=python"
    ]
    assert run("make", "--dry-run", "nonsense").returncode == 2


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_a_job_takes_what_jobs_before_it_have_made(workflow: Path) -> None:
    """Artifacts by their names and jobs; what is uploaded is what a step of the job writes."""
    jobs = yaml.safe_load(workflow.read_text())["jobs"]
    uploaded: dict[str, tuple[str, str]] = {}
    for name, job in jobs.items():
        made = ""
        for number, step in enumerate(job["steps"]):
            for line in make_lines(step.get("run", "")):
                made += run("make", "--dry-run", "--no-print-directory", *shlex.split(line)[1:]).stdout
            kind, given = step.get("uses", "").split("@")[0], step.get("with", {})
            if kind == "actions/upload-artifact" and given["if-no-files-found"] == "error":
                folder = given["path"].rpartition("/")[0]
                assert f"{folder}/" in made or ("pack-downloads" in made and folder == "out/downloads"), given
                uploaded[given["name"]] = name, folder
            if kind == "actions/download-artifact":
                from_job, folder = uploaded[given["name"]]
                assert from_job in job["needs"], given  # a name, or a list of names
                is_used = f"{given['path']}/*" in str(job["steps"][number + 1 :])
                assert is_used or given["path"] == folder, given


def test_the_expressions_of_a_workflow_name_what_there_is() -> None:
    known = r"secrets\.BUNRAKU_RELEASE_KEY|vars\.ESP32_INDEX|github\.(token|repository|ref)|matrix\.python"
    for workflow in WORKFLOWS:
        for expression in re.findall(r"\$\{\{ *(.*?) *\}\}", workflow.read_text()):
            assert re.fullmatch(known, expression), expression


@pytest.mark.programs
def test_the_small_steps_of_a_release_do_what_they_say(tmp_path: Path) -> None:
    """Tag and key; the large ones are make's."""
    jobs = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"]
    named = {step["name"]: step["run"] for job in jobs.values() for step in job["steps"] if "name" in step}
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    tag = named["The tag names the version of pyproject.toml"]
    assert run("bash", "-ec", tag, GITHUB_REF_NAME=f"v{version}").returncode == 0
    assert run("bash", "-ec", tag, GITHUB_REF_NAME=f"v{version}1").returncode == 1
    key = named["The key that signs this release"]
    done = run("bash", "-ec", key, RUNNER_TEMP=str(tmp_path), SIGNING_KEY="")
    assert done.returncode == 1 and "has no secret" in done.stderr
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", tmp_path / "made"], check=True)
    made = (tmp_path / "made").read_text().strip()  # as a secret's field keeps it
    assert run("bash", "-ec", key, RUNNER_TEMP=str(tmp_path), SIGNING_KEY=made).returncode == 0
    assert (tmp_path / "key").stat().st_mode & 0o777 == 0o600
    public = run("ssh-keygen", "-y", "-f", str(tmp_path / "key")).stdout
    assert public.split()[1] == (tmp_path / "made.pub").read_text().split()[1]
    end = next(step["run"] for step in jobs["box"]["steps"] if step.get("if") == "always()")
    assert run("bash", "-ec", end, RUNNER_TEMP=str(tmp_path)).returncode == 0
    assert not (tmp_path / "key").exists()


def test_the_quick_workflow_runs_on_each_python_of_the_project() -> None:
    document = yaml.safe_load((ROOT / ".github/workflows/quick.yml").read_text())
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    assert wanted == ">=3.11,<3.15"
    jobs = document["jobs"]
    assert jobs["quick"]["strategy"]["matrix"]["python"] == ["3.11", "3.12", "3.13"]
    assert jobs["newest-python"]["steps"][1]["with"]["python-version"] == "3.14"


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
