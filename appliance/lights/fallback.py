"""The lights' fallbacks: when a wire or the stage is away."""

from __future__ import annotations

from appliance.box.fallback import Fallback

DMX_AWAY = Fallback(
    "dmx-away",
    "A wire to the lights is away. They hold or fade as the node or the adapter is set, and dance again as "
    "soon as it is back: it is reopened by itself. Plug it in, or switch the node on.",
    "The lights' wire {about} is away: its lights hold or fade as the node or the adapter is set, and dance "
    "again as soon as it is back: it is reopened by itself. Plug it in, or switch the node on.",
)
STAGE_UNSEEN = Fallback(
    "lights-safe",
    "No frame came from the stage for a second: the lights fade to their safe look, and dance again as soon "
    "as the stage does. See what the stage says.",
)
OF_THE_LIGHTS = (DMX_AWAY, STAGE_UNSEEN)
