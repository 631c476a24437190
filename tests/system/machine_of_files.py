"""A machine made of files for the doctor's checks, and what they find in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from appliance.cli.doctor.finding import Finding
from appliance.cli.doctor.host_view import HostView

Check = Callable[[HostView], Iterable[Finding]]
STAGE_PID = 4711


def lay(root: Path, path: str, content: str = "") -> None:
    file = root / path.lstrip("/")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)


def verdicts(found: Iterable[Finding]) -> list[tuple[str, str]]:
    return [(finding.what, finding.verdict) for finding in found]


def only(found: Iterable[Finding]) -> Finding:
    (finding,) = found
    return finding
