"""Facts that the bits of a dance depend on besides the journal: processor, libraries, the show's files."""

from __future__ import annotations

import hashlib
import os
import platform
import zlib
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from appliance.pose.foreign_file import opened
from appliance.show.bundle import LARGEST_FILE

CPU_INFO = Path("/proc/cpuinfo")
_UNKNOWN = "unknown"
_ABILITIES = ("cpu family", "model", "stepping", "flags", "CPU variant", "CPU revision", "Features")
_LABELS = {
    "machine": "the machine",
    "cpu": "the processor",
    "python": "Python",
    "numpy": "numpy",
    "onnxruntime": "onnxruntime",
    "bunraku": "Bunraku",
}


def environment() -> dict[str, str]:
    """Machine, processor and versions, here and now."""
    return {
        "machine": platform.machine(),
        "cpu": _processor(),
        "python": platform.python_version(),
        **{name: _version(name) for name in ("numpy", "onnxruntime", "bunraku")},
    }


def fingerprints(directory: Path, names: Sequence[str]) -> dict[str, str]:
    """SHA-256 of a show's files by their names; "" for one that cannot be read."""
    return {name: _fingerprint(directory / name) for name in names}


def differing_software(recorded: dict[str, Any], here: dict[str, str]) -> list[str]:
    """Differences of machine and software from those of the recording, in words."""
    return [
        f"{message} ({recorded.get(name, _UNKNOWN)} then, {here[name]} here)"
        for name, message in _LABELS.items()
        if recorded.get(name) != here[name]
    ]


def differing_files(recorded: dict[str, str], directory: Path) -> list[str]:
    """The show's files that are others than in the recording, by name."""
    here = fingerprints(directory, list(recorded))
    return [name for name, fingerprint in recorded.items() if here[name] != fingerprint]


def _fingerprint(path: Path) -> str:
    try:
        with opened(path) as file:  # the names come from a file that anybody may have made
            is_too_large = os.fstat(file.fileno()).st_size > LARGEST_FILE
            return "" if is_too_large else hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return _UNKNOWN


def _processor() -> str:
    """Its name as the kernel has it, and a number for what it can do: libraries choose their code by that.

    Machines in a rack of virtual ones share a name, and not what they can do.
    """
    try:
        lines = CPU_INFO.read_text(errors="replace").splitlines()
    except OSError:
        return _UNKNOWN
    named = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    parts = [named[name] for name in ("model name", "CPU part", "Model") if name in named]
    abilities = " ".join(named.get(name, "") for name in _ABILITIES)
    return f"{', '.join(parts) or _UNKNOWN} [{zlib.crc32(abilities.encode()):08x}]"
