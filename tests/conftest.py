"""Fixtures shared by several test folders, and the order of a whole run."""

from __future__ import annotations

import gc
import importlib
import itertools
import os
import random
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

import hw_sim.peers
from tests.boot import figures_report
from tests.command import Command
from tests.logged import said

ROOT = Path(__file__).resolve().parents[1]
# The longest files start first when files run in parallel: started last, one would run alone.
LONGEST_FIRST = ("tests/boot/", "tests/test_readme.py", "tests/system/", "tests/studio/")
PAGES = "tests/test_readme.py::test_every_command_of_a_page_works"
_folders = itertools.count()
_unloaded: dict[str, BaseException] = {}  # by module: what the collection reports, or it has gone away

# As the commands have it: threads of numerical libraries would only wait for each other. Set here: other
# conftest.py load the libraries, which read this once, before any hook is called.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("bunraku")
    group.addoption("--long", action="store_true", help="every count at its full length: make test-long")
    group.addoption("--cuts", type=int, help="power cuts of tests/boot/test_power_cuts.py: 5, with --long 20")
    group.addoption("--seed", type=int, help="repeat a random test with the seed that it printed")


def pytest_configure(config: pytest.Config) -> None:
    # Property tests have no deadline: a busy machine must not fail them. A failure prints how to repeat it.
    untimed = settings(deadline=None, print_blob=True)
    settings.register_profile("long", untimed)
    settings.register_profile("short", untimed, max_examples=50)
    settings.load_profile("long" if config.getoption("--long") else "short")
    report = figures_report.FiguresReport(ROOT / "build" / "boot")
    config.pluginmanager.register(report, figures_report.NAME)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # otherwise each process compiles all modules
    sys.dont_write_bytecode = False  # this process too: rewriting assertions is most of a collection's time
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker:
        gc.disable()  # until all tests are collected: what is loaded by then stays
        # Its own share of the ports, so that no other worker takes one between choice and use.
        first, step = int(worker.removeprefix("gw")), int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        hw_sim.peers.PORTS = hw_sim.peers.PORTS[first::step]
        os.environ["BUNRAKU_PORTS"] = f"{first}:{step}"  # for the processes that it starts
        if [Path(one).resolve() for one in config.args] == [ROOT / "tests"]:
            load_share(first, step)


def load_share(first: int, step: int) -> None:
    """Load a worker's share of the test modules before it collects all of them.

    In a fresh checkout, rewriting assertions takes most of that time. The result is saved, and every worker
    that loads the module later uses it. Without shares each worker would rewrite all of them at once.
    """
    for path in sorted((ROOT / "tests").rglob("test_*.py"))[first::step]:
        name = path.relative_to(ROOT)
        try:
            importlib.import_module(".".join(name.with_suffix("").parts))
        except (Exception, pytest.skip.Exception) as error:
            _unloaded[name.as_posix()] = error


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadFileScheduling:
    return OneBoxAtATime(config, log)


class OneBoxAtATime(LoadFileScheduling):
    """Files run in parallel, but no two machines boot at once: each takes a whole processor."""

    def _split_scope(self, nodeid: str) -> str:
        if nodeid.startswith(PAGES):
            return nodeid  # each page has its own checkout and network
        return "tests/boot" if nodeid.startswith("tests/boot/") else str(super()._split_scope(nodeid))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return
    items.sort(
        key=lambda item: next(
            (place for place, start in enumerate(LONGEST_FIRST) if item.nodeid.startswith(start)),
            len(LONGEST_FIRST),
        )
    )


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if report.passed and (error := _unloaded.get(report.nodeid)):
        report.outcome, report.longrepr = "failed", f"Loaded the second time only: {error!r}"
    return report


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def _nothing_is_said() -> None:
    said.clear()


@pytest.fixture(scope="session")
def long_run(pytestconfig: pytest.Config) -> bool:
    """Whether counts have their full length (--long)."""
    return bool(pytestconfig.getoption("--long"))


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> random.Random:
    """Differs in each run; a test that fails prints its seed."""
    seed = request.config.getoption("--seed")
    if seed is None:
        seed = random.SystemRandom().randrange(1 << 30)
    request.node.add_report_section("setup", "seed", f"Repeat this with --seed {seed}")
    return random.Random(seed)


@pytest.fixture
def bunraku(capfd: pytest.CaptureFixture[str]) -> Command:
    """Runs commands in this process."""
    return Command(capfd)


@pytest.fixture(autouse=True)
def own_runtime_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A runtime folder for the boxes of this test, never that of a box beside the tests."""
    folder = tmp_path_factory.getbasetemp() / f"runtime-{next(_folders)}"
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(folder))
    return folder


@pytest.fixture(scope="session")
def recordings_dir() -> Path:
    """Folder with the motion capture recordings, beside the repository."""
    folder = ROOT.parent / "shared" / "mocap"
    if not folder.is_dir():
        pytest.skip("the motion capture recordings (../shared/mocap) are not on this machine")
    return folder


@pytest.fixture(scope="session")
def tiny_show(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small complete show bundle: 17 moving of 20 joints, 3 s of swaying, an untrained mlp, exported."""
    from tests.studio.tiny import write_tiny_show

    return write_tiny_show(tmp_path_factory.mktemp("tiny") / "show")
