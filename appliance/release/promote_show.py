"""A chosen show that has danced is a good one: mirrored to the disk once in a stage's life."""

from __future__ import annotations

from pathlib import Path

from appliance.keeper.fallback import CHOICE_NOT_KEPT
from appliance.keeper.mirror import reason_of
from appliance.outputs.frame_reader import FrameReader
from appliance.release.choice import CHOSEN, Choice, alone_in
from appliance.release.start_attempts import PROVEN_S


class MirroredProof:
    """After PROVEN_S of dancing: the pair that dances is good, and those that did not dance are let go."""

    name, fallback = "That a show has danced", CHOICE_NOT_KEPT
    recovered = "That the show has danced is kept now."

    def __init__(self, runtime: Path, chosen: Path) -> None:
        self._frames = FrameReader(runtime)
        self._chosen = chosen
        self._proven: tuple[int, str] | None = None

    def copy(self, now: float) -> None:
        """As Mirrored; while a preflight reads a stick it waits for another turn."""
        newest, facts = self._frames.newest(now), self._frames.facts
        if newest is None or facts is None or facts.rehearsal or newest.left - facts.started < PROVEN_S:
            return
        choice = Choice.read(self._chosen)
        if choice is None or facts.show_directory != choice.first.show.resolve():
            return
        proven = (facts.pid, choice.first.id)
        if self._proven != proven and self._is_noted(choice.first.id):
            self._proven = proven

    def explain(self, error: Exception) -> str:
        """The complaint."""
        return (
            f"{self._chosen.parent} or the data partition: that the show has danced cannot be kept "
            f"({reason_of(error)}). The dance goes on; after the next power-on the show is tried again. "
            "Check the data partition."
        )

    def close(self) -> None:
        """Release the shared frame."""
        self._frames.close()

    def _is_noted(self, identity: str) -> bool:
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
        return True
