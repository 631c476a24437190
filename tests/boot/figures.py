"""The figures of a run of the boot tests: what was measured, beside what it should be."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Figures:
    """Measured values by name, in the order in which they came; limit None: there is none."""

    values: dict[str, list[float]] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    def note(self, name: str, value: float, *, limit: float | None = None, unit: str = "s") -> None:
        """One more value of this name; above the limit it stands out in the table and fails nothing."""
        self.values.setdefault(name, []).append(value)
        self.units[name] = unit
        if limit is not None:
            self.limits[name] = limit

    def add(self, other: Figures) -> None:
        """Those of another process too."""
        for name, values in other.values.items():
            self.values.setdefault(name, []).extend(values)
        self.limits |= other.limits
        self.units |= other.units

    def over(self) -> list[str]:
        """Whose median is above its limit."""
        return [name for name, limit in self.limits.items() if _median(self.values[name]) > limit]

    def table(self) -> list[str]:
        """As Markdown: median and worst."""
        lines = ["| what | times | median | worst | limit | |", "|---|---|---|---|---|---|"]
        for name, values in self.values.items():
            unit, limit = self.units[name], self.limits.get(name)
            shown = [f"{_said(value)} {unit}" for value in (_median(values), max(values))]
            verdict = "" if limit is None else "over" if name in self.over() else "ok"
            asked = "" if limit is None else f"{_said(limit)} {unit}"
            lines.append(f"| {name} | {len(values)} | {shown[0]} | {shown[1]} | {asked} | {verdict} |")
        return lines

    def write(self, folder: Path) -> None:
        """figures.json and figures.md."""
        folder.mkdir(parents=True, exist_ok=True)
        facts = {
            name: {"unit": self.units[name], "limit": self.limits.get(name), "values": values}
            for name, values in self.values.items()
        }
        (folder / "figures.json").write_text(json.dumps(facts, indent=1) + "\n")
        (folder / "figures.md").write_text("\n".join(self.table()) + "\n")


def _median(values: Sequence[float]) -> float:
    return sorted(values)[(len(values) - 1) // 2]


def _said(value: float) -> str:
    return f"{value:.0f}" if value == int(value) and value < 1e6 else f"{value:.2f}"
