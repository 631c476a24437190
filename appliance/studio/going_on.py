"""`bunraku train --from`: a training that begins with the network of a show, or of a checkpoint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from appliance.show.show import load_show
from appliance.studio.autoencoder.models import AnySettings
from appliance.studio.autoencoder.training import Settings
from appliance.studio.data.dataset import Dataset
from appliance.studio.evaluation.coders import TorchCoder, load_puppet
from appliance.studio.export.exported import read_exported
from appliance.studio.studio_error import StudioError
from appliance.studio.train_options import TrainOptions

LEARNING_RATE = 2e-4  # a fifth of a new network's: at that one it forgets in 200 steps what it knows
_OF_THE_NETWORK = ("network", "window", "latent", "width", "depth")


def open_start(path: Path) -> TorchCoder:
    """The network of a show folder, an .onnx file, a checkpoint.pt or a training's folder.

    Raises StudioError, ConfigError or OSError.
    """
    if path.is_dir() and (path / "checkpoint.pt").exists():
        return load_puppet(path / "checkpoint.pt")[0]
    if path.suffix.casefold() == ".pt":
        return load_puppet(path)[0]
    return read_exported(load_show(path).network if path.is_dir() else path)


def settings_of(start: TorchCoder, settings: AnySettings, options: TrainOptions) -> Settings:
    """Settings with the architecture and sizes of the network that the training begins with.

    Raises StudioError for options that say otherwise.
    """
    if options.resume:
        raise StudioError("--resume continues the training in --out, --from begins a new one. Give one.")
    if not isinstance(settings, Settings) or settings.model != "puppet":
        raise StudioError(f"--from is for puppets, not for --model {options.model}. Omit one of them.")
    for name in _OF_THE_NETWORK:
        if getattr(options, name):
            raise StudioError(f"--{name} comes with the network of --from {options.start}. Omit it.")
    shape = start.autoencoder.shape
    return replace(
        settings,
        network=start.facts["architecture"],
        latent=shape.latent,
        width=shape.width,
        depth=shape.depth,
        learning_rate=options.learning_rate or LEARNING_RATE,
        alive_from=0.0,
    )


def require_same_joints(start: TorchCoder, dataset: Dataset, path: Path) -> None:
    """Raises StudioError where the recordings move other joints than the network."""
    if start.joints != dataset.moving_names:
        raise StudioError(
            f"{path} moves {', '.join(start.joints)}; the recordings move {', '.join(dataset.moving_names)}. "
            "Give recordings in which the same joints move, or train a new network without --from."
        )
