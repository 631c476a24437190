"""Catalogues: what is known of recordings beyond their files, beside them or in the studio."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from appliance.studio.data.catalogue_file import read_catalogue_file

CATALOGUES = Path(__file__).parent / "catalogues"
Spans = tuple[tuple[float, float], ...]  # seconds from and to


@dataclass(frozen=True)
class Catalogue:
    """What is known of recordings beyond their files: true frame rates, takes, what is held out, and where
    people know better than we what is a capture error.
    """

    true_fps: dict[str, float] = field(default_factory=dict)
    take: dict[str, str] = field(default_factory=dict)
    held_out: tuple[str, ...] = ()
    acknowledgement: str = ""  # whom to thank, in every show made of them
    keep: dict[str, Spans] = field(default_factory=dict)
    mask: dict[str, Spans] = field(default_factory=dict)
    metres_per_unit: dict[str, float] = field(default_factory=dict)

    def fps_of(self, name: str) -> float | None:
        return _first(self.true_fps, name)

    def unit_of(self, name: str) -> float | None:
        """What a recording's lengths are in, metres."""
        return _first(self.metres_per_unit, name)

    def take_of(self, name: str) -> str:
        return self.take.get(name, name)

    def is_held_out(self, name: str) -> bool:
        return any(fnmatch.fnmatch(name, pattern) for pattern in self.held_out)

    def kept(self, name: str) -> Spans:
        """When a recording is sound whatever it looks like."""
        return _spans(self.keep, name)

    def masked(self, name: str) -> Spans:
        """When a recording is not to be learned from."""
        return _spans(self.mask, name)


def find_catalogue(folder: Path, files: Sequence[Path]) -> Catalogue:
    """catalogue.yaml beside the recordings, else the studio's own where they know every name and size."""
    own = folder / "catalogue.yaml"
    if own.exists():
        return read_catalogue(own)
    sizes = {file.stem: file.stat().st_size for file in files}
    found = []
    for path in sorted(CATALOGUES.glob("*.yaml")):
        known = read_catalogue_file(path).bytes
        here = {name for name, size in sizes.items() if known.get(name) == size}
        if here:
            found.append(read_catalogue(path))
            sizes = {name: size for name, size in sizes.items() if name not in here}
    return _joined(found) if not sizes else Catalogue()


def read_catalogue(path: Path) -> Catalogue:
    """Read a catalogue file. Raises ConfigError with the line of everything that is wrong in it."""
    file = read_catalogue_file(path)
    return Catalogue(
        file.true_fps,
        {name: take for take, names in file.takes.items() for name in names},
        tuple(file.held_out),
        file.acknowledgement.strip(),
        {pattern: tuple(spans) for pattern, spans in file.keep.items()},
        {pattern: tuple(spans) for pattern, spans in file.mask.items()},
        file.metres_per_unit,
    )


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


def _first(by_pattern: Mapping[str, float], name: str) -> float | None:
    return next((value for pattern, value in by_pattern.items() if fnmatch.fnmatch(name, pattern)), None)


def _spans(by_pattern: Mapping[str, Spans], name: str) -> Spans:
    return tuple(
        span for pattern, spans in by_pattern.items() if fnmatch.fnmatch(name, pattern) for span in spans
    )
