"""Catalogues: what is known of recordings beyond their files, beside them or in the studio."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

CATALOGUES = Path(__file__).parent / "catalogues"


@dataclass(frozen=True)
class Catalogue:
    """What is known of recordings beyond their files: true frame rates, takes, what is held out."""

    true_fps: dict[str, float] = field(default_factory=dict)
    take: dict[str, str] = field(default_factory=dict)
    held_out: tuple[str, ...] = ()
    acknowledgement: str = ""  # whom to thank, in every show made of them

    def fps_of(self, name: str) -> float | None:
        return next((fps for pattern, fps in self.true_fps.items() if fnmatch.fnmatch(name, pattern)), None)

    def take_of(self, name: str) -> str:
        return self.take.get(name, name)

    def is_held_out(self, name: str) -> bool:
        return any(fnmatch.fnmatch(name, pattern) for pattern in self.held_out)


def find_catalogue(folder: Path, files: Sequence[Path]) -> Catalogue:
    """catalogue.yaml beside the recordings, else the studio's own where they know every name and size."""
    own = folder / "catalogue.yaml"
    if own.exists():
        return read_catalogue(own)
    sizes = {file.stem: file.stat().st_size for file in files}
    found = []
    for path in sorted(CATALOGUES.glob("*.yaml")):
        known = yaml.safe_load(path.read_text(encoding="utf-8"))["bytes"]
        here = {name for name, size in sizes.items() if known.get(name) == size}
        if here:
            found.append(read_catalogue(path))
            sizes = {name: size for name, size in sizes.items() if name not in here}
    return _joined(found) if not sizes else Catalogue()


def read_catalogue(path: Path) -> Catalogue:
    """Read a catalogue: true_fps (pattern: rate), takes (take: [names]), held_out (patterns),
    acknowledgement."""
    text = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    takes = {name: take for take, names in (text.get("takes") or {}).items() for name in names}
    rates = {str(pattern): float(fps) for pattern, fps in (text.get("true_fps") or {}).items()}
    thanks = str(text.get("acknowledgement") or "").strip()
    return Catalogue(rates, takes, tuple(text.get("held_out") or ()), thanks)


def _joined(catalogues: Sequence[Catalogue]) -> Catalogue:
    """What several know together; each acknowledgement once."""
    rates: dict[str, float] = {}
    takes: dict[str, str] = {}
    for one in catalogues:
        rates |= one.true_fps
        takes |= one.take
    held = tuple(pattern for one in catalogues for pattern in one.held_out)
    thanks = dict.fromkeys(one.acknowledgement for one in catalogues if one.acknowledgement)
    return Catalogue(rates, takes, held, " ".join(thanks))
