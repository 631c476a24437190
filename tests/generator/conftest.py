"""A runtime folder whose stage says what it dances, and the generator beside it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from appliance.box.fallback import Fallbacks
from appliance.box.made_motion import MadeMotionReader
from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.generator.fallback import OF_THE_GENERATOR
from appliance.generator.generator import Generator
from appliance.levers.show_state import Change, ShowState
from appliance.levers.table import find_lever
from appliance.outputs.frame_reader import FrameReader
from appliance.show.box import BoxConfig
from appliance.show.show import load_show


class Bench:
    """The generator of a show, what was declared for it, and what it made."""

    def __init__(self, show: Path, folder: Path, state: Path | None) -> None:
        self.show, self.folder = load_show(show), folder
        self.declared = ShowState(show=self.show.config.name)
        self.reported: dict[str, Any] = {"name": "", "base": "main", "made": ""}
        self.health: dict[str, Any] = {"puppets": [self.reported]}
        self._closed, self._now = False, time.monotonic()
        self.fallbacks = Fallbacks(OF_THE_GENERATOR)
        self._writer, self._reader = ShowStateWriter(folder), ShowStateReader(folder)
        self.made = MadeMotionReader(folder)
        stage = FrameReader(folder)
        stage.health = lambda: self.health  # type: ignore[method-assign]
        box = BoxConfig(runtime=folder, state=state)
        self.generator = Generator(self.show, box, folder, stage, self.fallbacks)

    def declare(self, **parts: tuple[str, tuple[float, ...]]) -> None:
        """Parts of the dance, '_' for a blank in their names."""
        named = {name.replace("_", " "): part for name, part in parts.items()}
        changes = [
            Change(lever, *lever.given(*part))
            for name, part in named.items()
            if (lever := find_lever(name)) is not None
        ]
        self.declared = self.declared.changed(time.monotonic(), changes)
        self._writer.write(self.declared)

    def recipe(self) -> dict[str, Any]:
        """Look once; the recipe of what was made last."""
        self._now += 1.0  # it rests between two motions
        self.generator.look(self._reader, self._now)
        made = self.made.read()
        return {} if made is None else dict(json.loads(made.recipe))

    def dance(self) -> dict[str, Any]:
        """The stage dances what was made last; then as `recipe`."""
        made = self.made.read()
        assert made is not None
        self.reported["made"] = made.recipe
        return self.recipe()

    def close(self) -> None:
        """Release all files, once."""
        if self._closed:
            return
        self._closed = True
        for one in (self.generator, self._writer, self._reader, self.made):
            one.close()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    """Makes a bench of a show; its state folder is `state`."""
    opened: list[Bench] = []

    def made(show: Path, state: Path | None = tmp_path / "state") -> Bench:
        folder = tmp_path / "runtime"
        folder.mkdir(mode=0o700, exist_ok=True)
        opened.append(Bench(show, folder, state))
        return opened[-1]

    yield made
    for one in opened:
        one.close()
