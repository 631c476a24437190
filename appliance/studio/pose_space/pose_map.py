"""`bunraku map`: recordings as paths over a dancer's poses: pictures, a page, a sheet to draw on."""

from __future__ import annotations

import base64
import json
from dataclasses import asdict, dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from appliance.levers.sources import PATH
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.whole_file import write_text_whole
from appliance.studio.comparison.alignment import align
from appliance.studio.dance_files import write_report
from appliance.studio.data.dataset import FPS
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.opened_model import open_either
from appliance.studio.pose_space import map_pictures
from appliance.studio.pose_space.drawing import UNITS
from appliance.studio.pose_space.ground import Ground
from appliance.studio.pose_space.latent_poses import distance_over_time
from appliance.studio.pose_space.projections import WITHOUT_UMAP, Projection, projections
from appliance.studio.progress import doing
from appliance.studio.standing_dance import excerpt_of
from appliance.studio.studio_error import StudioError

PAGE_EVERY = 2  # poses from one to the next on the page
MOST_PAGE_POSES = 6000
MOST_KNOWN = 3000  # recorded poses that the page shows as dots


@dataclass(frozen=True)
class MapOptions:
    """The command line of bunraku map. Two files: two versions of a phrase, which are compared."""

    model: Path | None
    out: Path
    files: tuple[Path, ...]
    show: Path | None = None
    recordings: Path | None = None
    seconds: float = 60.0
    reading: ReadingOptions = AS_THE_FILES_SAY


def run(options: MapOptions) -> None:
    """Project, compare, draw; raises StudioError."""
    console = Console(stderr=True)
    opened = open_either(PATH, options.model, options.show, options.recordings, console, options.reading)
    network, dataset, moving = opened.network, opened.dataset, list(opened.dataset.moving)
    files = options.files or (() if opened.phrase is None else (opened.phrase,))
    if len({file.stem for file in files}) < len(files):
        raise StudioError("Two of the recordings have the same name. Give each once.")
    recordings = {
        file.stem: excerpt_of(file, 0.0, options.seconds, opened.moved, dataset, options.reading)
        for file in files
    }
    with doing("laying the recordings over the map", console):
        ground = Ground.of(network, dataset)
        found = projections(network, list(recordings.values()), moving, ground.pose_map)
    options.out.mkdir(parents=True, exist_ok=True)
    with doing("drawing the pictures", console):
        map_pictures.draw_projections(options.out / "projections.png", list(recordings), found)
        paths = {name: ground.path(one.poses[:, moving]) for name, one in recordings.items()}
        frame = ground.draw(options.out / "map.png", paths)
    _write_sheet(options.out / "map.svg", options.out / "map.png", frame)
    _write_page(options.out / "map.html", ground, recordings, paths)
    report: dict[str, Any] = {
        "explained": ground.pose_map.explained,
        "reach": {**asdict(ground.reach), "is_dead": ground.reach.is_dead},
        "projections": {
            one.name: dict(zip(("step", "longest_step"), one.continuity, strict=True)) for one in found
        },
    }
    if len(paths) == 2:
        report["apart"] = _compare(options.out, recordings, paths, moving)
    write_report(options.out / "map.json", report)
    for projection in found:
        console.print(_continuity(projection), highlight=False)
    if not any(one.name.startswith("UMAP") for one in found):
        console.print(f"- {WITHOUT_UMAP}", highlight=False, soft_wrap=True)
    if "apart" in report:
        console.print(
            f"The two are {report['apart']['mean']:.2f} apart on the map, aligned in time "
            f"({report['apart']['on_the_clock']:.2f} on the clock). Joint by joint: bunraku compare.",
            highlight=False,
            soft_wrap=True,
        )
    if not opened.is_dead:  # a dead network's cause is said already; its map's would be another one
        console.print(ground.reach.sentence(), highlight=False, soft_wrap=True)
    console.print(
        f"{options.out}: map.html to turn in a browser, map.png, projections.png, and map.svg to draw a "
        "line on for bunraku path --draw.",
        highlight=False,
        soft_wrap=True,
    )


def _compare(
    out: Path, recordings: dict[str, Recording], paths: dict[str, Array], moving: list[int]
) -> dict[str, float]:
    """Two versions of a phrase: their distance on the map over the seconds of the first, aligned in time.

    Where one is too long to be a version of the other, at the same ticks of both.
    """
    (one, first), (other, second) = paths.items()
    on_the_clock, begins = distance_over_time(first, second), 0
    try:
        found = align(*(without_heading(each.poses[:, moving]) for each in recordings.values()))
        begins, ticks = found.first, np.arange(len(second))
        second = np.stack([np.interp(found.ticks, ticks, column) for column in second.T], axis=1)
        first = first[begins:]
    except StudioError:
        pass
    apart = distance_over_time(first, second)
    map_pictures.draw_distance(out / "distance.png", apart, one, other, FPS)
    return {
        "mean": float(apart.mean()),
        "largest": float(apart.max()),
        "at_s": float((begins + apart.argmax()) / FPS),
        "on_the_clock": float(on_the_clock.mean()),
    }


def _write_sheet(path: Path, picture: Path, frame: tuple[float, float, float, float]) -> None:
    """The map as an SVG whose units are hundredths of the map's, y downwards, for any drawing program."""
    left, right, bottom, top = (UNITS * edge for edge in frame)
    box = f"{left:.2f} {-top:.2f} {right - left:.2f} {top - bottom:.2f}"
    pixels = base64.b64encode(picture.read_bytes()).decode()
    write_text_whole(
        path,
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{right - left:.2f}" height="{top - bottom:.2f}" '
        f'viewBox="{box}">\n<title>Draw one line over this map: bunraku path --draw</title>\n'
        f'<image x="{left:.2f}" y="{-top:.2f}" width="{right - left:.2f}" height="{top - bottom:.2f}" '
        f'preserveAspectRatio="none" href="data:image/png;base64,{pixels}"/>\n</svg>\n',
    )


def _write_page(
    path: Path, ground: Ground, recordings: dict[str, Recording], paths: dict[str, Array]
) -> None:
    """A page that opens without a network: the paths in three dimensions, and the figure at each point.

    Two recordings are shown at the same moment, with their distance.
    """
    skeleton, dances = ground.dataset.skeleton, []
    every = max(PAGE_EVERY, sum(map(len, recordings.values())) // MOST_PAGE_POSES)
    for name, recording in recordings.items():
        poses = recording.poses[::every]
        positions, turns = skeleton.forward_kinematics(poses, np.zeros((len(poses), 3)))
        ends = [
            positions[:, joint] + quaternion.rotate(turns[:, joint], np.broadcast_to(offset, (len(poses), 3)))
            for joint, offset in skeleton.ends
        ]
        positions = np.concatenate([positions, *(end[:, None] for end in ends)], axis=1)
        dances.append(
            {
                "name": name,
                "path": _in_three(paths[name][::every]),
                "figures": np.round(positions.reshape(len(positions), -1), 3).tolist(),
            }
        )
    known = _in_three(ground.known[:: max(1, len(ground.known) // MOST_KNOWN)])
    bones = [[joint, parent] for joint, parent in enumerate(skeleton.parents) if parent >= 0]
    bones += [[len(skeleton) + number, joint] for number, (joint, _) in enumerate(skeleton.ends)]
    facts = {"bones": bones, "fps": FPS / every, "known": known, "dances": dances}
    data = json.dumps(facts).replace("</", "<\\/")
    template = resources.files("appliance.studio.pose_space").joinpath("map.html").read_text("utf-8")
    write_text_whole(path, template.replace("/*DATA*/", data))


def _in_three(points: Array) -> list[list[float]]:
    """Points (T, D) of a map with D up to 3, as numbers for the page."""
    found: list[list[float]] = np.round(np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), 3).tolist()
    return found


def _continuity(projection: Projection) -> str:
    step, longest = projection.continuity
    return (
        f"- {projection.name}: 20 ms are {step:.1f} % of the map, the longest step {longest:.0f} times that."
    )
