"""`bunraku vary`: variations of a phrase as BVH, with their figures, and the phrase above them in a strip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from appliance.levers.sources import VARY
from appliance.pictures.filmstrip import Strip, draw_strips
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.recording import Recording
from appliance.studio.dance_files import write_recording, write_report
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.dance_figures import energy, jerk
from appliance.studio.evaluation.nearest import Reference, reference_of
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.opened_model import OpenedModel, open_either
from appliance.studio.pose_space.ground import Ground
from appliance.studio.progress import doing, shown
from appliance.studio.standing_dance import excerpt_of, only_in, standing
from appliance.studio.trained_on import open_model
from appliance.studio.variations import variations
from appliance.studio.variations.timing import difference, retimed

COLUMNS = 8  # in a strip
SAME = 1e-5  # difference of quaternions
TIMING_S = 0.2  # how much earlier or later gestures come, from half a standard deviation on


@dataclass(frozen=True)
class VaryOptions:
    """The command line of bunraku vary. model or show; phrase: a BVH file; None: the show's own.

    is_free: only samples from the prior.
    """

    model: Path | None
    out: Path
    show: Path | None = None
    phrase: Path | None = None
    is_free: bool = False
    recordings: Path | None = None
    sigma: float = 0.5
    count: int = 8
    seed: int = 1
    start: float = 0.0
    seconds: float = 10.0
    mix: Path | None = None
    share: float = 0.5
    regions: tuple[str, ...] = ()
    on_map: Path | None = None
    keeps_timing: bool = False
    reading: ReadingOptions = AS_THE_FILES_SAY


@dataclass(frozen=True)
class Figures:
    """For a variation: degrees from the phrase, after time warping, the share of timing, from the nearest
    recorded pose; energy and jerk of the phrase's. For a sample only the figures that need no phrase.
    """

    nearest: float
    degrees: float | None = None
    warped: float | None = None
    timing: float | None = None
    energy: float | None = None
    jerk: float | None = None


@dataclass(frozen=True)
class _Danced:
    """poses (T, M, 4) of the moving joints; path: the recording that gives the path and the floor."""

    poses: Poses
    path: Recording | None


def run(options: VaryOptions) -> None:
    """Vary, stand, measure, write; raises StudioError."""
    console = Console(stderr=True)
    opened = open_either(VARY, options.model, options.show, options.recordings, console, options.reading)
    dataset, phrase = opened.dataset, None if options.is_free else options.phrase or opened.phrase
    with doing("measuring the recordings", console):
        reference = reference_of(dataset.training, dataset.moving_names)
        yardstick = Yardstick.of(dataset.training, dataset.moving)
    given = (
        None
        if phrase is None
        else excerpt_of(phrase, options.start, options.seconds, opened.moved, dataset, options.reading)
    )
    danced = _dances(options, opened, given)
    options.out.mkdir(parents=True, exist_ok=True)
    figures, strips, natural = {}, [], {}
    if given is not None:
        write_recording(options.out / "phrase.bvh", given)
        moving = given.poses[:, list(dataset.moving)]
        figures["phrase"] = measured(moving, None, reference)
        strips.append(Strip(given.poses, given.roots, "phrase"))
        if options.mix is None:
            own = variations.encode_phrase(opened.network, moving.astype(np.float32))
            figures["0_sigma"] = measured(variations.varied(opened.network, own, 0.0, 0), moving, reference)
    for number, (name, one) in enumerate(danced.items(), 1):
        poses = one.poses
        description = f"{number} of {len(danced)}: planting the feet of {name}"
        whole = _untouched(poses, one.path, dataset.moving) or standing(
            poses,
            one.path,
            dataset,
            partial(shown, description=description, console=console),
            opened.is_of_show,
        )
        write_recording(options.out / f"{name}.bvh", whole)
        figures[name] = measured(
            poses, None if given is None else given.poses[:, list(dataset.moving)], reference
        )
        natural[name] = measure(whole, yardstick, endless=False)
        strips.append(Strip(whole.poses, whole.roots, name, behind=strips[0] if given is not None else None))
    if options.on_map is not None:
        _draw_on_map(options, given, danced, console)
    title = _title(options, phrase)
    with doing("drawing variations.png", console):
        picture = options.out / "variations.png"
        draw_strips(picture, dataset.skeleton, strips, FPS, title, COLUMNS, options.start)
    report = {
        "options": asdict(options),
        "figures": {name: asdict(one) for name, one in figures.items()},
        "naturalness": {name: one.as_json() for name, one in natural.items()},
    }
    write_report(options.out / "variations.json", report)
    Console().print(_table(figures, title))
    Console().print(naturalness_table(natural))
    console.print(f"{options.out}: BVH of each, variations.png and variations.json.", highlight=False)


def _untouched(poses: Poses, path: Recording | None, moving: Sequence[int]) -> Recording | None:
    """The recording itself where the poses are its own: it stands already."""
    if path is None:
        return None
    own = path.poses[: len(poses), list(moving)]
    same = np.abs(quaternion.aligned(poses, own) - own).max() < SAME
    return path.excerpt(0.0, len(poses) / FPS) if same else None


def measured(poses: Array, phrase: Array | None, reference: Reference) -> Figures:
    """Figures of poses (T, M, 4) beside a phrase's."""
    nearest = float(reference.nearest(poses).mean())
    if phrase is None:
        return Figures(nearest)
    off = difference(phrase, poses)
    pace = energy(phrase[: len(poses)])
    return Figures(
        nearest,
        off.degrees,
        off.warped,
        off.timing,
        energy(poses) / pace if pace > 1e-9 else None,
        jerk(poses) / max(jerk(phrase[: len(poses)]), 1e-9),
    )


def _draw_on_map(
    options: VaryOptions, given: Recording | None, danced: dict[str, _Danced], console: Console
) -> None:
    """The link of both models: the phrase and its variations as a bundle of paths over the map of poses."""
    assert options.on_map is not None
    coder, dataset = open_model("pose", options.on_map, options.recordings, console, options.reading)
    ground, paths = Ground.of(coder.autoencoder, dataset), {}
    if given is not None:
        paths["phrase"] = ground.path(given.poses[:, list(dataset.moving)])
    paths |= {name: ground.path(one.poses) for name, one in danced.items()}
    ground.draw(options.out / "map.png", paths)


def _dances(options: VaryOptions, opened: OpenedModel, given: Recording | None) -> dict[str, _Danced]:
    """The dances by name."""
    network, dataset = opened.network, opened.dataset
    seeds = range(options.seed, options.seed + options.count)
    if given is None:
        return {
            f"sample_{seed}": _Danced(variations.sampled(network, options.sigma, seed), None)
            for seed in seeds
        }
    moving = list(dataset.moving)

    def encoded(recording: Recording) -> variations.EncodedPhrase:
        return variations.encode_phrase(network, recording.poses[:, moving].astype(np.float32))

    if options.mix is not None:
        other = excerpt_of(
            options.mix, options.start, options.seconds, opened.moved, dataset, options.reading
        )
        mixture = variations.mixed(network, encoded(given), encoded(other), options.share, 1)
        made = {"mixed": _Danced(mixture, given)}
    else:
        seconds = 0.0 if options.keeps_timing or options.regions else TIMING_S * min(1.0, 2 * options.sigma)
        timed = {seed: retimed(given, seconds, seed) if seconds else given for seed in seeds}
        made = {
            f"variation_{seed}": _Danced(variations.varied(network, encoded(path), options.sigma, seed), path)
            for seed, path in timed.items()
        }
    if not options.regions:
        return made
    return {
        name: replace(one, poses=only_in(options.regions, one.poses, given, dataset))
        for name, one in made.items()
    }


def _title(options: VaryOptions, phrase: Path | None) -> str:
    where = f", {' and '.join(options.regions)} only" if options.regions else ""
    if phrase is None:
        return f"samples from the prior, spread {options.sigma:g}"
    if options.mix is not None:
        return f"{phrase.stem} with {options.share:.0%} of {options.mix.stem}{where}"
    return f"{phrase.stem}, varied by {options.sigma:g} sigma{where}"


def _table(figures: dict[str, Figures], title: str) -> Table:
    table = Table(title=title, box=SIMPLE_HEAD)
    table.add_column(no_wrap=True)
    for name in ("from the phrase", "of that timing", "from recorded", "energy", "jerk"):
        table.add_column(name, justify="right")
    for name, one in figures.items():
        table.add_row(
            name.replace("_", " "),
            "" if one.degrees is None else f"{one.degrees:.1f}°",
            "" if one.timing is None else f"{one.timing:.0%}",
            f"{one.nearest:.1f}°",
            "" if one.energy is None else f"{one.energy:.2f}",
            "" if one.jerk is None else f"{one.jerk:.2f}",
        )
    return table
