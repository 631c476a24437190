"""The command line of `bunraku improvise`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions


@dataclass(frozen=True)
class PhraseOptions:
    """How to make a phrase."""

    seconds: float = 90.0
    seed: int = 1
    temperature: float = 1.2
    dances: int = 16
    minutes: float = 4.0  # length of each dance
    finalists: int = 4
    settling: int = 250  # iterations of gradient descent that plant the feet


@dataclass(frozen=True)
class ImproviseOptions:
    """The command line of bunraku improvise. checkpoint: of a puppet; model: of a trained improviser.
    show: one with an improviser, instead of both. regions: improvise, the others go on with the prompt.
    """

    checkpoint: Path | None
    out: Path
    recordings: Path | None = None
    model: Path | None = None
    minutes: float = 12.0
    steps: int = 0
    threads: int = 0
    phrase: PhraseOptions = field(default_factory=PhraseOptions)
    prompt: Path | None = None
    prompt_end: float | None = None  # seconds of the prompt; None: all of it
    reading: ReadingOptions = AS_THE_FILES_SAY
    show: Path | None = None
    regions: tuple[str, ...] = ()
