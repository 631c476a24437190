"""The projector's part of box.yaml: which display, how it hangs, what it shares with a second one."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from appliance.show.section import Section

Size = Annotated[
    tuple[Annotated[int, Field(ge=64, le=16384)], Annotated[int, Field(ge=64, le=16384)]], Field(strict=False)
]


class EdgeBlendConfig(Section):
    """Two projectors side by side, each with a box file of its own, whose pictures melt together."""

    part: Literal["left", "right"] = Field(description="Which part of the wide picture this projector shows.")
    overlap: float = Field(
        default=0.15,
        ge=0.01,
        le=0.5,
        description="How much of this projector's width the other one lights as well.",
    )
    gamma: float = Field(
        default=2.2,
        ge=1.0,
        le=3.0,
        description="The projector's gamma: with the right one the overlap is neither brighter nor darker.",
    )


class ProjectorConfig(Section):
    """Where and how the picture is projected (`bunraku project`)."""

    display: int | str = Field(
        default=0, description="The display: its place, counted from 0, or (part of) its name."
    )
    fullscreen: bool = Field(
        default=True, description="Fill the display; false: a window, for rehearsals on a desktop."
    )
    size: Size = Field(default=(1280, 720), description="Width and height of the window, pixels.")
    picture: Size | None = Field(
        default=None,
        description="Width and height in which the scene is drawn, pixels; null: the display's own, and "
        "smaller while the machine does not keep up with it.",
    )
    vsync: bool = Field(
        default=True, description="Show each picture when the display asks for one: without tearing."
    )
    rate: float | None = Field(
        default=None,
        ge=1,
        le=240,
        description="Pictures a second where the display sets no pace; null: as often as it shows one.",
    )
    mirror: bool = Field(default=False, description="Left and right exchanged, for rear projection.")
    upside_down: bool = Field(
        default=False, description="Turned by half a turn, for a projector that hangs from the ceiling."
    )
    brightness: float = Field(default=1.0, ge=0.0, le=2.0, description="What the picture is multiplied with.")
    gamma: float = Field(
        default=1.0, ge=0.3, le=3.0, description="Above 1 lifts the dark tones, below 1 deepens them."
    )
    edge_blend: EdgeBlendConfig | None = Field(
        default=None, description=str(EdgeBlendConfig.__doc__) + " null: one projector alone."
    )
