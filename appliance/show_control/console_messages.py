"""The terminal's messages about commands: why it is dark, that it goes on, which cue is in force."""

from __future__ import annotations

from appliance.levers.show_state import ShowState
from appliance.levers.table import MASTER

_PAUSE_S = 0.5  # a fader that moves all the time never floods the terminal


def held_back(show_state: ShowState) -> str:
    """Why the audience sees nothing, and what lifts it; empty where nothing is held back."""
    if show_state.panic:
        return "Panic is in force: black, lights safe. /go lifts it."
    if not show_state.going:
        return "The show is stopped: dark. /go lets it go on."
    if show_state.blackout:
        return "Blackout is in force. /blackout 0 lifts it."
    return (
        ""
        if show_state[MASTER].value > 0.0
        else "Master is at 0 %: dark. /master 1 brings picture and lights back."
    )


class ConsoleMessages:
    """Tells each change once; of several within half a second the last."""

    def __init__(self, show_state: ShowState) -> None:
        self._said_at = float("-inf")
        self._held_back, self._cue = held_back(show_state), show_state.cue

    def look(self, show_state: ShowState, now: float) -> str:
        """A sentence when something is new; call it often."""
        held, cue = held_back(show_state), show_state.cue
        if (held, cue) == (self._held_back, self._cue) or now - self._said_at < _PAUSE_S:
            return ""
        messages = [f"Cue {cue}."] if cue and cue != self._cue else []
        if held != self._held_back:
            messages.append(held or "Picture and lights are back.")
        self._said_at, self._held_back, self._cue = now, held, cue
        return " ".join(messages)
