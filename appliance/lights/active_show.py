"""The bill: which show the stage dances, as the shared frame says, and whether it is another one by now."""

from __future__ import annotations

from appliance.outputs.frame_reader import FrameReader
from appliance.show.show import Show, load_show


class ActiveShow:
    """Follows the stage from show to show."""

    def __init__(self, stage: FrameReader) -> None:
        self._stage = stage
        self._generation = stage.generation - 1
        self._taken: tuple[str, bytes] | None = None
        self._is_new = False

    def is_new(self, now: float) -> bool:
        """Whether the stage dances another show than the one taken last, or that one after a change."""
        self._stage.newest(now)
        if self._stage.facts is not None and self._stage.generation != self._generation:
            self._generation = self._stage.generation
            self._is_new = self._written() != self._taken
        return self._is_new

    def take(self) -> Show:
        """The show of the stage; raises ConfigError when its folder is not in order any more."""
        self._taken, self._is_new = self._written(), False
        assert self._stage.facts is not None, "a bill is taken when it is new"
        return load_show(self._stage.facts.show_directory)

    def _written(self) -> tuple[str, bytes] | None:
        """What tells a show from another: its folder and what stands in show.yaml."""
        if self._stage.facts is None:
            return None
        folder = self._stage.facts.show_directory
        try:
            return str(folder), (folder / "show.yaml").read_bytes()
        except OSError:
            return str(folder), b""
