"""Catalogues: what is known of recordings beyond their files, from catalogue.yaml or the studio's own."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from appliance.pose.reading_options import ReadingOptions
from appliance.show.section import Section, refusal
from appliance.show.validation import validated
from appliance.show.yaml_file import read_yaml

CATALOGUES = Path(__file__).parent / "catalogues"
ALWAYS = (0.0, 1e9)  # seconds
OTHER_ENDINGS = (".glb", ".gltf", ".fbx", ".c3d", ".trc", ".asf", ".amc", ".vmd", ".npz", ".csv")
SHOWN = 10
READ_FROM_FILES = ("true_fps", "metres_per_unit", "up", "facing", "root")
Rate = Annotated[float, Field(ge=1, le=1000)]
Unit = Annotated[float, Field(gt=0, le=10)]
Second = Annotated[float, Field(ge=0)]
SpanOfSeconds = Annotated[tuple[Second, Second], Field(strict=False)]
Name = Annotated[str, Field(min_length=1)]
Spans = tuple[tuple[float, float], ...]  # seconds from and to


@dataclass(frozen=True)
class Catalogue:
    """Facts about recordings that their files lack: true frame rates, takes, held-out ones, and
    corrections to the detected capture errors. learned: takes that a checkpoint's network learned from.
    """

    true_fps: dict[str, float] = field(default_factory=dict)
    take: dict[str, str] = field(default_factory=dict)
    held_out: tuple[str, ...] = ()
    acknowledgement: str = ""  # printed in every show made of them
    keep: dict[str, Spans] = field(default_factory=dict)
    mask: dict[str, Spans] = field(default_factory=dict)
    metres_per_unit: dict[str, float] = field(default_factory=dict)
    up: dict[str, str] = field(default_factory=dict)
    facing: dict[str, str] = field(default_factory=dict)
    root: dict[str, str] = field(default_factory=dict)
    learned: tuple[str, ...] = ()

    @property
    def reading(self) -> ReadingOptions:
        """How the recordings are read, as far as it is known."""
        known = {name: getattr(self, name) for name in READ_FROM_FILES}
        return ReadingOptions(**known, all_frames=ALWAYS in self.keep.get("*", ()))

    def with_options(self, options: ReadingOptions) -> Catalogue:
        """With what the command line says, which comes first."""
        all_of_it = options.over(self.reading)
        return replace(
            self,
            **{name: getattr(all_of_it, name) for name in READ_FROM_FILES},
            keep={"*": (ALWAYS,), **self.keep} if options.all_frames else self.keep,
        )

    def take_of(self, name: str) -> str:
        return self.take.get(name, name)

    def is_held_out(self, name: str) -> bool:
        return any(fnmatch.fnmatch(name, pattern) for pattern in self.held_out)

    def kept(self, name: str) -> Spans:
        """When a recording has no capture error, whatever it looks like."""
        return _spans(self.keep, name)

    def masked(self, name: str) -> Spans:
        """When a recording must not be learned from."""
        return _spans(self.mask, name)


def recordings_in(folder: Path) -> list[Path]:
    """The BVH files of a folder, without the phrase and the skeleton of a show that was trained into it."""
    is_show = any((folder / name).exists() for name in ("show.yaml", "checkpoint.pt", "puppet.onnx"))
    own = {"phrase.bvh", "skeleton.bvh"} if is_show else set()
    return [file for file in _files_in(folder) if _ending(file) == ".bvh" and file.name.casefold() not in own]


def left_out_of(folder: Path) -> str:
    """Other things in a folder that look like recordings, by name ('': nothing): other formats, folders of
    BVH.
    """
    inside = [f"{one.name}/" for one in sorted(folder.glob("*")) if one.is_dir() and recordings_in(one)]
    names = [file.name for file in _files_in(folder) if _ending(file) in OTHER_ENDINGS] + inside
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _files_in(folder: Path) -> list[Path]:
    """Without hidden ones: some systems put a '._take.bvh', which is no BVH file, beside each take.bvh."""
    return sorted(one for one in folder.glob("*") if not one.name.startswith(".") and not one.is_dir())


def _ending(file: Path) -> str:
    return file.suffix.casefold()


def find_catalogue(folder: Path, files: Sequence[Path]) -> Catalogue:
    """catalogue.yaml beside the recordings, else the studio's own if these list every name and size."""
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
    """Read a catalogue file. Raises ConfigError with the line of each error."""
    file = read_catalogue_file(path)
    return Catalogue(
        file.true_fps,
        {name: take for take, names in file.takes.items() for name in names},
        tuple(file.held_out),
        file.acknowledgement.strip(),
        {pattern: tuple(spans) for pattern, spans in file.keep.items()},
        {pattern: tuple(spans) for pattern, spans in file.mask.items()},
        file.metres_per_unit,
        dict(file.up),
        dict(file.facing),
        file.root,
    )


def _joined(catalogues: Sequence[Catalogue]) -> Catalogue:
    """Several catalogues as one; each acknowledgement once."""
    rates: dict[str, float] = {}
    takes: dict[str, str] = {}
    facing: dict[str, str] = {}
    for one in catalogues:
        rates |= one.true_fps
        takes |= one.take
        facing |= one.facing
    held = tuple(pattern for one in catalogues for pattern in one.held_out)
    thanks = dict.fromkeys(one.acknowledgement for one in catalogues if one.acknowledgement)
    return Catalogue(rates, takes, held, " ".join(thanks), facing=facing)


def _spans(by_pattern: Mapping[str, Spans], name: str) -> Spans:
    return tuple(
        span for pattern, spans in by_pattern.items() if fnmatch.fnmatch(name, pattern) for span in spans
    )


class CatalogueFile(Section):
    """catalogue.yaml. Every key is optional. Patterns are file names without '.bvh'."""

    true_fps: dict[str, Rate] = Field(
        default={}, description="Rates by pattern if headers are wrong: {salsa_*: 60}."
    )
    takes: dict[str, list[Name]] = Field(
        default={}, description="Files that are one take: {duet-1: [anna_1, bert_1]}."
    )
    held_out: list[Name] = Field(default=[], description="Patterns of what to measure on: [anna_1].")
    keep: dict[str, list[SpanOfSeconds]] = Field(
        default={},
        description="What is no capture error, by pattern: {anna_*: all, bert_1: [[12.5, 14]]}, in seconds.",
    )
    mask: dict[str, list[SpanOfSeconds]] = Field(
        default={},
        description="What must not be learned from, by pattern: {anna_1: [[0, 3.2]]}, in seconds.",
    )
    metres_per_unit: dict[str, Unit] = Field(
        default={}, description="Metres in a unit of length, by pattern: {solo_*: 0.0254} for inches."
    )
    up: dict[str, Literal["y", "z"]] = Field(
        default={}, description="Vertical axis, by pattern: {solo_*: z}."
    )
    facing: dict[str, Literal["z", "x", "-z", "-x"]] = Field(
        default={}, description="Where the dancer faces, once upright, by pattern: {solo_*: -z}."
    )
    root: dict[str, Name] = Field(
        default={}, description="Joint that carries the body, by pattern: {solo_*: Hips}."
    )
    acknowledgement: str = Field(default="", description="Acknowledgement in every show made of them.")
    bytes: dict[str, int] = Field(default={}, description="File sizes that identify recordings.")

    @field_validator("keep", "mask", mode="before")
    @classmethod
    def _spans(cls, by_pattern: Any, info: ValidationInfo) -> Any:
        if not isinstance(by_pattern, dict):
            return by_pattern
        choice = "'all', or " if info.field_name == "keep" else ""
        spans = {}
        for pattern, several in by_pattern.items():
            spans[pattern] = [ALWAYS] if several == "all" and choice else several
            if not _are_spans(spans[pattern]):
                cure = f"Write {choice}pairs of seconds, from and to: [[12.5, 14], [20, 21.5]]."
                raise refusal(f"'{pattern}' does not say when.", cure, pattern)
        return spans


def _are_spans(spans: Any) -> bool:
    """Whether these are pairs of numbers of which the second is greater."""
    return isinstance(spans, list) and all(
        isinstance(span, list | tuple)
        and len(span) == 2
        and all(isinstance(second, int | float) for second in span)
        and span[0] < span[1]
        for span in spans
    )


def read_catalogue_file(path: Path) -> CatalogueFile:
    """Read catalogue.yaml; a key without a value counts as absent. Raises ConfigError with the lines."""
    file = read_yaml(path)
    file.values = {key: value for key, value in file.values.items() if value is not None}
    return validated(CatalogueFile, file, {})
