"""The projector's part of box.yaml: which display, how it hangs, what it shares with a second one."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from appliance.show.section import Section, key
from appliance.show.stream import StreamConfig

Size = Annotated[
    tuple[Annotated[int, Field(ge=64, le=16384)], Annotated[int, Field(ge=64, le=16384)]], Field(strict=False)
]
_Part = Annotated[float, Field(ge=-1, le=2)]
_Point = Annotated[tuple[_Part, _Part], Field(strict=False)]


class EdgeBlendConfig(Section):
    """Two projectors side by side, each with a box file of its own; their pictures blend into one."""

    part: Literal["left", "right"] = key("Which part of the wide picture this projector shows.")
    overlap: float = key(
        "How much of this projector's width the other one lights as well.", 0.15, within=(0.01, 0.5)
    )
    gamma: float = key(
        "The projector's gamma: with the right one the overlap is neither brighter nor darker.",
        2.2,
        within=(1.0, 3.0),
    )


class MaskConfig(Section):
    """What of the projector's light stays dark: a door, the edge of the set. It stays when corners move."""

    points: list[_Point] = key(
        "Its corners, in order, in shares of the display's width and height from the top left.",
        length=(3, 64),
    )
    dark: Literal["inside", "outside"] = key("outside: light falls inside of it alone.", "inside")
    soft: float = key("Width of its soft edge, as a share of the display's height.", 0.01, within=(0, 0.2))


class ProjectorConfig(Section):
    """Where and how the picture is projected (`bunraku project`)."""

    display: int | str = key("The display: its place, counted from 0, or (part of) its name.", 0)
    fullscreen: bool = key("Fill the display; false: a window, for rehearsals on a desktop.", True)
    size: Size = key("Width and height of the window, pixels.", (1280, 720))
    picture: Size | None = key(
        "Width and height in which the scene is drawn, pixels; null: the display's own, and "
        "smaller while the machine does not keep up with it.",
        None,
    )
    vsync: bool = key("Show each picture when the display asks for one: without tearing.", True)
    rate: float | None = key(
        "Pictures a second where the display sets no pace; null: as often as it shows one.",
        None,
        within=(1, 240),
    )
    mirror: bool = key("Left and right exchanged, for rear projection.", False)
    upside_down: bool = key("Turned by 180 degrees, for a projector that hangs from the ceiling.", False)
    brightness: float = key("Factor on the brightness of the picture.", 1.0, within=(0.0, 2.0))
    gamma: float = key("Above 1 lifts the dark tones, below 1 deepens them.", 1.0, within=(0.3, 3.0))
    edge_blend: EdgeBlendConfig | None = key(
        str(EdgeBlendConfig.__doc__) + " null: one projector alone.", None
    )
    masks: list[MaskConfig] = key("What stays dark whatever the picture shows.", [], length=(0, 16))
    stream: StreamConfig | None = key(str(StreamConfig.__doc__) + " null: none.", None)
