"""`bunraku granular`: a phrase out of a dancer's latents, on its feet, with its figures and a strip."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from appliance.dancer.material import latent_paths
from appliance.pose import quaternion
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.coded_windows import decoded, encoded
from appliance.studio.dance_files import write_dance
from appliance.studio.data.dataset import FPS, Dataset, Take
from appliance.studio.evaluation.coders import Poses, load_checkpoint
from appliance.studio.granular.granular import cycle, fed_back, once
from appliance.studio.improviser.footing import plant_feet
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.progress import doing, shown
from appliance.studio.standing_dance import on_the_spot
from appliance.studio.studio_error import StudioError
from appliance.studio.trained_on import trained_on


@dataclass(frozen=True)
class GranularOptions:
    """The command line of bunraku granular. one, other: 'TAKE' or 'TAKE@SECONDS'."""

    checkpoint: Path
    out: Path
    recordings: Path | None = None
    seconds: float = 30.0
    seed: int = 1
    spread: float = 1.0
    speed: float = 0.5
    hop: int = 1
    samples: bool = False
    one: str | None = None
    other: str | None = None
    mix: float = 0.5
    offset: float = 0.0
    feedback: float | None = None
    reading: ReadingOptions = AS_THE_FILES_SAY


def run(options: GranularOptions) -> None:
    """Walk, decode, stand, measure, write; raises StudioError."""
    console = Console(stderr=True)
    coder, state = load_checkpoint(options.checkpoint)
    autoencoder = coder.autoencoder
    dataset = trained_on(
        options.checkpoint, coder.joints, state, options.recordings, console, options.reading
    )
    if options.hop > autoencoder.shape.window:
        most = autoencoder.shape.window
        raise StudioError(
            f"--hop {options.hop} leaves gaps between windows of {most} poses. Take at most {most}."
        )
    poses = _poses(options, autoencoder, dataset)
    progress = partial(shown, words="planting the feet", console=console)
    phrase = plant_feet(on_the_spot(poses, dataset), progress=progress)
    with doing("measuring the phrase and the recordings", console):
        natural = measure(phrase, Yardstick.of(dataset.training, dataset.moving))
    report = {"options": asdict(options), "naturalness": natural.as_json()}
    write_dance(options.out, phrase, f"{options.out.stem}: {_words(options)}", report, rows=2)
    Console().print(naturalness_table({options.out.stem: natural}))
    console.print(
        f"{options.out}: {phrase.seconds:.1f} s, its figures and its strip beside it.", highlight=False
    )


def _poses(options: GranularOptions, autoencoder: Autoencoder, dataset: Dataset) -> Poses:
    """(T, M, 4) of the moving joints."""
    count, latent = max(2, round(options.seconds * FPS / options.hop)), autoencoder.shape.latent
    if options.feedback is not None:
        return fed_back(
            autoencoder, _windows(options, autoencoder, dataset, options.one, 1), options.feedback
        )
    if options.one is not None:
        windows = [
            _windows(options, autoencoder, dataset, each, options.hop)
            for each in (options.one, options.other or options.one)
        ]
        shortest = min(map(len, windows))
        (one, facing), (other, _) = (encoded(autoencoder, each[:shortest]) for each in windows)
        path = latent_paths.between(
            one, other, options.mix if options.other else 0.0, options.offset, options.seed
        )
        return once(decoded(autoencoder, path, facing), options.hop)
    if options.samples:
        path = latent_paths.sampled(count, latent, options.spread, options.seed)
    else:
        path = latent_paths.walked(
            count, latent, options.spread, options.speed * options.seconds, options.seed
        )
    return cycle(decoded(autoencoder, path), options.hop)


def _windows(
    options: GranularOptions, autoencoder: Autoencoder, dataset: Dataset, where: str | None, hop: int
) -> Poses:
    """Windows (W, T, M, 4) of a take from a second on, `hop` ticks apart, as long as the phrase is to be."""
    take, first = _found(dataset, where)
    poses = quaternion.continuous(take.recording.poses[first:, dataset.moving]).astype(np.float32)
    length = autoencoder.shape.window
    starts = np.arange(0, min(len(poses) - length + 1, round(options.seconds * FPS)), hop)
    if len(starts) < 2:
        raise StudioError(
            f"{take.name} has no window of {length} poses from {first / FPS:.1f} s on. Begin earlier."
        )
    windows: Poses = poses[starts[:, None] + np.arange(length)]
    return windows


def _found(dataset: Dataset, where: str | None) -> tuple[Take, int]:
    """The take and its frame; without words the longest take from its beginning."""
    if where is None:
        return max(dataset.training, key=lambda take: len(take.recording)), 0
    name, _, second = where.partition("@")
    takes = {take.name: take for take in dataset.takes}
    if name not in takes:
        raise StudioError(f"There is no take '{name}'. There are {', '.join(takes)}.")
    try:
        first = round(float(second or 0) * FPS)
    except ValueError:
        raise StudioError(f"'{second}' is no second of {name}: write {name}@12.5.") from None
    if not 0 <= first < len(takes[name].recording):
        raise StudioError(f"{name} is {takes[name].recording.seconds:.1f} s long: {second} s is not in it.")
    return takes[name], first


def _words(options: GranularOptions) -> str:
    if options.feedback is not None:
        return f"on its own motion, {options.feedback:.0%} of the phrase mixed in"
    if options.one is not None:
        mixed = f", {options.mix:.0%} of {options.other}" if options.other else ""
        return f"{options.one}{mixed}, offset {options.offset:g}"
    kind = "samples" if options.samples else f"a walk at {options.speed:g} Hz"
    return f"{kind}, spread {options.spread:g}, seed {options.seed}"
