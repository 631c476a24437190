"""Trains an improviser, ours or the published one, until done or stopped, and shows its progress."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from pathlib import Path

import torch
from rich.console import Console

from appliance.dancer.material.improvising import BEFORE, MOVE
from appliance.dancer.material.steps import ROOT, Steps
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.autoencoder.training_run import run_shown
from appliance.studio.data.dataset import Dataset
from appliance.studio.evaluation.coders import load_puppet
from appliance.studio.evaluation.pictures import draw_learning
from appliance.studio.improviser.improviser_training import (
    ImproviserReport,
    ImproviserSettings,
    ImproviserTraining,
)
from appliance.studio.improviser.pose_mixtures_training import PoseMixturesSettings, PoseMixturesTraining
from appliance.studio.improviser.steps import steps_of_takes
from appliance.studio.processes import Processes
from appliance.studio.studio_error import StudioError
from appliance.studio.training_loop import ALONE

AnySettings = ImproviserSettings | PoseMixturesSettings
AnyTraining = ImproviserTraining | PoseMixturesTraining


def training_for(
    settings: AnySettings, dataset: Dataset, puppet: Path | None, device: str, processes: Processes
) -> AnyTraining:
    """Options of `train --model improviser`; ours continues in the latents of a puppet's checkpoint.

    Raises StudioError where that is missing, or moves other joints.
    """
    if isinstance(settings, PoseMixturesSettings):
        return PoseMixturesTraining(dataset, settings, device, processes)
    if puppet is None:
        raise StudioError(
            "The improviser goes on in the latents of a trained dancer. Give its checkpoint: --puppet "
            "my_dancer/checkpoint.pt. The published one needs none: --network lstm-mixtures."
        )
    coder = load_puppet(puppet)[0]
    if coder.joints != dataset.moving_names:
        raise StudioError(f"{puppet} moves other joints than these recordings. Give those it was trained on.")
    steps = steps_of_dataset(coder.autoencoder, dataset)
    training = moves_training(coder.autoencoder, dataset, steps, settings, processes)
    training.origin["puppet"] = str(puppet.resolve())
    return training


def steps_of_dataset(autoencoder: Autoencoder, dataset: Dataset) -> list[Steps]:
    """Stretches of the training takes that are long enough for a move."""
    return steps_of_takes(autoencoder, dataset.training, dataset.moving, BEFORE + MOVE)


def moves_training(
    autoencoder: Autoencoder,
    dataset: Dataset,
    steps: list[Steps],
    settings: ImproviserSettings,
    processes: Processes = ALONE,
) -> ImproviserTraining:
    """The training of our improviser, on the training takes. Raises StudioError where all are too short."""
    rows = BEFORE + MOVE * settings.moves
    if not any(len(stretch) >= rows for stretch in steps):
        raise StudioError(
            f"No recording has {rows / 12.5:.0f} s without a capture error: too little to improvise from."
        )
    held_out = steps_of_takes(autoencoder, dataset.held_out, dataset.moving, BEFORE + MOVE)
    training = ImproviserTraining(
        [torch.tensor(stretch.features) for stretch in steps],
        [torch.tensor(stretch.features) for stretch in held_out],
        ROOT,
        settings,
        processes,
    )
    training.origin = {"autoencoder": fingerprint(autoencoder)}
    return training


def fingerprint(autoencoder: Autoencoder) -> str:
    """A hash of an autoencoder's weights."""
    digest = hashlib.sha256()
    for value in autoencoder.state_dict().values():
        digest.update(value.numpy().tobytes())
    return digest.hexdigest()[:16]


def train_until_done(training: AnyTraining, file: Path, picture: Path, console: Console) -> bool:
    """Train until done or stopped (Ctrl-C, SIGTERM); the improviser's file is written either way, and with it
    a picture of its losses.
    """
    if training.fraction >= 1.0:
        return True
    file.parent.mkdir(parents=True, exist_ok=True)

    def save() -> None:
        training.save_checkpoint(file)
        if training.history:
            draw_learning(picture, [asdict(line) for line in training.history])

    return run_shown(training, "learning to improvise", console, _history_line, save)


def _history_line(line: ImproviserReport) -> str:
    parts = ", ".join(f"{name} {value:.3g}" for name, value in line.parts.items())
    held = ", ".join(f"{name} {value:.3g}" for name, value in line.held_out.items())
    return parts + (f"; held-out takes: {held}" if held else "")
