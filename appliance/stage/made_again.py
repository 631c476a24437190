"""Motion made ahead, made again from its recipe: a replay has no generator."""

from __future__ import annotations

from collections.abc import Callable

from appliance.dancer.loop import Loop
from appliance.dancer.material.maker import Maker
from appliance.dancer.material.material_file import parsed_recipe
from appliance.dancer.motion_source import Playback
from appliance.show.show import Show


def maker_of(show: Show, motion: Playback) -> Callable[[str], Loop]:
    """Gives the loop of a recipe, which may have been made before; raises ValueError."""
    maker = Maker(show.skeleton, show.motion_networks, motion.loop_of, show.config.motion.grounded)
    done: dict[str, Loop] = {}

    def made(recipe: str) -> Loop:
        if recipe not in done:
            try:
                done[recipe] = maker.make(parsed_recipe(recipe))
            except (LookupError, TypeError) as error:
                raise ValueError(f"This show cannot make it again ({error}).") from None
        return done[recipe]

    return made
