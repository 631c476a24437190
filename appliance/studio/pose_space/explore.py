"""`bunraku explore`: regions of a dancer's space that nobody was in, and a dance that goes there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from appliance.dancer.material.latent_paths import Latents, sampled, walked
from appliance.levers.sources import PATH
from appliance.pictures.filmstrip import draw_rows
from appliance.pictures.filmstrip_stage import SLATE, Row
from appliance.pose.ease import ease
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.recording import Recording
from appliance.studio.coded_windows import latent_of
from appliance.studio.dance_files import write_recording, write_report
from appliance.studio.data.dataset import FPS
from appliance.studio.data.takes import Take
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.critic import critic
from appliance.studio.evaluation.dance_figures import jerk
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.opened_model import open_either
from appliance.studio.pose_space.ground import Ground
from appliance.studio.pose_space.latent_poses import latents_of, poses_of
from appliance.studio.pose_space.unseen import Known, Region, poses_shown
from appliance.studio.progress import doing, shown
from appliance.studio.standing_dance import excerpt_of, standing
from appliance.studio.studio_error import StudioError

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network

COLUMNS = 8  # in the strip
LASTING_S = 2.0  # slower movement of the phrase gives way to the region
MOVEMENT = 0.5  # share of the quicker movement; at 0.8 the legs leave their known poses twice as often
LEAST_S = 4.0  # seconds for each region
CRITIC_TAKE = "phrase"


@dataclass(frozen=True)
class ExploreOptions:
    """The command line of bunraku explore. seen: recordings of performances that count as visited, too."""

    model: Path | None
    out: Path
    seen: tuple[Path, ...] = ()
    show: Path | None = None
    phrase: Path | None = None
    recordings: Path | None = None
    count: int = 5
    seconds: float = 30.0
    start: float = 0.0
    seed: int = 1
    reading: ReadingOptions = AS_THE_FILES_SAY


@dataclass(frozen=True)
class Figures:
    """Shares of the poses that are unseen, plausible, and both; critic: mean area under the curves of one
    critic for each limb, which sees only that limb; jerk of the phrase's.
    """

    unseen: float
    plausible: float
    both: float
    critic: float
    jerk: float


def run(options: ExploreOptions) -> None:
    """Look for regions, dance there, measure, draw, write; raises StudioError."""
    console = Console(stderr=True)
    opened = open_either(PATH, options.model, options.show, options.recordings, console, options.reading)
    network, dataset, moving = opened.network, opened.dataset, list(opened.dataset.moving)
    phrase = options.phrase or opened.phrase
    if phrase is None:
        raise StudioError("Give the --phrase whose movement is danced in the new regions.")
    given = excerpt_of(phrase, options.start, options.seconds, opened.moved, dataset, options.reading)
    seen = [
        _seen(file, excerpt_of(file, 0.0, 1e6, opened.moved, dataset, options.reading))
        for file in options.seen
    ]
    with doing("looking for regions that nobody was in", console):
        known = Known.of(network, dataset, seen)
        regions, share = known.regions(options.count, options.seed)
    if not regions:
        raise StudioError(
            "Nothing plausible is unexplored: what the network makes of mixed poses has been danced, or no "
            "limb ever was so. Train a network with more numbers (--latent), or give another --seed."
        )
    regions = _toured(regions[: max(1, int(given.seconds / LEAST_S))])
    latents, facing = latents_of(network, given.poses[:, moving])
    path = exploring(latents, np.stack([one.latent for one in regions]))
    poses = poses_of(network, path, facing)
    progress = partial(shown, description="planting the feet", console=console)
    whole = standing(poses, given, dataset, progress, opened.is_of_show)
    write_recording(options.out, whole)
    own = given.poses[:, moving].astype(np.float32)
    rows: dict[str, Figures] = {}
    for name, dance in shown(
        [(options.out.stem, poses), *_nulls(network, own, options.seed)],
        "measuring, beside null products",
        console,
    ):
        rows[name] = figures(known, dance, own)
    natural = measure(whole, Yardstick.of(dataset.training, dataset.moving), endless=False)
    with doing("drawing the regions, the strip and the map", console):
        _draw(options, known, regions, given, whole)
        ground = Ground.of(network, dataset)
        marks = ground.pose_map.points(np.stack([one.latent for one in regions]))
        paths = {phrase.stem: ground.path(own), options.out.stem: ground.path(poses)}
        ground.draw(options.out.with_suffix(".map.png"), paths, marks)
    report = {
        "options": asdict(options),
        "unexplored_share": share,
        "regions": [{**asdict(one), "latent": one.latent.tolist()} for one in regions],
        "figures": {name: asdict(one) for name, one in rows.items()},
        "naturalness": natural.as_json(),
    }
    write_report(options.out.with_suffix(".json"), report)
    Console().print(_regions_table(regions))
    Console().print(_figures_table(rows))
    Console().print(naturalness_table({options.out.stem: natural}))
    seconds = sum(take.sound.sum() for take in known.takes) / FPS
    best = rows[options.out.stem]
    console.print(
        f"{options.out}: {len(regions)} regions that none of {seconds:.0f} s of dance was in; "
        f"{best.both:.0%} of the dance is unseen and plausible ({rows['the phrase itself'].both:.0%} of the "
        f"phrase, {rows['random latents'].both:.0%} of random latents, {rows['noise'].both:.0%} of noise). "
        f"Beside it {options.out.with_suffix('.png').name}, {options.out.with_suffix('.map.png').name}.",
        highlight=False,
        soft_wrap=True,
    )


def exploring(latents: Latents, regions: Latents) -> Latents:
    """A phrase's path (T, Z) that begins and ends as it is and goes through regions (R, Z) between.

    Movement slower than LASTING_S gives way to the region; the quicker part is danced there.
    """
    count, width = len(latents), round(LASTING_S * FPS)
    weights = np.hanning(2 * width + 3)[1:-1]
    padded = np.pad(latents.astype(float), ((width, width), (0, 0)), mode="edge")
    slow = np.stack([np.convolve(column, weights / weights.sum(), "valid") for column in padded.T], axis=1)
    stops = len(regions) + 2  # the phrase, the regions, the phrase
    at = np.linspace(0, stops - 1, count)
    before = np.minimum(at.astype(int), stops - 2)
    share = ease(np.clip((at - before - 0.25) / 0.5, 0, 1))
    parts = np.zeros((count, stops))
    parts[np.arange(count), before], parts[np.arange(count), before + 1] = 1 - share, share
    of_phrase = parts[:, [0, -1]].sum(axis=1)[:, None]
    quick = (MOVEMENT + (1 - MOVEMENT) * of_phrase) * (latents - slow)
    path: Latents = (of_phrase * slow + parts[:, 1:-1] @ regions + quick).astype(np.float32)
    return path


def figures(known: Known, poses: Poses, phrase: Poses) -> Figures:
    """Figures of poses (T, M, 4), beside a phrase's."""
    shapes = known.shapes_of(poses)
    unseen, plausible = known.unseen(shapes), known.plausible(shapes)
    pair = [without_heading(phrase)], [without_heading(poses)]
    areas = [critic(*pair, places, [CRITIC_TAKE]) for places in known.limbs.values()]
    return Figures(
        float(unseen.mean()),
        float(plausible.mean()),
        float((unseen & plausible).mean()),
        float(np.mean(areas)),
        jerk(poses) / max(jerk(phrase), 1e-9),
    )


def _nulls(network: Network, phrase: Poses, seed: int) -> list[tuple[str, Poses]]:
    """The phrase itself; a smooth walk through random latents; another random latent at every tick."""
    count, latent = len(phrase), latent_of(network)
    walk = walked(count, latent, 1.0, count / FPS, seed)
    return [
        ("the phrase itself", phrase),
        ("random latents", poses_of(network, walk)),
        ("noise", poses_of(network, sampled(count, latent, 1.0, seed))),
    ]


def _seen(file: Path, recording: Recording) -> Take:
    sound = np.ones(len(recording), bool)
    return Take(file.stem, file.stem, recording, sound, recording.fps, recording.fps)


def _toured(regions: Sequence[Region]) -> list[Region]:
    """The largest first, then always the nearest one that is left."""
    left, tour = list(regions[1:]), [regions[0]]
    while left:
        last = tour[-1].latent
        tour.append(min(left, key=lambda one: float(np.linalg.norm(one.latent - last))))
        left.remove(tour[-1])
    return tour


def _draw(
    options: ExploreOptions, known: Known, regions: Sequence[Region], given: Recording, whole: Recording
) -> None:
    """The regions with the nearest known pose behind each, and the dance with the phrase behind it."""
    pairs = [poses_shown(known, one) for one in regions]
    made, near = (
        (np.concatenate([one.poses for one in side]), np.concatenate([one.roots for one in side]))
        for side in zip(*pairs, strict=True)
    )
    chosen = np.arange(len(regions))
    stamps = tuple(
        f"{number}: {one.joint} {one.joint_cm:.0f} cm\nfrom {one.take} {one.at_s:.1f} s"
        for number, one in enumerate(regions, 1)
    )
    ghosts = Row(*near, chosen, colour=SLATE)
    instants = np.linspace(0, len(whole) - 1, max(COLUMNS, len(regions))).round().astype(int)
    rows = [
        Row(
            *made,
            chosen,
            "Regions that nobody was in, the nearest known pose behind",
            behind=ghosts,
            stamps=stamps,
        ),
        Row(
            whole.poses,
            whole.roots,
            instants,
            "The dance through them, the phrase behind",
            behind=Row(given.poses, given.roots, instants, colour=SLATE),
        ),
    ]
    picture = options.out.with_suffix(".png")
    draw_rows(picture, whole.skeleton, rows, FPS, options.out.stem, "", options.start)


def _regions_table(regions: Sequence[Region]) -> Table:
    table = Table(title="Unexplored regions", box=SIMPLE_HEAD)
    for name in ("", "of the candidates", "away", "nearest known", "differs most"):
        table.add_column(name, justify="left" if name.startswith(("near", "diff")) else "right")
    for number, one in enumerate(regions, 1):
        table.add_row(
            str(number),
            f"{one.share:.1%}",
            f"{one.away_cm:.0f} cm",
            f"{one.take} {one.at_s:.1f} s",
            f"{one.joint}, {one.joint_cm:.0f} cm",
        )
    return table


def _figures_table(rows: dict[str, Figures]) -> Table:
    table = Table(title="The dance beside null products", box=SIMPLE_HEAD)
    table.add_column(no_wrap=True)
    for name in ("unseen", "plausible", "both", "critic", "jerk"):
        table.add_column(name, justify="right")
    for name, one in rows.items():
        shares = (f"{each:.0%}" for each in (one.unseen, one.plausible, one.both))
        table.add_row(name, *shares, f"{one.critic:.2f}", f"{one.jerk:.1f}")
    return table
