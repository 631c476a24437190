"""Steps of the takes that an improviser learns from, and an autoencoder that codes them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from appliance.dancer.material.latent_paths import Latents
from appliance.dancer.material.steps import HOP, Steps, steps_of
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.coded_windows import decoded, encoded
from appliance.studio.data.dataset import FPS, Take
from appliance.studio.data.mirror import asymmetry, mirrored
from appliance.studio.evaluation.coders import Poses


@dataclass(frozen=True)
class WindowCoder:
    """An autoencoder as steps are coded with."""

    autoencoder: Autoencoder

    @property
    def latent(self) -> int:
        return self.autoencoder.shape.latent

    def encode(self, windows: Poses) -> tuple[Latents, Array]:
        return encoded(self.autoencoder, windows)

    def decode(self, latents: Latents) -> Poses:
        return decoded(self.autoencoder, latents, is_raw=True)


def steps_of_takes(
    autoencoder: Autoencoder, takes: Sequence[Take], moving: Sequence[int], shortest: int
) -> list[Steps]:
    """Every sound stretch of the takes and its mirror image, starting at each of its first 4 frames.

    A body that is not its own mirror image is not mirrored. shortest: stretches of fewer steps are omitted.
    """
    coder = WindowCoder(autoencoder)
    found = (
        steps_of(coder, recording.without_first(first), moving)
        for recording in sound_stretches(takes, moving)
        for first in range(HOP)
    )
    return [steps for steps in found if len(steps) >= shortest]


def sound_stretches(takes: Sequence[Take], moving: Sequence[int]) -> Iterator[Recording]:
    """Each stretch of the takes without a capture error, and its mirror image if the body has two sides."""
    two_sided = bool(takes) and not asymmetry(takes[0].recording.skeleton, moving)
    for take in takes:
        for start, end in take.sound_runs:
            excerpt = take.recording.excerpt(start / FPS, end / FPS)
            yield from (excerpt, mirrored(excerpt)) if two_sided else (excerpt,)
