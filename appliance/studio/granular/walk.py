"""`bunraku granular`: a phrase out of a dancer's latents, on its feet, with its figures and a strip."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from appliance.dancer.material import latent_paths
from appliance.dancer.material.motion_network import MotionNetwork
from appliance.levers.sources import GRANULAR
from appliance.pose import quaternion
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.studio.coded_windows import decoded, encoded, latent_of, window_of
from appliance.studio.dance_files import write_dance
from appliance.studio.data.dataset import FPS, Dataset, Take
from appliance.studio.evaluation.coders import Poses, load_checkpoint
from appliance.studio.granular.granular import cycle, fed_back, once
from appliance.studio.improviser.footing import plant_feet
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.opened_model import OpenedModel, open_show
from appliance.studio.progress import doing, shown
from appliance.studio.standing_dance import excerpt_of, on_the_spot, only_in, standing
from appliance.studio.studio_error import StudioError
from appliance.studio.trained_on import trained_on
from appliance.studio.variations.variations import hop_of

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network


@dataclass(frozen=True)
class GranularOptions:
    """The command line of bunraku granular. checkpoint or show; one, other: 'TAKE' or 'TAKE@SECONDS'.

    hop: None: 1, of a show's network a quarter of its window. regions: dance so, the others dance phrase.
    """

    checkpoint: Path | None
    out: Path
    show: Path | None = None
    recordings: Path | None = None
    seconds: float = 30.0
    seed: int = 1
    spread: float = 1.0
    speed: float = 0.5
    hop: int | None = None
    samples: bool = False
    one: str | None = None
    other: str | None = None
    mix: float = 0.5
    offset: float = 0.0
    feedback: float | None = None
    phrase: Path | None = None
    regions: tuple[str, ...] = ()
    reading: ReadingOptions = AS_THE_FILES_SAY


def run(options: GranularOptions) -> None:
    """Walk, decode, stand, measure, write; raises StudioError."""
    console = Console(stderr=True)
    opened = _open(options, console)
    network, dataset = opened.network, opened.dataset
    hop = options.hop or (hop_of(network) if opened.is_of_show else 1)
    if hop > window_of(network):
        most = window_of(network)
        raise StudioError(f"--hop {hop} leaves gaps between windows of {most} poses. Take at most {most}.")
    poses = _poses(replace(options, hop=hop), network, dataset)
    given, phrase = None, options.phrase or opened.phrase
    if options.regions and phrase is not None:
        given = excerpt_of(phrase, 0.0, options.seconds, opened.moved, dataset, options.reading)
        poses = only_in(options.regions, poses, given, dataset)
    progress = partial(shown, description="planting the feet", console=console)
    if given is None and not opened.is_of_show:
        made = plant_feet(on_the_spot(poses, dataset), progress=progress)
    else:
        made = standing(poses, given, dataset, progress, opened.is_of_show)
    with doing("measuring the phrase and the recordings", console):
        yardstick = Yardstick.of(dataset.training, dataset.moving)
        natural = measure(made, yardstick, endless=given is None)
    report = {"options": asdict(options), "naturalness": natural.as_json()}
    with doing("drawing the strip", console):
        write_dance(options.out, made, f"{options.out.stem}: {_title(options)}", report, rows=2)
    Console().print(naturalness_table({options.out.stem: natural}))
    console.print(
        f"{options.out}: {made.seconds:.1f} s, its figures and its strip beside it.", highlight=False
    )


def _open(options: GranularOptions, console: Console) -> OpenedModel:
    if options.show is not None:
        return open_show(GRANULAR, options.show)
    assert options.checkpoint is not None, "the command asks for one of both"
    coder, state = load_checkpoint(options.checkpoint)
    dataset = trained_on(
        options.checkpoint, coder.joints, state, options.recordings, console, options.reading
    )
    return OpenedModel(coder.autoencoder, coder, dataset)


def _poses(options: GranularOptions, network: Network, dataset: Dataset) -> Poses:
    """(T, M, 4) of the moving joints."""
    hop = options.hop or 1
    count, latent = max(2, round(options.seconds * FPS / hop)), latent_of(network)
    if options.feedback is not None:
        assert not isinstance(network, MotionNetwork), "the command refuses it"
        if window_of(network) < 2:
            raise StudioError(
                f"{options.checkpoint} knows single poses. --feedback goes on from a window's last two: give "
                "a puppet's checkpoint, or one of train --model sequence."
            )
        return fed_back(network, _windows(options, network, dataset, options.one, 1), options.feedback)
    if options.one is not None:
        windows = [
            _windows(options, network, dataset, each, hop)
            for each in (options.one, options.other or options.one)
        ]
        shortest = min(map(len, windows))
        (one, facing), (other, _) = (encoded(network, each[:shortest]) for each in windows)
        path = latent_paths.between(
            one, other, options.mix if options.other else 0.0, options.offset, options.seed
        )
        return once(decoded(network, path, facing), hop)
    if options.samples:
        path = latent_paths.sampled(count, latent, options.spread, options.seed)
    else:
        path = latent_paths.walked(
            count, latent, options.spread, options.speed * options.seconds, options.seed
        )
    return cycle(decoded(network, path), hop)


def _windows(
    options: GranularOptions, network: Network, dataset: Dataset, where: str | None, hop: int
) -> Poses:
    """Windows (W, T, M, 4) of a take from a second on, `hop` ticks apart, as long as the phrase is to be."""
    take, first = _found(dataset, where)
    poses = quaternion.continuous(take.recording.poses[first:, dataset.moving]).astype(np.float32)
    length = window_of(network)
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
    known = dict.fromkeys(take.file for take in dataset.takes)
    if name not in known:
        raise StudioError(f"There is no take '{name}'. There are {', '.join(known)}.")
    try:
        at_s = float(second or 0)
    except ValueError:
        raise StudioError(f"'{second}' is no second of {name}: write {name}@12.5.") from None
    parts = [take for take in dataset.takes if take.file == name]
    for take in parts:
        if 0 <= at_s - take.begins_s < take.recording.seconds:
            return take, round((at_s - take.begins_s) * FPS)
    end = max(take.begins_s + take.recording.seconds for take in parts)
    raise StudioError(f"{name} is {end:.1f} s long: {second} s is not in it.")


def _title(options: GranularOptions) -> str:
    if options.regions:
        return f"{' and '.join(options.regions)} only, {_title(replace(options, regions=()))}"
    if options.feedback is not None:
        return f"on its own motion, {options.feedback:.0%} of the phrase mixed in"
    if options.one is not None:
        mixed = f", {options.mix:.0%} of {options.other}" if options.other else ""
        return f"{options.one}{mixed}, offset {options.offset:g}"
    kind = "samples" if options.samples else f"a walk at {options.speed:g} Hz"
    return f"{kind}, spread {options.spread:g}, seed {options.seed}"
