"""A checkpoint with the recordings that it was trained on, read again with a progress bar."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.studio.data import sources
from appliance.studio.data.dataset import Dataset
from appliance.studio.evaluation.coders import TorchCoder, load_checkpoint
from appliance.studio.progress import shown
from appliance.studio.studio_error import StudioError


def trained_on(
    checkpoint: Path,
    joints: Sequence[str],
    state: dict[str, Any],
    recordings: Path | None,
    console: Console,
    reading: ReadingOptions = AS_THE_FILES_SAY,
) -> Dataset:
    """recordings: their folder, if they have moved. Raises StudioError where other joints move in them."""
    dataset = sources.remembered(state, recordings, checkpoint, reading).load(reading_progress(console))
    if list(dataset.moving_names) != list(joints):
        raise StudioError(
            f"{checkpoint} moves {', '.join(joints)}; the recordings move "
            f"{', '.join(dataset.moving_names)}. Give the recordings that the checkpoint was trained on."
        )
    return dataset


def open_model(
    model: str,
    checkpoint: Path,
    recordings: Path | None,
    console: Console,
    reading: ReadingOptions = AS_THE_FILES_SAY,
) -> tuple[TorchCoder, Dataset]:
    """A checkpoint of `train --model` and its recordings. Raises StudioError for one of another model."""
    coder, state = load_checkpoint(checkpoint)
    if state["settings"].get("model") != model:
        raise StudioError(f"{checkpoint} is no {model} model. Train one with: bunraku train --model {model}.")
    return coder, trained_on(checkpoint, coder.joints, state, recordings, console, reading)


def reading_progress(console: Console) -> Any:
    """Wraps the reading of recordings in a progress bar."""

    def progress(files: Sequence[Path]) -> Any:
        return shown(files, "reading the recordings", console)

    return progress
