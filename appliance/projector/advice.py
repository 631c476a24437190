"""Advice: what it means for the audience that a machine draws slowly, and what to do."""

from __future__ import annotations

from appliance.projector.window import Size

_SMOOTH = 0.8  # of the display's pictures: fewer look jerky


def about_resolution(share: float, display: Size, wanted: float) -> str:
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
