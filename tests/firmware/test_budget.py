"""The budget of the wearable's core: the compiler's figures, and a build that fails when one is exceeded."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[2] / "firmware" / "budget" / "budget.py"
COMPILER = "arm-none-eabi-g++"
FLAGS = ("-mcpu=cortex-m0plus", "-mthumb", "-Os", "-nostdinc++", "-fno-exceptions", "-fno-rtti")

CORE = """
struct Port {{ virtual int ask(int) = 0; }};
struct Answer : Port {{ int ask(int by) override; }};
__attribute__((noinline)) int Answer::ask(int by) {{
  volatile int room[40];
  room[by] = by;
  return room[by / 2];
}}
static int table[{words}];
extern "C" int run_wearable(Port* port, int by) {{
  volatile char room[{frame}];
  room[by] = 1;
  table[by] += 1;
  return port->ask(by) + table[by / 2];
}}
Answer answer;
extern "C" Port* port() {{ return &answer; }}
{extra}
"""


@pytest.fixture(scope="module")
def budget() -> ModuleType:
    spec = importlib.util.spec_from_file_location("budget", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["budget"] = module
    spec.loader.exec_module(module)
    return module


def call_graph(budget: ModuleType, *lines: str) -> object:
    graph = budget.CallGraph()
    graph.read("\n".join(lines))
    return graph


def node(title: str, stack: int, kind: str = "static") -> str:
    return f'node: {{ title: "{title}" label: "void {title}(int)\\nx.cpp:1:1\\n{stack} bytes ({kind})" }}'


def edge(source: str, target: str) -> str:
    return f'edge: {{ sourcename: "{source}" targetname: "{target}" label: "x.cpp:2:3" }}'


def test_the_deepest_path_counts_not_the_longest(budget: ModuleType) -> None:
    graph = call_graph(
        budget,
        *(node(name, size) for name, size in (("run", 8), ("a", 16), ("b", 16), ("deep", 200))),
        *(edge(*pair) for pair in (("run", "a"), ("a", "b"), ("run", "deep"), ("b", "memcpy"))),
    )
    assert graph.deepest("run", set()) == [("run", 8), ("deep", 200)]


def test_what_the_library_brings_counts_a_fixed_amount(budget: ModuleType) -> None:
    graph = call_graph(budget, node("run", 8), edge("run", "__aeabi_uidiv"))
    assert graph.deepest("run", set()) == [("run", 8), ("__aeabi_uidiv", budget.LIBRARY_STACK)]


def test_a_call_through_a_pointer_may_reach_what_nobody_names(budget: ModuleType) -> None:
    graph = call_graph(
        budget,
        node("run", 8),
        node("pointed_at", 100),
        node("thrown_away", 500),
        edge("run", budget.INDIRECT),
    )
    assert graph.deepest("run", {"run", "pointed_at"}) == [("run", 8), ("pointed_at", 100)]


def test_the_bus_of_a_driver_is_not_the_driver(budget: ModuleType) -> None:
    graph = call_graph(
        budget,
        node("run", 8),
        node("Driver::step", 100),
        edge("run", budget.INDIRECT),
        edge("Driver::step", budget.INDIRECT),
    )
    assert graph.deepest("run", {"run", "step"}) == [("run", 8), ("Driver::step", 100)]


def test_a_function_that_calls_itself_has_no_bound(budget: ModuleType) -> None:
    graph = call_graph(budget, node("run", 8), node("again", 8), edge("run", "again"), edge("again", "again"))
    with pytest.raises(budget.UnboundedStackError, match="again calls itself"):
        graph.deepest("run", set())


def test_a_frame_of_unknown_size_has_no_bound(budget: ModuleType) -> None:
    with pytest.raises(budget.UnboundedStackError, match="run has a frame of unknown size"):
        call_graph(budget, node("run", 8, "dynamic"))


needs_compiler = pytest.mark.skipif(not shutil.which(COMPILER), reason=f"{COMPILER} is not installed")


def verdict(
    folder: Path, *, words: int = 4, frame: int = 8, extra: str = ""
) -> subprocess.CompletedProcess[str]:
    """The script's answer to a small core of that much RAM and stack."""
    source, built = folder / "core.cpp", folder / "core.elf"
    source.write_text(CORE.format(words=words, frame=frame, extra=extra))
    compiled = (*FLAGS, "-fcallgraph-info=su", "-c", str(source), "-o", str(folder / "core.o"))
    linked = (*FLAGS, "-nostartfiles", "-nodefaultlibs", "-Wl,--entry=run_wearable", str(folder / "core.o"))
    subprocess.run([COMPILER, *compiled], check=True)
    subprocess.run([COMPILER, *linked, "-lc_nano", "-lgcc", "-o", str(built)], check=True)
    return subprocess.run(
        [sys.executable, str(SCRIPT), str(built), str(folder)], capture_output=True, text=True, check=False
    )


@needs_compiler
def test_a_core_within_its_budget_passes(tmp_path: Path) -> None:
    done = verdict(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "EXCEEDED" not in done.stdout
    assert "run_wearable" in done.stdout
    assert "Answer::ask 160" in done.stdout  # reached through the port: 40 words


@needs_compiler
@pytest.mark.parametrize(
    ("what", "too_much"),
    [
        ("RAM", {"words": 2000}),
        ("stack", {"frame": 2000}),
        ("flash", {"extra": 'extern "C" __attribute__((used)) const char ballast[25000] = {1};'}),
    ],
)
def test_a_core_over_its_budget_fails_the_build(tmp_path: Path, what: str, too_much: dict[str, int]) -> None:
    done = verdict(tmp_path, **too_much)
    assert done.returncode == 1, done.stdout + done.stderr
    assert [line.split()[0] for line in done.stdout.splitlines() if line.endswith("EXCEEDED")] == [what]
    assert f"The core needs more {what} than its budget." in done.stdout
