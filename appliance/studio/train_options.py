"""The options of `bunraku train`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions


@dataclass(frozen=True)
class TrainOptions:
    """The command line of bunraku train. written: those of model and seed that the user gave."""

    out: Path
    recordings: Path | None = None
    model: str = "puppet"
    network: str | None = None
    window: int = 0
    minutes: float | None = None
    steps: int | None = None
    seed: int = 1
    latent: int = 0
    width: int = 0
    depth: int = 0
    mixtures: int = 0
    ahead: int = 0
    learning_rate: float = 0.0
    batch: int = 0
    full_precision: bool = False
    puppet: Path | None = None
    start: Path | None = None
    resume: bool = False
    threads: int = 0
    device: str = "auto"
    catalogue: Path | None = None
    held_out: tuple[str, ...] = ()
    reading: ReadingOptions = AS_THE_FILES_SAY
    keep: tuple[str, ...] = ()
    phrase: Path | None = None
    name: str | None = None
    hand: str | None = None
    written: tuple[str, ...] = ()
