"""`bunraku train --from`: a training that begins with the network of a show, or of a checkpoint."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from appliance.pose.foreign_file import content, plain_json
from appliance.show.check import LARGEST_REPORT
from appliance.show.show import load_show
from appliance.studio.autoencoder.models import AnySettings
from appliance.studio.autoencoder.training import Settings
from appliance.studio.data.dataset import Dataset
from appliance.studio.evaluation.coders import TorchCoder, load_puppet, load_state
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


def takes_known_to(path: Path) -> frozenset[str] | None:
    """Takes that this network learned from, by its checkpoint or its show's report; None: not known."""
    checkpoint = path / "checkpoint.pt" if path.is_dir() else path
    if checkpoint.suffix.casefold() == ".pt" and checkpoint.exists():
        known = (load_state(checkpoint).get("origin") or {}).get("catalogue", {}).get("learned")
    else:
        known = _learned_by_report((path if path.is_dir() else path.parent) / "report.json")
    return frozenset(known) if known else None


def _learned_by_report(file: Path) -> list[str] | None:
    """Reports of before have only the recordings that were learned from last."""
    try:
        training = plain_json(content(file, LARGEST_REPORT))["training"]
        known = training.get("learned") or training["takes"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return [str(name) for name in known] if isinstance(known, list) else None


def doubt(path: Path, known: Collection[str] | None, dataset: Dataset) -> str:
    """Why figures on takes kept apart may flatter a network that goes on from this one; '': they do not."""
    name = path.resolve().name
    if known is None:
        return (
            f"It is not known which takes {name} learned from. If it knows those that are kept apart, the "
            "figures flatter the dancer."
        )
    learned = {take.take for take in dataset.held_out} & set(known) - {take.take for take in dataset.training}
    if not learned:
        return ""
    return (
        f"{name} learned from {', '.join(sorted(learned))}: the figures flatter the dancer. Add a recording "
        "that it never saw, and name it with --held-out."
    )


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
