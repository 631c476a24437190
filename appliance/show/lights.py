"""show.yaml's section about lights: fixtures, and what of the dance moves them."""

from __future__ import annotations

from pydantic import Field

from appliance.show.section import Section


class MappingSetConfig(Section):
    """What the lights do with the dance, under one name."""

    name: str = Field(min_length=1, max_length=64, description="What cues and /lights call it.")


class LightsConfig(Section):
    """The fixtures of the show, and what of the dance moves them."""

    mappings: list[MappingSetConfig] = Field(
        default_factory=list, max_length=64, description="Mapping sets; the first is in force at the start."
    )
