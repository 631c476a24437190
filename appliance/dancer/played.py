"""What a playback plays now: the window that the puppet starts from, and where it comes from."""

from __future__ import annotations

from collections.abc import Callable

from appliance.dancer.loop import Loop
from appliance.dancer.repertoire import Repertoire
from appliance.dancer.slerp import FloatArray
from appliance.dancer.stream import Stream


class Played:
    """The played motion, a continuous stream: its next poses, the first of them the pose of this tick."""

    _repertoire: Repertoire
    _stream: Stream

    @property
    def phrases(self) -> tuple[str, ...]:
        """Names of all phrases, the show's first phrase first."""
        return self._repertoire.names

    def loop_of(self, name: str) -> Loop:
        """The whole loop of a phrase. Raises ValueError."""
        return self._repertoire.find(name)[1]

    def make_by(self, make: Callable[[str], Loop]) -> None:
        """Set where the loops of recipes come from; it raises ValueError."""
        self._repertoire.make = make

    def made_by(self, recipe: str) -> Loop:
        """The loop of a recipe. Raises ValueError."""
        return self._repertoire.make(recipe)

    def window(self) -> FloatArray:
        """The next poses (window, J, 4) of the motion, without sign jumps; valid until advance()."""
        return self._stream.poses()

    def roots(self) -> FloatArray:
        """The root's position (window, 3) in metres at the poses of the window."""
        return self._stream.roots()

    @property
    def lift(self) -> float:
        """How far the phrase is above the floor (metres) at the window's first pose."""
        return self._stream.lift

    @property
    def rest_heights(self) -> FloatArray | None:
        """Heights (S,) in metres of the soles' points while they stand, at the window's first pose."""
        heights = self._stream.rest_heights
        return heights if len(heights) else None

    @property
    def phrase(self) -> str:
        """Name of the phrase of the window's first pose; in a crossfade the entering one."""
        return self._repertoire.name_of(self._stream.number)

    @property
    def number(self) -> int:
        """Number of the phrase or of what was made, of the window's first pose."""
        return self._stream.number

    @property
    def standing(self) -> tuple[float, float, float]:
        """The root on the stage at the window's first pose: x, z in metres, heading in radians."""
        return self._stream.standing
