"""The projector's fallbacks, for a stage that is away or a machine that does not keep up, and advice."""

from __future__ import annotations

from appliance.box.fallback import Fallback

STAGE_UNSEEN = Fallback(
    "picture-black",
    "No frame came from the stage for half a second: the picture fades to black, and is back as soon as the "
    "stage is. See what the stage says.",
)
PICTURES_SMALLER = Fallback(
    "pictures-smaller",
    "The machine does not keep up with the display: the picture is drawn smaller, which shows as softness. "
    "It comes back by itself; `picture` in the box file fixes it.",
)
OF_THE_PROJECTOR = (STAGE_UNSEEN, PICTURES_SMALLER)

_SMOOTH = 0.8  # fraction of the display's pictures: fewer look jerky


def about_resolution(share: float, display: tuple[int, int], wanted: float) -> str:
    """Pictures of the display's own size take too long; share: of its sides; wanted: pictures a second."""
    width, height = (round(share * side) for side in display)
    return (
        f"Pictures of {display[0]}x{display[1]} take longer here than a display of {wanted:.0f} Hz waits. "
        f"The audience sees the dance in {width}x{height}: softer, and smoother. That changes by itself with "
        "the look and with what else this machine does; `picture` in the projector's part of the box file "
        "fixes it."
    )


def about_software(rate: float, wanted: float, renderer: str) -> str:
    """No graphics card draws; rate, wanted: pictures a second."""
    seen = "The audience sees a jerky dance." if rate < _SMOOTH * wanted else "The audience sees the dance."
    return (
        f"No graphics card draws here but the processor ({renderer}): about {rate:.0f} of {wanted:.0f} "
        f"pictures a second. {seen} Use a machine with a graphics card and its driver, or a display "
        "mode of fewer pixels."
    )
