"""show.yaml's section about looks: how the figure is drawn, in which colours, and from where it is seen."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, BeforeValidator, Field

from appliance.show.section import Section, refusal

Style = Literal["plaster", "lines", "ink", "cloud", "veil"]
STYLES: tuple[Style, ...] = get_args(Style)


def _given(value: object) -> object:
    if value is None or isinstance(value, int):
        raise refusal(
            "This colour is empty: after a # YAML reads a comment, and digits alone are a number.",
            "Write it in quotes, for instance '#f2e6d8', or leave the key out for the look's own colour.",
        )
    return value


def _hexadecimal(colour: str) -> str:
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", colour):
        raise refusal(
            f"'{colour}' is not a colour.",
            "Write red, green and blue in two hexadecimal digits each, in quotes: '#f2e6d8'.",
        )
    return colour.lower()


Colour = Annotated[Annotated[str, AfterValidator(_hexadecimal)] | None, BeforeValidator(_given)]


class CameraConfig(Section):
    """From where the figure is seen. Everything is in proportion to the figure, so that any size fits."""

    move: Literal["still", "drift", "orbit"] = Field(
        default="drift",
        description="still: stays at its angle; drift: sways slowly about it; orbit: circles the figure.",
    )
    angle_deg: float = Field(
        default=24.0,
        ge=-180,
        le=180,
        description="From where it looks: 0 from the front (+z), 90 from the left of the figure (+x).",
    )
    elevation_deg: float = Field(
        default=7.0, ge=-3, le=70, description="How steeply it looks down: 0 from the height of the chest."
    )
    lens_deg: float = Field(
        default=30.0,
        ge=10,
        le=75,
        description="Angle of view across the picture's shorter side: small is calm and flat, wide is close.",
    )
    figure: float = Field(
        default=0.7,
        ge=0.1,
        le=0.9,
        description="Share of the picture's height that the standing figure takes; in upright pictures of "
        "1.35 times their width.",
    )
    follow: float = Field(
        default=0.75,
        ge=0,
        le=1,
        description="How far it goes along: 1 keeps the dancer in the middle, 0 lets the dancer travel; "
        "before an arm leaves the picture it moves or draws back by itself.",
    )
    sweep_deg: float = Field(default=16.0, ge=0, le=90, description="How far drift sways to either side.")
    period_s: float = Field(
        default=70.0, ge=10, le=3600, description="Seconds for one sway of drift or one circle of orbit."
    )


class LookConfig(Section):
    """One look of the projection. A colour that is left out is the style's own."""

    name: str = Field(min_length=1, max_length=64, description="What cues and /look call it.")
    style: Style = Field(
        default="plaster",
        description="plaster: a sculpture in stage light; lines: strands of light; ink: brush and paper; "
        "cloud: thousands of points; veil: glass and its echoes.",
    )
    figure: Colour = Field(default=None, description="The figure: plaster, strands, ink, points.")
    light: Colour = Field(default=None, description="The key light; what is fresh and fast.")
    accent: Colour = Field(default=None, description="The rim light; what fades away.")
    background: Colour = Field(
        default=None, description="Air and floor, or the paper. Dark ones end in true black at the edges."
    )
    exposure: float = Field(default=1.0, ge=0.1, le=4, description="Brightness of the whole picture.")
    fog: float = Field(default=0.5, ge=0, le=1, description="How much haze hangs in the air.")
    shadow: float = Field(
        default=0.8, ge=0, le=1, description="How dark shadows are (plaster), how clear the floor mirrors."
    )
    trail_s: float = Field(
        default=1.0, ge=0, le=1.2, description="How long movement leaves its trace, in seconds; 0: none."
    )
    glow: float = Field(default=0.6, ge=0, le=1, description="How far light spills around what is bright.")
    density: float = Field(
        default=0.6, ge=0.1, le=1, description="How many strands, echoes or points; the grain of the ink."
    )
    vignette: float = Field(
        default=0.4, ge=0, le=1, description="How far the picture fades to black towards its edges."
    )
    render_scale: float = Field(
        default=0.7,
        ge=0.25,
        le=1,
        description="Resolution that the figure is drawn at, in proportion to the picture; "
        "smaller is softer and takes less of a small computer.",
    )
    camera: CameraConfig = Field(default_factory=CameraConfig, description=str(CameraConfig.__doc__))


def looks_by_name(looks: Sequence[LookConfig]) -> dict[str, LookConfig]:
    """The looks in their order, by name; without any the built-in ones by the names of their styles."""
    chosen = looks or [LookConfig(name=style, style=style) for style in STYLES]
    return {look.name: look for look in chosen}
