"""What the box's terminal says about commands: why it is dark, that it goes on, which cue is in force."""

from __future__ import annotations

from appliance.box.show_state import House

_PAUSE_S = 0.5  # a fader or a button that somebody plays with never floods the terminal


def held_back(house: House) -> str:
    """Why the audience sees nothing, and what lifts it; empty where nothing is held back."""
    if house.panic:
        return "Panic is in force: black, lights safe. /go lifts it."
    if not house.going:
        return "The show is stopped: dark. /go lets it go on."
    if house.blackout:
        return "Blackout is in force. /blackout 0 lifts it."
    return "" if house.master > 0.0 else "Master is at 0 %: dark. /master 1 brings picture and lights back."


class News:
    """Tells each change once; of several within half a second the last."""

    def __init__(self, house: House) -> None:
        self._said_at = float("-inf")
        self._held_back, self._cue = held_back(house), house.cue

    def look(self, house: House, now: float) -> str:
        """A sentence when something is new; call it often."""
        held, cue = held_back(house), house.cue
        if (held, cue) == (self._held_back, self._cue) or now - self._said_at < _PAUSE_S:
            return ""
        words = [f"Cue {cue}."] if cue and cue != self._cue else []
        if held != self._held_back:
            words.append(held or "Picture and lights are back.")
        self._said_at, self._held_back, self._cue = now, held, cue
        return " ".join(words)
