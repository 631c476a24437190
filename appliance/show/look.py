"""show.yaml's section about looks: how the figure is drawn, in which colours, and from where it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, get_args

from pydantic import model_validator

from appliance.show.picture_file import Colour, PictureFile
from appliance.show.section import BundleFile, Section, key, part, refusal

Style = Literal["plaster", "lines", "ink", "cloud", "veil", "strings"]
STYLES: tuple[Style, ...] = get_args(Style)
Move = Literal["still", "drift", "orbit"]


class CameraConfig(Section):
    """From where the figure is seen. Everything is in proportion to the figure, so that any size fits."""

    move: Move = key(
        "still: stays at its angle; drift: sways slowly about it; orbit: circles the figure.", "drift"
    )
    angle_deg: float = key(
        "Direction from which it looks: 0 from the front (+z), 90 from the left of the figure (+x).",
        24.0,
        within=(-180, 180),
    )
    elevation_deg: float = key(
        "How steeply it looks down: 0 from the height of the chest.", 7.0, within=(-3, 70)
    )
    lens_deg: float = key(
        "Angle of view across the picture's shorter side: small is calm and flat, wide is close.",
        30.0,
        within=(10, 75),
    )
    figure: float = key(
        "Height of the standing figure as a fraction of the picture's; in upright pictures of "
        "1.35 times their width.",
        0.7,
        within=(0.1, 0.9),
    )
    follow: float = key(
        "How closely it follows: 1 keeps the dancer in the middle, 0 lets the dancer travel; "
        "before an arm leaves the picture it moves or draws back.",
        1.0,
        within=(0, 1),
    )
    sweep_deg: float = key("How far drift sways to either side.", 16.0, within=(0, 90))
    period_s: float = key("Seconds for one sway of drift or one circle of orbit.", 70.0, within=(10, 3600))


class CameraChange(Section):
    """The camera in a cue, whatever the look. Keys left out stay as the look has them; {}: all of them."""

    move: Move | None = key("still, drift or orbit.", None)
    angle_deg: float | None = key(
        "0 from the front, 90 from the left of the figure.", None, within=(-180, 180)
    )
    elevation_deg: float | None = key("How steeply it looks down.", None, within=(-3, 70))
    figure: float | None = key(
        "Height of the standing figure as a fraction of the picture's.", None, within=(0.1, 0.9)
    )
    lens_deg: float | None = key("Angle of view: small is flat, wide is close.", None, within=(10, 75))
    follow: float | None = key("How closely it follows the dancer.", None, within=(0, 1))


class HeldConfig(Section):
    """How the joint is marked that a hand holds: it grows and fades as the hand takes and releases it."""

    colour: Colour = key("Colour of the held limb; default: the style's own.", None)
    strength: float = key("Strength of the mark; 0: none.", 1.0, within=(0, 1))


class LookConfig(Section):
    """One look of the projection. A colour that is left out is the style's own."""

    name: str = key("Name for cues and /look.", length=(1, 64))
    style: Style = key(
        "plaster: a sculpture in stage light; lines: strands of light; ink: brush and paper; "
        "cloud: thousands of points; veil: glass and its echoes; "
        "strings: which limbs follow the held joint.",
        "plaster",
    )
    figure: Colour = key("The figure: plaster, strands, ink, points.", None)
    light: Colour = key("The key light; fresh and fast movement.", None)
    accent: Colour = key("The rim light; fading movement.", None)
    background: Colour = key("Air and floor, or the paper. Dark ones end in true black at the edges.", None)
    image: PictureFile | None = key(
        "PNG or JPEG file in the bundle, behind the figure; it fills the picture.", None
    )
    video: BundleFile | None = key(
        "Video file in the bundle (MP4, WebM and others), instead of an image; it is looped, without sound. "
        "The box needs ffmpeg for it.",
        None,
    )
    exposure: float = key("Brightness of the whole picture.", 1.0, within=(0.1, 4))
    fog: float = key("Amount of haze in the air.", 0.5, within=(0, 1))
    shadow: float = key("Darkness of shadows (plaster), clarity of the floor's mirror.", 0.8, within=(0, 1))
    trail_s: float = key("How long movement leaves its trace, in seconds; 0: none.", 1.0, within=(0, 1.2))
    glow: float = key("How far light spills around bright areas.", 0.6, within=(0, 1))
    density: float = key("Number of strands, echoes or points; the grain of the ink.", 0.6, within=(0.1, 1))
    melt: float = key(
        "How amorphous the figure is: 0 a human body, 1 a lump whose surface swims. Not in lines.",
        0.0,
        within=(0, 1),
    )
    vignette: float = key("How far the picture fades to black towards its edges.", 0.4, within=(0, 1))
    render_scale: float | None = key(
        "Resolution of the figure, relative to the picture; smaller is softer and takes "
        "less time on a small computer. null: 1 if the machine has time for it, otherwise 0.7.",
        None,
        within=(0.25, 1),
    )
    held: HeldConfig = part(HeldConfig)
    camera: CameraConfig = part(CameraConfig)

    @model_validator(mode="after")
    def _has_one_backdrop(self) -> LookConfig:
        if self.image is not None and self.video is not None:
            raise refusal("A look has an image or a video behind the figure.", "Remove one.", at="video")
        return self


def looks_by_name(looks: Sequence[LookConfig], directory: Path | None = None) -> dict[str, LookConfig]:
    """The looks in their order, by name; without any the built-in ones by the names of their styles.

    directory: of the show; the looks' images and videos then have their whole paths.
    """
    chosen = list(looks) or [LookConfig(name=style, style=style) for style in STYLES]
    if directory is not None:
        files = [{"image": look.image, "video": look.video} for look in chosen]
        chosen = [
            look.model_copy(update={key: str(directory / name) for key, name in named.items() if name})
            for look, named in zip(chosen, files, strict=True)
        ]
    return {look.name: look for look in chosen}
