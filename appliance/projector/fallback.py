"""The projector's fallbacks: what it does when the stage is away or the machine does not keep up."""

from __future__ import annotations

from appliance.box.fallback import Fallback

STAGE_UNSEEN = Fallback(
    "picture-black",
    "No frame came from the stage for half a second: the picture fades to black, and is back as soon as the "
    "stage is. Look what the stage says.",
)
PICTURES_SMALLER = Fallback(
    "pictures-smaller",
    "The machine does not keep up with the display: the picture is drawn smaller, which shows as softness. "
    "It comes back by itself; `picture` in the box file fixes it.",
)
OF_THE_PROJECTOR = (STAGE_UNSEEN, PICTURES_SMALLER)
