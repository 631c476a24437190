"""`bunraku train`: from recordings to a trained network, and from it to a show."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console

from appliance.studio.autoencoder.models import MODELS, settings_for
from appliance.studio.autoencoder.training import Settings, Training
from appliance.studio.autoencoder.training_run import TrainingRun, parameters
from appliance.studio.data import sources
from appliance.studio.data.dataset import WINDOW
from appliance.studio.data.sources import Sources
from appliance.studio.evaluation.coders import load_checkpoint
from appliance.studio.evaluation.findings import MASKED_PICTURE, findings, require_windows
from appliance.studio.evaluation.masked import draw_masked
from appliance.studio.export.release import Request, release
from appliance.studio.studio_error import StudioError
from appliance.studio.trained_on import reading_progress
from appliance.studio.variations.sweep import report


@dataclass(frozen=True)
class TrainOptions:
    """The command line of bunraku train."""

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
    resume: bool = False
    threads: int = 0
    device: str = "auto"
    catalogue: Path | None = None
    held_out: tuple[str, ...] = ()
    true_fps: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    phrase: Path | None = None
    name: str | None = None


def run(options: TrainOptions) -> bool:
    """Train, then write the show. False if it was stopped before its end.

    Raises StudioError, DatasetError or BvhError.
    """
    console = Console(stderr=True)
    checkpoint = options.out / "checkpoint.pt"
    if options.threads:
        torch.set_num_threads(options.threads)
    device = choose_device(options.device)
    settings, source, state = _settings_and_source(options, checkpoint)
    dataset = source.load(reading_progress(console))
    for line in findings(dataset):
        console.print(f"- {line}", highlight=False)
    if any(take.errors for take in dataset.takes):
        draw_masked(options.out / MASKED_PICTURE, dataset.takes)
    require_windows(dataset, settings.batch, settings.window)
    training = Training(dataset, settings, device)
    training.origin = source.as_state()
    if state is not None:
        training.restore(state)
    options.out.mkdir(parents=True, exist_ok=True)
    console.print(_plan(training, device), highlight=False)
    if not TrainingRun(training, options.out, console).run():
        again = f"bunraku train --resume --out {shlex.quote(str(options.out))}"
        console.print(
            f"Stopped at {100 * training.fraction:.0f} %; nothing is lost. Continue with: {again}",
            highlight=False,
            soft_wrap=True,
        )
        return False
    if settings.model != "puppet":
        if settings.model == "sequence":
            report(load_checkpoint(checkpoint)[0].autoencoder, dataset, options.out, console)
        console.print(f"{checkpoint} is ready. What it is for: {MODELS[settings.model].use}.")
        return True
    if settings.window != WINDOW:
        console.print(
            f"{checkpoint} dances by itself: bunraku granular {shlex.quote(str(checkpoint))} --out "
            f"phrase.bvh. It is no show: the box dances windows of {WINDOW} poses."
        )
        return True
    release(Request(checkpoint, source, options.out, options.name or "", options.phrase), dataset, console)
    console.print(
        f"{options.out} is a show. Dance it: bunraku play --show {shlex.quote(str(options.out))} --emulate"
    )
    return True


def choose_device(wanted: str) -> str:
    """cuda or cpu. Raises StudioError if cuda is wanted and there is no GPU."""
    available = torch.cuda.is_available()
    if wanted == "cuda" and not available:
        raise StudioError("PyTorch finds no CUDA GPU. Omit --device to train on the CPU.")
    return "cuda" if available and wanted != "cpu" else "cpu"


def _settings_and_source(
    options: TrainOptions, checkpoint: Path
) -> tuple[Settings, Sources, dict[str, Any] | None]:
    """Settings, recordings and, with --resume, the checkpoint's state. Raises StudioError."""
    if options.resume:
        if not checkpoint.exists():
            raise StudioError(f"{options.out} has no checkpoint.pt to resume. Omit --resume.")
        state = load_checkpoint(checkpoint)[1]
        settings = Settings.from_state(state["settings"])
        return _paced(settings, options), sources.remembered(state, options.recordings, checkpoint), state
    if checkpoint.exists():
        raise StudioError(
            f"{options.out} already has a training. Continue it with --resume, or give another --out."
        )
    if options.recordings is None:
        raise StudioError("Give the folder of the recordings: --recordings FOLDER.")
    settings = settings_for(
        options.model,
        options.network,
        window=options.window,
        latent=options.latent,
        width=options.width,
        depth=options.depth,
        seed=options.seed,
    )
    source = sources.given(
        options.recordings, options.catalogue, options.held_out, options.true_fps, options.keep
    )
    return _paced(settings, options), source, None


def _paced(settings: Settings, options: TrainOptions) -> Settings:
    """Settings with the minutes or steps of the command line, if given. Raises StudioError for both."""
    if options.minutes is not None and options.steps is not None:
        raise StudioError("Give --minutes or --steps, not both: each sets the learning rate's pace.")
    if options.steps is not None:
        return replace(settings, steps=options.steps)
    if options.minutes is not None:
        return replace(settings, minutes=options.minutes, steps=0)
    return settings


def _plan(training: Training, device: str) -> str:
    settings, shape = training.settings, training.autoencoder.shape
    bound = f"{settings.steps} steps" if settings.steps else f"{settings.minutes:g} minutes"
    done = f", {100 * training.fraction:.0f} % done" if training.step else ""
    where = "the GPU" if device == "cuda" else f"the CPU ({torch.get_num_threads()} threads)"
    count = parameters(training.autoencoder.network)
    return (
        f"{settings.network}, windows of {shape.window} poses, latent {shape.latent}, width {shape.width}: "
        f"{count / 1e6:.2f} million parameters; {bound} on {where}{done}."
    )
