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
LEAST_TO_MOST_OVERLAP, LEAST_TO_MOST_GAMMA = (0.01, 0.5), (1.0, 3.0)
_Point = Annotated[tuple[_Part, _Part], Field(strict=False)]


class EdgeBlendConfig(Section):
    """Two projectors side by side, or one above the other, each with its own box file; their pictures blend
    into one."""

    part: Literal["left", "right", "top", "bottom"] = key(
        "The part of the picture that this projector shows."
    )
    overlap: float = key(
        "Fraction of this projector's width (its height for top and bottom) that the other one also lights.",
        0.15,
        within=LEAST_TO_MOST_OVERLAP,
    )
    gamma: float = key(
        "The projector's gamma: with the right one the overlap is neither brighter nor darker.",
        2.2,
        within=LEAST_TO_MOST_GAMMA,
    )


class MaskConfig(Section):
    """Dark parts of the projector's light: a door, the edge of the set. They stay when corners move."""

    points: list[_Point] = key(
        "Its corners, in order, in fractions of the display's width and height from the top left.",
        length=(3, 64),
    )
    dark: Literal["inside", "outside"] = key("outside: light falls only inside it.", "inside")
    soft: float = key("Width of its soft edge, as a fraction of the display's height.", 0.01, within=(0, 0.2))


class ProjectorConfig(Section):
    """Where and how the picture is projected (`bunraku project`)."""

    display: int | str = key("The display: its place, counted from 0, or (part of) its name.", 0)
    fullscreen: bool = key("Fill the display; false: a window, for rehearsals on a desktop.", True)
    size: Size = key("Width and height of the window, pixels.", (1280, 720))
    picture: Size | None = key(
        "Width and height of the drawn scene, pixels; null: the display's own, and "
        "smaller while the machine does not keep up with it.",
        None,
    )
    vsync: bool = key("Synchronise pictures with the display: no tearing.", True)
    rate: float | None = key(
        "Pictures a second if the display sets no pace; null: the display's rate.",
        None,
        within=(1, 240),
    )
    prediction_ms: float = key(
        "How far ahead the limbs that a hand leads are predicted, so that the wall lags less behind the "
        "hand; the rest of the figure by half of it. 20 makes up for the interpolation between frames, more "
        "for the display's delay too, but rougher; 0: smoothest.",
        20.0,
        within=(0, 50),
    )
    mirror: bool = key("Left and right swapped, for rear projection.", False)
    upside_down: bool = key("Turned by 180 degrees, for a projector that hangs from the ceiling.", False)
    brightness: float = key("Factor on the brightness of the picture.", 1.0, within=(0.0, 2.0))
    gamma: float = key("Above 1 lifts the dark tones, below 1 deepens them.", 1.0, within=(0.3, 3.0))
    wall: Literal["projector", "screen"] = key(
        "projector: haze that is nearly black is black, else the picture is a grey rectangle on the wall; "
        "screen: LED walls and monitors show all of it.",
        "projector",
    )
    edge_blend: EdgeBlendConfig | None = key(
        str(EdgeBlendConfig.__doc__) + " null: only one projector.", None
    )
    masks: list[MaskConfig] = key("Areas that stay dark whatever the picture shows.", [], length=(0, 16))
    stream: StreamConfig | None = key(str(StreamConfig.__doc__) + " null: none.", None)
