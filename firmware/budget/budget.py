"""The core's flash, RAM and worst stack against their budget; exit code 1 when one is exceeded.

Usage: budget.py ELF FOLDER. ELF is the linked core; FOLDER holds the call graphs that GCC wrote beside its
objects (`-fcallgraph-info=su`).

The stack is the deepest path of calls from the entry point, each function with its frame. A call through a
pointer may reach every function without a direct caller, but not a method of the class that makes the call: a
driver's bus is not the driver. Functions of the C library count as LIBRARY_STACK bytes; the code of the ports
is outside, and so are parts removed by the linker.
"""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ENTRY = "run_wearable"
INDIRECT = "__indirect_call"
LIBRARY_STACK = 64  # bytes; the deepest of libgcc's and newlib's that the core uses takes less
FLASH_BUDGET, RAM_BUDGET, STACK_BUDGET = 24 * 1024, 4 * 1024, 1536  # bytes
IN_FLASH = (".text", ".rodata", ".data", ".init_array", ".ARM.exidx", ".ARM.extab")
IN_RAM = (".data", ".bss")

NODE = re.compile(r'^node: \{ title: "(?P<title>[^"]+)" label: "(?P<label>[^"]*)"', re.MULTILINE)
EDGE = re.compile(r'^edge: \{ sourcename: "(?P<source>[^"]+)" targetname: "(?P<target>[^"]+)"', re.MULTILINE)
FRAME = re.compile(r"(?P<bytes>\d+) bytes \((?P<kind>[a-z, ]+)\)")


class UnboundedStackError(Exception):
    """The call graph gives no bound on the stack."""


@dataclass
class CallGraph:
    """Frames in bytes by function, and the call graph."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    def read(self, text: str) -> None:
        """Add one of GCC's call graphs (VCG)."""
        for node in NODE.finditer(text):
            frame = FRAME.search(node["label"])
            if frame is None:
                continue  # declared here, defined elsewhere
            title = node["title"]
            if frame["kind"].startswith("dynamic") and "bounded" not in frame["kind"]:
                raise UnboundedStackError(f"{readable(node['label'])} has a frame of unknown size")
            self.frames[title] = int(frame["bytes"])
            self.names[title] = readable(node["label"])
        for edge in EDGE.finditer(text):
            self.calls.setdefault(edge["source"], set()).add(edge["target"])

    def deepest(self, entry: str, linked: set[str]) -> list[tuple[str, int]]:
        """The path of calls that needs most stack: names and bytes, from the entry on.

        `linked`: the symbols of the image; a function that is not among them is not in it.
        """
        called: set[str] = set().union(*self.calls.values())
        by_pointer = sorted(
            title for title in self.frames.keys() - called - {entry} if title.split(":")[-1] in linked
        )
        known: dict[str, list[tuple[str, int]]] = {}
        open_calls: list[str] = []

        def reached(caller: str) -> list[str]:
            owner = owner_of(self.names[caller])
            return [title for title in by_pointer if not owner or owner_of(self.names[title]) != owner]

        def walk(function: str) -> list[tuple[str, int]]:
            if function in known:
                return known[function]
            if function in open_calls:
                raise UnboundedStackError(f"{self.names[function]} calls itself")
            open_calls.append(function)
            below: list[tuple[str, int]] = []
            for callee in sorted(self.calls.get(function, ())):
                for target in reached(function) if callee == INDIRECT else [callee]:
                    path = walk(target) if target in self.frames else [(target, LIBRARY_STACK)]
                    below = max(below, path, key=depth)
            open_calls.pop()
            known[function] = [(self.names[function], self.frames[function]), *below]
            return known[function]

        return walk(entry)


def readable(signature: str) -> str:
    """A function's name without types and without what all have in common."""
    name = re.sub(r"bunraku::|\{anonymous\}::|\(anonymous namespace\)::", "", signature.split("\\n")[0])
    return re.sub(r"\(.*\)( const)?$", "", name).split(" ")[-1]


def owner_of(name: str) -> str:
    """The class of a method; "" for a function."""
    return name.rpartition("::")[0]


def depth(path: list[tuple[str, int]]) -> int:
    return sum(frame for _, frame in path)


def section_sizes(elf: Path) -> dict[str, int]:
    """Bytes by section."""
    listing = subprocess.run(
        ["arm-none-eabi-size", "-A", str(elf)], capture_output=True, text=True, check=True
    ).stdout
    return {name: int(size) for name, size in re.findall(r"^(\.\S+)\s+(\d+)", listing, re.MULTILINE)}


def symbols(elf: Path, *options: str) -> list[tuple[str, int]]:
    """Functions of an image and their bytes, the largest first."""
    listing = subprocess.run(
        ["arm-none-eabi-nm", "-S", "--size-sort", "--reverse-sort", *options, str(elf)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    found = re.findall(r"^\w+ (\w+) [tTwW] (.+)$", listing, re.MULTILINE)
    return [(name, int(size, 16)) for size, name in found]


def heap_of_library(objects: list[Path]) -> list[str]:
    """Operators new and delete that the core would borrow from the C++ library: it is linked without."""
    asked = ["arm-none-eabi-nm", "--undefined-only", "--format=just-symbols", *map(str, objects)]
    listing = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    return sorted(set(re.findall(r"^_Z(?:n|d)[wal]\w*$", listing, re.MULTILINE)))


def main(elf: Path, folder: Path) -> int:
    sizes = section_sizes(elf)
    if borrowed := heap_of_library(sorted(folder.rglob("*.obj")) + sorted(folder.rglob("*.o"))):
        print(f"The wearable's core: it calls {', '.join(borrowed)} of the C++ library: it has no heap.")
        return 1
    graph = CallGraph()
    try:
        for file in sorted(folder.rglob("*.ci")):
            graph.read(file.read_text())
        path = graph.deepest(ENTRY, {name for name, _ in symbols(elf)})
    except UnboundedStackError as reason:
        print(f"The wearable's core: the stack cannot be bounded: {reason}.")
        return 1
    rows = [
        ("flash", sum(sizes.get(name, 0) for name in IN_FLASH), FLASH_BUDGET),
        ("RAM", sum(sizes.get(name, 0) for name in IN_RAM), RAM_BUDGET),
        ("stack", depth(path), STACK_BUDGET),
    ]
    print("The wearable's core    bytes   budget")
    for name, used, budget in rows:
        verdict = "  EXCEEDED" if used > budget else ""
        print(f"  {name:<18} {used:>7,} {budget:>8,}  {used / budget:4.0%}{verdict}")
    largest = dict.fromkeys(f"{readable(name)} {size}" for name, size in symbols(elf, "-C"))
    print("  largest functions: " + ", ".join(list(largest)[:5]))
    print("  deepest calls: " + " > ".join(f"{name} {frame}" for name, frame in path))
    exceeded = [name for name, used, budget in rows if used > budget]
    if exceeded:
        needs = " and ".join(exceeded)
        print(f"The core needs more {needs} than its budget. Make it smaller, or argue for more.")
    return 1 if exceeded else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
