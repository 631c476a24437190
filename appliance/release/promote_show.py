"""The proof: a chosen show that has danced is a good one, and so it is kept; one that has not is let go."""

from __future__ import annotations

import os
from pathlib import Path

from appliance.keeper.keeper_health import CHOICE_NOT_KEPT
from appliance.outputs.frame_reader import FrameReader
from appliance.release.choice import CHOSEN, Choice, alone_in
from appliance.release.start_attempts import PROVEN_S

_AGAIN_S = 10.0  # a disk that took nothing is tried again


class Proof:
    """A carrier of the keeper: notes once in a stage's life, after PROVEN_S of dancing, what became of it."""

    fallback = CHOICE_NOT_KEPT.name

    def __init__(self, runtime: Path, chosen: Path) -> None:
        self.complaint = ""
        self._frames = FrameReader(runtime)
        self._chosen = chosen
        self._proven: tuple[int, str] | None = None
        self._again_at = 0.0

    def turn(self, now: float) -> None:
        """Look whether the stage has danced for long enough; monotonic seconds."""
        newest, facts = self._frames.newest(now), self._frames.facts
        if newest is None or facts is None or facts.rehearsal or now < self._again_at:
            return
        if newest.left - facts.started < PROVEN_S:
            return
        choice = Choice.read(self._chosen)
        if choice is None or facts.show_directory != choice.first.show.resolve():
            return
        if self._proven != (facts.pid, choice.first.id) and self._is_noted(choice.first.id, now):
            self._proven = (facts.pid, choice.first.id)

    def last_turn(self) -> None:
        """Nothing waits."""
        self._frames.close()

    def _is_noted(self, identity: str, now: float) -> bool:
        """Nobody is waited for: while a preflight reads a stick, the journal has to go on."""
        self.complaint, self._again_at = "", now + _AGAIN_S
        try:
            with alone_in(self._chosen.parent):
                choice = Choice.read(self._chosen)
                if choice is None or choice.first.id != identity:
                    return False
                choice.with_good(identity).write(self._chosen)
            with alone_in(choice.data):
                kept = Choice.read(choice.data / CHOSEN)
                noted = None if kept is None else kept.with_good(identity).without(choice)
                if noted is not None and noted != kept:
                    noted.write(choice.data / CHOSEN)
        except BlockingIOError:
            return False
        except OSError as error:
            self.complaint = (
                f"{self._chosen.parent} or the data partition: that the show has danced cannot be kept "
                f"({os.strerror(error.errno or 0)}). The dance goes on; after the next power-on it is tried "
                "anew. Look at the data partition."
            )
            return False
        self._again_at = 0.0
        return True
