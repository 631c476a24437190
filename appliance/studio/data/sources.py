"""A training's recordings and their catalogue: from the command line, or from a checkpoint."""

from __future__ import annotations

import fnmatch
import glob
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.studio.data.catalogue import ALWAYS, Catalogue, find_catalogue, read_catalogue, recordings_in
from appliance.studio.data.dataset import Dataset, load_dataset
from appliance.studio.studio_error import StudioError


@dataclass(frozen=True)
class Sources:
    """A folder of recordings and its catalogue; part of a checkpoint."""

    recordings: Path
    catalogue: Catalogue

    def as_state(self) -> dict[str, Any]:
        """Plain values for a checkpoint."""
        return {"recordings": str(self.recordings.resolve()), "catalogue": asdict(self.catalogue)}

    def for_network(self, learned: Collection[str]) -> Sources:
        """For a network that learned from these takes before: another one is held out, if there is one."""
        files = recordings_in(self.recordings)
        takes = {file.stem: self.catalogue.take_of(file.stem) for file in files}
        names = sorted(set(takes.values()))
        if self.catalogue.held_out or len(names) == 1 or names[-1] not in learned:
            return self
        held = ([name for name in names if name not in learned] or names)[-1]
        apart = tuple(glob.escape(file) for file, take in takes.items() if take == held)
        return replace(self, catalogue=replace(self.catalogue, held_out=apart))

    def learned_by(self, dataset: Dataset, before: Collection[str] = ()) -> Sources:
        """The same, and which takes a network learns from: they are not held out later.

        before: those that it learned from elsewhere.
        """
        known = {*before, *self.catalogue.learned, *(take.take for take in dataset.training)}
        return replace(self, catalogue=replace(self.catalogue, learned=tuple(sorted(known))))

    def load(self, progress: Callable[[Sequence[Path]], Sequence[Path]]) -> Dataset:
        """Read every recording. Raises DatasetError or BvhError."""
        return load_dataset(self.recordings, self.catalogue, progress)


def given(
    recordings: Path,
    catalogue: Path | None = None,
    held_out: Sequence[str] = (),
    reading: ReadingOptions = AS_THE_FILES_SAY,
    keep: Sequence[str] = (),
) -> Sources:
    """Sources from options; options override the catalogue."""
    files = recordings_in(recordings)
    if not files:
        raise StudioError(f"{recordings} has no .bvh files. Give the folder that holds your recordings.")
    known = read_catalogue(catalogue) if catalogue else find_catalogue(recordings, files)
    known = replace(known, keep={**known.keep, **dict.fromkeys(keep, (ALWAYS,))})
    for pattern in (*known.keep, *known.mask, *held_out):
        if not any(fnmatch.fnmatch(file.stem, pattern) for file in files):
            raise StudioError(
                f"'{pattern}' has to be kept, masked or held out, but no recording in {recordings} has that "
                "name. Give the name of a file without .bvh, or a pattern such as 'solo_*'."
            )
    known = known.with_options(reading)
    return Sources(recordings, replace(known, held_out=tuple(held_out)) if held_out else known)


def remembered(
    state: dict[str, Any],
    recordings: Path | None,
    checkpoint: Path,
    reading: ReadingOptions = AS_THE_FILES_SAY,
) -> Sources:
    """Sources that a checkpoint was trained on, read as they were then but for what reading says.

    recordings: their folder, if they have moved since.
    """
    origin = state.get("origin") or {}
    if recordings is None and "recordings" not in origin:
        raise StudioError(f"{checkpoint} does not name its training recordings. Give --recordings.")
    folder = recordings or Path(origin["recordings"])
    if not folder.is_dir():
        raise StudioError(f"The recordings are no longer in {folder}. Give their folder with --recordings.")
    if "catalogue" not in origin:
        return given(folder, reading=reading)
    known = {"facing": {"*": "z"}, **origin["catalogue"]}  # trainings of before turned no recording
    catalogue = Catalogue(**{**known, "held_out": tuple(known["held_out"])})
    return Sources(folder, catalogue.with_options(reading))
