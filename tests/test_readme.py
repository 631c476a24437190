"""Every command that the README and the pages for people show works as it stands there."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import cache_from_source
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES_OF_USERS = (
    *("choreographer", "dancer", "exchange", "latency", "lights", "page", "projector", "sensors"),
    *("technician", "touring"),
)
PAGES = ("README.md", *(f"docs/{page}.md" for page in PAGES_OF_USERS))
WATCHDOG_S = 900.0  # for one block: the slowest one takes a minute on a free machine
RECURSIVE = re.compile(r"^make (test|bench|lock|clean)\b")  # these would run this test again
BRIEF = re.compile(r"^((?:bunraku play|make run) .*--seconds) [3-9](?!.*&$)")  # two seconds show the same
CHECK = re.compile(r"^bunraku check\b")
# What a check says of a machine that is too slow at the moment is no fault of the page.
CHECKED = (
    'checked() { local said; said=$("$@" 2>&1) || { grep -q \'iterations do not fit\' <<<"$said" || '
    '{ echo "$said"; return 1; }; }; echo "$said"; }\n'
)
PHRASE = "appliance/show/default_show/phrase.bvh"
SHORT, SHORT_FRAMES = ".venv/short.bvh", 1000  # its first 20 s: what a page copies


@dataclass(frozen=True)
class Block:
    """One fenced block of commands."""

    page: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks_of(page: str) -> list[Block]:
    """Blocks fenced as sh, in the order of the page; other fences hold no commands."""
    blocks, started, fence = [], 0, None
    lines = (ROOT / page).read_text().splitlines()
    for number, line in enumerate(lines, start=1):
        if line.startswith("```"):
            if fence == "sh":
                blocks.append(Block(page, started, "\n".join(lines[started : number - 1])))
            fence, started = (line[3:].strip() if fence is None else None), number
    assert fence is None, f"{page}: a fence is not closed"
    return blocks


@functools.cache
def own_network() -> tuple[str, ...]:
    """The prefix that gives a command a network of its own, with all ports free; empty where not allowed."""
    for wrap in (["unshare", "--net"], ["unshare", "--net", "--map-root-user"]):
        loopback = [*wrap, "ip", "link", "set", "lo", "up"]
        if (
            shutil.which("unshare")
            and not subprocess.run(loopback, capture_output=True, check=False, timeout=WATCHDOG_S).returncode
        ):
            return (*wrap, "bash", "-c", 'ip link set lo up && exec "$@"', "own-network")
    return ()


def different_blocks() -> dict[str, list[Block]]:
    """The blocks of each page, without those that stand on an earlier page word for word."""
    seen: set[str] = set()
    found = {}
    for page in PAGES:
        found[page] = [block for block in blocks_of(page) if block.text not in seen]
        seen |= {block.text for block in found[page]}
    return found


BLOCKS = different_blocks()


@pytest.fixture(scope="module")
def files() -> list[str]:
    """The files of this checkout."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=WATCHDOG_S,
    )
    if listed.returncode != 0:
        pytest.skip("this is no git checkout")
    return [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]


def fill(copy: Path, files: Sequence[str]) -> None:
    """Copy the checkout to `copy`, with this environment as its .venv, and modules as they were compiled."""
    compiled = [cache_from_source(name) for name in files if name.endswith(".py")]
    for name in (*files, *(name for name in compiled if (ROOT / name).is_file())):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, copy / name)
    (copy / ".venv").mkdir()
    head, _, motion = (copy / PHRASE).read_text().partition("Frames:")
    short = "".join(motion.splitlines(True)[1 : 2 + SHORT_FRAMES])
    (copy / SHORT).write_text(f"{head}Frames: {SHORT_FRAMES}\n{short}")
    (copy / ".venv" / "bin").symlink_to(Path(sys.executable).parent)
    for stamp in (".ready-to-run", ".ready-to-test"):  # after the copies: nothing is installed again
        (copy / ".venv" / stamp).touch()


def environment_of(checkout: Path) -> dict[str, str]:
    """A shell's environment for one copy: its modules, its runtime folder, no display."""
    left_out = ("DISPLAY", "WAYLAND_DISPLAY", "RUNTIME_DIRECTORY")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    environment = {name: value for name, value in environment.items() if name not in left_out}
    environment["PATH"] = f"{checkout / '.venv' / 'bin'}:{environment['PATH']}"
    environment["PYTHONPATH"] = str(checkout)  # the copy's own modules and firmware
    environment["XDG_RUNTIME_DIR"] = str(checkout.parent / f"{checkout.name}-runtime")
    Path(environment["XDG_RUNTIME_DIR"]).mkdir(exist_ok=True)
    return environment


def run_block(block: Block, checkout: Path, environment: Mapping[str, str]) -> None:
    """Run one block. Its output goes to a file: a process that outlives the shell would hold a pipe open."""
    replaced = (RECURSIVE, r"make --dry-run \1"), (BRIEF, r"\1 2"), (CHECK, "checked bunraku check")
    script = CHECKED + block.text.replace(f"cp {PHRASE}", f"cp {SHORT}")
    for pattern, text in replaced:
        script = "\n".join(pattern.sub(text, line) for line in script.splitlines())
    with tempfile.TemporaryFile() as output:
        shell = subprocess.Popen(
            [*own_network(), "bash", "-euo", "pipefail", "-c", script],
            cwd=checkout,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

        def report(what: str) -> str:
            output.seek(0)
            return f"{block} {what}\n{block.text}\n{output.read().decode(errors='replace')}"

        try:
            status = shell.wait(WATCHDOG_S)
        except subprocess.TimeoutExpired:
            running = subprocess.run(
                ["ps", "-s", str(shell.pid), "-o", "pid,stat,etime,args"],
                capture_output=True,
                text=True,
                check=False,
                timeout=WATCHDOG_S,
            )
            pytest.fail(report(f"has not ended after {WATCHDOG_S:g} s. Still running:\n{running.stdout}"))
        finally:
            with contextlib.suppress(ProcessLookupError):  # nothing of the block is left
                os.killpg(shell.pid, signal.SIGKILL)
            shell.wait(WATCHDOG_S)
        assert status == 0, report(f"ended with status {status}")
        said = report("printed an error")
        assert "Traceback" not in said, said


# Each page has its own checkout, network and runtime folder: xdist runs them in parallel, the longest first.
@pytest.mark.parametrize("page", sorted(PAGES, key=lambda page: len(BLOCKS[page]), reverse=True))
def test_every_command_of_a_page_works(page: str, files: list[str], tmp_path: Path) -> None:
    assert blocks_of(page), f"{page} shows no command"
    fill(checkout := tmp_path / "checkout", files)
    environment = environment_of(checkout)
    with contextlib.nullcontext() if own_network() else one_at_a_time():
        for block in BLOCKS[page]:
            run_block(block, checkout, environment)


@contextlib.contextmanager
def one_at_a_time() -> Iterator[None]:
    """Until the page of another worker has ended: they would use the same ports."""
    with (Path(tempfile.gettempdir()) / "bunraku-pages.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
