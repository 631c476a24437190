"""Made motions: when the dance goes over to what the generator made, and where its loops come from."""

from __future__ import annotations

from pathlib import Path

from appliance.box.made_motion import FOLDER, MadeMotion, MadeMotionReader
from appliance.box.orders import Order
from appliance.dancer.loop import Loop
from appliance.dancer.material.material_file import SUFFIX, Material, parsed_recipe, read_material
from appliance.dancer.motion_source import Playback
from appliance.levers.sources import GRANULAR, IMPROVISE, LIVE, VARY
from appliance.show.show import Show
from appliance.stage.stage_parts import StageParts

LATE_S = 3.0  # after which a source that was called and has not come is late
MELT_S = 1.0  # from one variation to the next
ORDER = "made"
_ANEW = (VARY, GRANULAR, IMPROVISE)  # another one at every return
_ROUND_S = 0.5  # back by more than this, a loop has come round
_AHEAD_S = 3.0  # what goes on from a moment that is farther ahead does not wait for it


class MadeMotions:
    """Follows what the generator makes for one puppet, at the price of a small read a tick, while a source of
    it is wanted.

    wanted: the source or kept motion that was called last; source: what the puppet starts from by the show;
    "" for none that is made. is_late: the dance goes on with what is there, because nothing newer came in
    time.
    """

    def __init__(
        self, folder: Path, joints: tuple[str, ...], motion: Playback, puppet: int, source: str
    ) -> None:
        self._reader, self._folder, self._joints = MadeMotionReader(folder, puppet), folder / FOLDER, joints
        self._motion, self._puppet, self.source = motion, puppet, source
        self.wanted, self._since = "", 0.0
        self._place = (0, 0.0)  # number of the loop, second in it
        self._tried: MadeMotion | None = None
        self._seen: MadeMotion | None = None
        self._seen_at = 0.0
        self.is_late = False

    def order(self, wanted: str, fade_s: float, now: float) -> Order | None:
        """The order to dance what was made, once it is time; wanted: a source or a kept motion, or ""."""
        if wanted != self.wanted:
            self.wanted, self._since, self.is_late = wanted, now, False
        if not wanted:
            return None
        dances, newest = self._motion.made, self._reader.read()
        before, self._place = self._place, (self._motion.number, self._motion.position_s)
        back_s = before[1] - self._place[1] if before[0] == self._place[0] else 0.0
        returned = (back_s if self._motion.rate >= 0 else -back_s) > _ROUND_S
        is_here = dances is not None and dances.name == wanted
        if newest is None or newest.name != wanted or newest is self._tried:
            self.is_late |= returned and wanted in _ANEW if is_here else now - self._since > LATE_S
            return None
        if newest is not self._seen:
            self._seen, self._seen_at = newest, now
        is_due = newest.at_once or returned or not is_here
        if newest.from_s is not None and (is_here or newest.at_once):
            is_due = returned or self._reaches(newest, before, now)
        if not is_due:
            return None
        self._tried, self.is_late = newest, False
        return Order(ORDER, (MELT_S if is_here else fade_s, float(self._puppet)), newest.recipe)

    def _reaches(self, newest: MadeMotion, before: tuple[int, float], now: float) -> bool:
        """Whether the dance is where this one goes on from; one that is wanted at once waits a moment."""
        ahead_s = (newest.from_s or 0.0) - self._place[1]
        if newest.at_once:
            return not 0.0 < ahead_s <= _AHEAD_S or now - self._seen_at > _AHEAD_S
        return before[0] == self._place[0] and ahead_s <= 0.0 < ahead_s + self._place[1] - before[1]

    def loop(self, recipe: str) -> Loop:
        """The loop of a recipe that the generator has made. Raises ValueError."""
        try:
            material = self._material(int(parsed_recipe(recipe)["number"]))
        except OSError as error:
            raise ValueError(
                f"What was made cannot be read ({error.strerror}); the phrase plays on."
            ) from None
        except LookupError:
            raise ValueError("What was made has no sound recipe; the phrase plays on.") from None
        if material.recipe != recipe:
            raise ValueError("What was made was made by another recipe; the phrase plays on.")
        return material.loop

    def danced_before(self, number: int) -> Material | None:
        """The motion that the stage danced before it was restarted, if it is still there."""
        try:
            material = self._material(number)
        except (OSError, ValueError):
            return None
        newest = self._reader.read()
        if newest is not None and newest.recipe == material.recipe:
            self._tried = newest
        return material

    def _material(self, number: int) -> Material:
        """The generator's motion with this number. Raises OSError, ValueError."""
        return read_material(self._folder / f"{number}{SUFFIX}", self._joints)

    def close(self) -> None:
        self._reader.close()


def open_made_motions(folder: Path, show: Show, parts: StageParts) -> tuple[MadeMotions, ...]:
    """The generator's output for each puppet, if the show has such sources; the parts take their loops from
    there.
    """
    config, phrases = show.config, show.phrases
    if not config.motion.made_sources:
        return ()
    made = tuple(
        MadeMotions(
            folder,
            show.skeleton.names,
            one.motion,
            puppet=start.number,
            source="" if start.source in (*phrases, LIVE) else start.source,
        )
        for start, one in zip(config.cast, parts.puppets, strict=True)
    )
    parts.make_by(made[0].loop)
    return made
