"""`bunraku train`: what was asked for becomes a training, and the training a show."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.progress import track

from appliance.studio.autoencoder.architectures import DEFAULT
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.autoencoder.training_run import TrainingRun, parameters
from appliance.studio.data import sources
from appliance.studio.data.sources import Sources
from appliance.studio.evaluation.coders import load_checkpoint
from appliance.studio.evaluation.findings import MASKED_PICTURE, findings, require_windows
from appliance.studio.evaluation.masked import draw_masked
from appliance.studio.evaluation.puppetry_words import print_answer
from appliance.studio.export.release import Request, release
from appliance.studio.studio_error import StudioError


@dataclass(frozen=True)
class Wish:
    """The command line of bunraku train."""

    out: Path
    recordings: Path | None = None
    network: str = DEFAULT
    minutes: float | None = None
    steps: int | None = None
    seed: int = 1
    latent: int = 0
    width: int = 0
    depth: int = 0
    resume: bool = False
    threads: int = 0
    device: str = "auto"
    catalogue: Path | None = None
    held_out: tuple[str, ...] = ()
    true_fps: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    phrase: Path | None = None
    name: str | None = None


def run(wish: Wish) -> bool:
    """Train, then make the show. False when it was stopped before its end; raises StudioError and others."""
    console = Console(stderr=True)
    checkpoint = wish.out / "checkpoint.pt"
    if wish.threads:
        torch.set_num_threads(wish.threads)
    device = choose_device(wish.device)
    settings, source, state = _beginning(wish, checkpoint)
    dataset = source.load(reading(console))
    for line in findings(dataset):
        console.print(f"- {line}", highlight=False)
    if any(take.errors for take in dataset.takes):
        draw_masked(wish.out / MASKED_PICTURE, dataset.takes)
    require_windows(dataset, settings.batch)
    training = Training(dataset, settings, device)
    training.origin = source.as_state()
    if state is not None:
        training.restore(state)
        training.origin = source.as_state()
    wish.out.mkdir(parents=True, exist_ok=True)
    console.print(_plan(training, device), highlight=False)
    if not TrainingRun(training, wish.out, console).run():
        again = f"bunraku train --resume --out {shlex.quote(str(wish.out))}"
        console.print(
            f"Stopped at {100 * training.fraction:.0f} %; nothing is lost. Go on with: {again}",
            highlight=False,
            soft_wrap=True,
        )
        return False
    name = wish.name or wish.out.resolve().name
    request = Request(checkpoint, source.recordings, wish.out, name, wish.phrase)
    report = release(request, dataset, source.catalogue, lambda words: console.print(words, highlight=False))
    print_answer(console, report["puppetry"])
    console.print(
        f"{wish.out} is a show. Dance it: bunraku play --show {shlex.quote(str(wish.out))} --emulate"
    )
    return True


def choose_device(wanted: str) -> str:
    """cuda or cpu. Raises StudioError where a GPU is asked for that is not there."""
    there = torch.cuda.is_available()
    if wanted == "cuda" and not there:
        raise StudioError(
            "There is no CUDA GPU that PyTorch can use. Leave --device out to train on the CPU."
        )
    return "cuda" if there and wanted != "cpu" else "cpu"


def reading(console: Console) -> Any:
    """A progress bar around the reading of recordings."""

    def progress(files: Sequence[Path]) -> Any:
        return track(files, "reading", console=console, transient=True, disable=not console.is_terminal)

    return progress


def _beginning(wish: Wish, checkpoint: Path) -> tuple[Settings, Sources, dict[str, Any] | None]:
    """Settings, recordings and, where a training goes on, its state."""
    if wish.resume:
        if not checkpoint.exists():
            raise StudioError(f"{wish.out} has no checkpoint.pt to go on from. Leave --resume out to begin.")
        state = load_checkpoint(checkpoint)[1]
        settings = Settings.from_state(state["settings"])
        return _paced(settings, wish), sources.remembered(state, wish.recordings, checkpoint), state
    if checkpoint.exists():
        raise StudioError(
            f"{wish.out} already has a training. Go on with it by --resume, or give another --out."
        )
    if wish.recordings is None:
        raise StudioError("Say where the recordings are: --recordings FOLDER.")
    settings = Settings(
        network=wish.network, latent=wish.latent, width=wish.width, depth=wish.depth, seed=wish.seed
    )
    source = sources.given(wish.recordings, wish.catalogue, wish.held_out, wish.true_fps, wish.keep)
    return _paced(settings, wish), source, None


def _paced(settings: Settings, wish: Wish) -> Settings:
    """Minutes or steps where they are asked for; both are bounds of the same training."""
    if wish.minutes is not None and wish.steps is not None:
        raise StudioError("Give --minutes or --steps, not both: each paces the learning rate.")
    if wish.steps is not None:
        return replace(settings, steps=wish.steps)
    if wish.minutes is not None:
        return replace(settings, minutes=wish.minutes, steps=0)
    return settings


def _plan(training: Training, device: str) -> str:
    settings, shape = training.settings, training.autoencoder.shape
    bound = f"{settings.steps} steps" if settings.steps else f"{settings.minutes:g} minutes"
    begun = f", {100 * training.fraction:.0f} % of it done" if training.step else ""
    where = "the GPU" if device == "cuda" else f"the CPU ({torch.get_num_threads()} threads)"
    count = parameters(training.autoencoder.network)
    return (
        f"{settings.network}, latent {shape.latent}, width {shape.width}: {count / 1e6:.2f} million "
        f"parameters; {bound} on {where}{begun}."
    )
