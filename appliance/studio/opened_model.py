"""A network that the studio's commands dance with: of a training, or of a show as the box runs it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from appliance.dancer.material.liveness import SAMPLES, liveness_of
from appliance.dancer.material.maker import open_network
from appliance.dancer.material.motion_network import MotionNetwork, MotionNetworkError
from appliance.levers.sources import GRANULAR, IMPROVISE, PATH, VARY
from appliance.pose import quaternion
from appliance.pose.reading_options import ReadingOptions
from appliance.show.show import load_show
from appliance.studio.coded_windows import decoded, encoded, latent_of, window_of
from appliance.studio.data.catalogue import ALWAYS, Catalogue
from appliance.studio.data.dataset import Dataset, window_starts
from appliance.studio.data.remembered import remembered_reading
from appliance.studio.data.takes import load_take
from appliance.studio.evaluation.coders import MovedJoints
from appliance.studio.progress import doing
from appliance.studio.studio_error import StudioError
from appliance.studio.trained_on import open_model

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network

MODELS = {VARY: "sequence", GRANULAR: "sequence", PATH: "pose", IMPROVISE: "improviser"}
TWO_HALVES_S = 8.0  # a longer phrase counts as two takes, so that each has another one to be compared with


@dataclass(frozen=True)
class OpenedModel:
    """network: encodes and decodes; moved: its joints; dataset: what it is measured against; phrase: a show's
    own, which is danced if no other is given; is_dead: whether say_if_dead said so.
    """

    network: Network
    moved: MovedJoints
    dataset: Dataset
    phrase: Path | None = None
    is_dead: bool = False

    @property
    def is_of_show(self) -> bool:
        """Whether onnxruntime computes it, without torch."""
        return isinstance(self.network, MotionNetwork)


def open_either(
    source: str,
    checkpoint: Path | None,
    show: Path | None,
    recordings: Path | None,
    console: Console,
    reading: ReadingOptions,
) -> OpenedModel:
    """The checkpoint of a model, or a show's network of a source. Raises StudioError, ConfigError."""
    if show is not None:
        with doing("opening the show and its network", console):
            opened = open_show(source, show)
        return replace(opened, is_dead=say_if_dead(opened.network, opened.dataset, console))
    assert checkpoint is not None, "the command asks for one of both"
    coder, dataset = open_model(MODELS[source], checkpoint, recordings, console, reading)
    is_dead = say_if_dead(coder.autoencoder, dataset, console)
    return OpenedModel(coder.autoencoder, coder, dataset, is_dead=is_dead)


def say_if_dead(network: Network, dataset: Dataset, console: Console) -> bool:
    """Says what is wrong with a network that would make the same motion whatever it is asked, or knows
    another dance. True if something is.
    """
    length, moving = window_of(network), list(dataset.moving)
    starts = [(take, first) for take in dataset.training for first in window_starts(take, window=length)]
    if not starts:
        return False
    chosen = np.linspace(0, len(starts) - 1, min(SAMPLES, len(starts))).round().astype(int)
    places = [starts[place] for place in chosen]
    windows = np.stack(
        [
            quaternion.continuous(take.recording.poses[first : first + length, moving])
            for take, first in places
        ]
    )
    dead = liveness_of(
        windows,
        latent_of(network),
        lambda given: encoded(network, given)[0],
        lambda latents: decoded(network, latents),
    ).sentence()
    if dead:
        console.print(dead, highlight=False, soft_wrap=True)
    return bool(dead)


def open_show(source: str, folder: Path) -> OpenedModel:
    """A show's network, with the show's phrase in place of recordings, which no show brings along."""
    show, model = load_show(folder), MODELS[source]
    file = show.motion_networks.get(source, show.directory / f"{model}.onnx")
    if not file.is_file():
        raise StudioError(
            f"{folder} has no {file.name}. Train one with bunraku train --model {model} and copy it there, "
            "or take the show that comes with the box: --show default."
        )
    try:
        network = open_network(source, file, show.skeleton.names)
    except MotionNetworkError as error:
        raise StudioError(f"{file}: {error} Export it again, or copy the whole show again.") from None
    reading = remembered_reading(folder).options
    take = load_take(show.phrase, Catalogue(keep={"*": (ALWAYS,)}))
    half = len(take.recording) // 2
    takes = [take]
    if take.recording.seconds > TWO_HALVES_S:
        takes = [take.part(0, half), take.part(half, len(take.recording))]
    named = tuple(replace(one, take=str(number)) for number, one in enumerate(takes))
    catalogue = Catalogue().with_options(reading)
    dataset = Dataset(show.skeleton, tuple(network.places), named, (), catalogue)
    return OpenedModel(network, network, dataset, show.phrase)
