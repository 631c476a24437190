"""Which show the stage dances, by the shared frame, and whether it has changed."""

from __future__ import annotations

from appliance.outputs.frame_reader import FrameReader
from appliance.show.show import Show, load_show


class ActiveShow:
    """The show of the stage, from one to the next."""

    def __init__(self, stage: FrameReader) -> None:
        self._stage = stage
        self._generation = stage.generation - 1
        self._taken: tuple[str, bytes] | None = None
        self._is_new = False

    def is_new(self, now: float) -> bool:
        """Whether the stage dances another show than the one loaded last, or an edited one."""
        self._stage.newest(now)
        if self._stage.facts is not None and self._stage.generation != self._generation:
            self._generation = self._stage.generation
            self._is_new = self._written() != self._taken
        return self._is_new

    def load(self) -> Show:
        """The show of the stage. Raises ConfigError when its folder is broken by now."""
        self._taken, self._is_new = self._written(), False
        assert self._stage.facts is not None, "only a new show is loaded"
        return load_show(self._stage.facts.show_directory)

    def _written(self) -> tuple[str, bytes] | None:
        """The identity of a show: its folder and the text of show.yaml."""
        if self._stage.facts is None:
            return None
        folder = self._stage.facts.show_directory
        try:
            return str(folder), (folder / "show.yaml").read_bytes()
        except OSError:
            return str(folder), b""
