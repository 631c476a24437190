"""catalogue.yaml as typed, bounded configuration; what is wrong in it is told with its line."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, field_validator

from appliance.show.section import Section, refusal
from appliance.show.validation import validated
from appliance.show.yaml_file import read_yaml

ALWAYS = (0.0, 1e9)  # seconds
Rate = Annotated[float, Field(ge=1, le=1000)]
Unit = Annotated[float, Field(gt=0, le=10)]
Second = Annotated[float, Field(ge=0)]
Span = Annotated[tuple[Second, Second], Field(strict=False)]
Name = Annotated[str, Field(min_length=1)]


class CatalogueFile(Section):
    """What is known of recordings; each part may be left out. Patterns are names of files without '.bvh'."""

    true_fps: dict[str, Rate] = Field(
        default={}, description="Rates by pattern where headers are wrong: {salsa_*: 60}."
    )
    takes: dict[str, list[Name]] = Field(
        default={}, description="Files that are one take: {duet-1: [anna_1, bert_1]}."
    )
    held_out: list[Name] = Field(default=[], description="Patterns of what to measure on: [anna_1].")
    keep: dict[str, list[Span]] = Field(
        default={},
        description="What is no capture error, by pattern: {anna_*: all, bert_1: [[12.5, 14]]}, in seconds.",
    )
    mask: dict[str, list[Span]] = Field(
        default={},
        description="What is not to be learned from, by pattern: {anna_1: [[0, 3.2]]}, in seconds.",
    )
    metres_per_unit: dict[str, Unit] = Field(
        default={}, description="What lengths are in, by pattern: {solo_*: 0.0254} for inches."
    )
    acknowledgement: str = Field(default="", description="Whom to thank in every show made of them.")
    bytes: dict[str, int] = Field(default={}, description="Sizes by which the studio knows recordings.")

    @field_validator("keep", "mask", mode="before")
    @classmethod
    def _spans(cls, by_pattern: Any, info: ValidationInfo) -> Any:
        if not isinstance(by_pattern, dict):
            return by_pattern
        words = "'all', or " if info.field_name == "keep" else ""
        spans = {}
        for pattern, several in by_pattern.items():
            spans[pattern] = [ALWAYS] if several == "all" and words else several
            if not _are_spans(spans[pattern]):
                cure = f"Write {words}pairs of seconds, from and to: [[12.5, 14], [20, 21.5]]."
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
    """A key without a value counts as left out. Raises ConfigError: the line of everything that is wrong."""
    file = read_yaml(path)
    file.values = {key: value for key, value in file.values.items() if value is not None}
    return validated(CatalogueFile, file, {})
