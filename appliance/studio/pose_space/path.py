"""`bunraku path`: a phrase whose path through the poses wobbles, or a drawn path that becomes a dance."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from rich.console import Console

from appliance.dancer.material.pose_paths import even_path, wobbled
from appliance.levers.sources import PATH
from appliance.pictures.filmstrip import Strip, draw_strips
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.studio.dance_files import write_recording, write_report
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.dance_figures import degrees_apart, energy
from appliance.studio.evaluation.nearest import reference_of, without_heading
from appliance.studio.improviser.naturalness import Yardstick, measure
from appliance.studio.improviser.naturalness_table import naturalness_table
from appliance.studio.opened_model import open_either
from appliance.studio.pose_space.drawing import read_line
from appliance.studio.pose_space.ground import Ground
from appliance.studio.pose_space.latent_poses import latents_of, poses_of
from appliance.studio.progress import doing, shown
from appliance.studio.standing_dance import excerpt_of, only_in, standing

COLUMNS = 8  # in a strip


@dataclass(frozen=True)
class PathOptions:
    """The command line of bunraku path. wobble: amplitude and Hz; draw: a line over the map, SVG or CSV."""

    model: Path | None
    out: Path
    show: Path | None = None
    phrase: Path | None = None
    recordings: Path | None = None
    wobble: tuple[float, float] | None = None
    draw: Path | None = None
    seed: int = 1
    start: float = 0.0
    seconds: float = 10.0
    regions: tuple[str, ...] = ()
    reading: ReadingOptions = AS_THE_FILES_SAY


def run(options: PathOptions) -> None:
    """Walk, decode, stand, measure, write; raises StudioError."""
    console = Console(stderr=True)
    opened = open_either(PATH, options.model, options.show, options.recordings, console, options.reading)
    network, dataset, moving = opened.network, opened.dataset, list(opened.dataset.moving)
    given, phrase = None, options.phrase or (opened.phrase if options.wobble or options.regions else None)
    if phrase is not None:
        given = excerpt_of(phrase, options.start, options.seconds, opened.moved, dataset, options.reading)
    if given is not None and options.wobble is not None:
        latents, facing = latents_of(network, given.poses[:, moving])
        poses = poses_of(network, wobbled(latents, *options.wobble, options.seed), facing)
    else:
        assert options.draw is not None, "the command asks for a phrase with a wobble, or a drawing"
        line = even_path(read_line(options.draw), round(options.seconds * FPS))
        ground = Ground.of(network, dataset)
        poses = poses_of(network, ground.pose_map.latents(line))
        if ground.reach.is_dead and not opened.is_dead:
            console.print(ground.reach.sentence(), highlight=False, soft_wrap=True)
    if given is not None and options.regions:
        poses = only_in(options.regions, poses, given, dataset)
    progress = partial(shown, description="planting the feet", console=console)
    whole = standing(poses, given, dataset, progress, opened.is_of_show)
    write_recording(options.out, whole)
    with doing("measuring the dance and the recordings", console):
        reference = reference_of(dataset.training, dataset.moving_names)
        nearest = float(reference.nearest(poses).mean())
        natural = measure(whole, Yardstick.of(dataset.training, dataset.moving), endless=False)
    figures = {
        "nearest_recorded_pose_degrees": nearest,
        "degrees_a_second": FPS * energy(without_heading(poses)),
    }
    strips = [Strip(whole.poses, whole.roots, _title(options))]
    if given is not None:
        own = given.poses[: len(poses), moving]
        figures["degrees_from_the_phrase"] = float(
            degrees_apart(without_heading(own), without_heading(poses)).mean()
        )
        strips.insert(0, Strip(given.poses, given.roots, "phrase"))
        strips[1] = Strip(whole.poses, whole.roots, _title(options), behind=strips[0])
    with doing("drawing the strip", console):
        picture = options.out.with_suffix(".png")
        draw_strips(picture, dataset.skeleton, strips, FPS, options.out.stem, COLUMNS, options.start)
    report = {"options": asdict(options), "figures": figures, "naturalness": natural.as_json()}
    write_report(options.out.with_suffix(".json"), report)
    said = ", ".join(f"{name.replace('_', ' ')} {value:.1f}" for name, value in figures.items())
    Console().print(naturalness_table({options.out.stem: natural}))
    console.print(f"{options.out}: {said}.", highlight=False, soft_wrap=True)


def _title(options: PathOptions) -> str:
    where = f"{' and '.join(options.regions)} only: " if options.regions else ""
    if options.wobble is not None:
        return f"{where}wobbling by {options.wobble[0]:g} sigma at {options.wobble[1]:g} Hz"
    assert options.draw is not None
    return f"{where}along {options.draw.name}"
