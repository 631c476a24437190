"""`bunraku map`: recordings as paths over a dancer's poses: pictures, a page, a sheet to draw on."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.data.dataset import FPS, Dataset
from appliance.studio.pose_space import map_pictures
from appliance.studio.pose_space.drawing import UNITS
from appliance.studio.pose_space.latent_poses import PoseMap, distance_over_time, latents_of, poses_of
from appliance.studio.pose_space.pose_model import open_pose_model, training_latents
from appliance.studio.pose_space.projections import Projection, projections
from appliance.studio.standing_dance import excerpt_of
from appliance.studio.studio_error import StudioError

PAGE_EVERY = 2  # poses from one to the next on the page
MOST_PAGE_POSES = 6000
GRID = 9  # figures along the map's wider side
NOBODY = 0.35  # of the map's spread: farther from all recorded poses nobody has been


@dataclass(frozen=True)
class MapOptions:
    """The command line of bunraku map. Two files: two versions of a phrase, which are compared."""

    model: Path
    out: Path
    files: tuple[Path, ...]
    recordings: Path | None = None
    seconds: float = 60.0


def run(options: MapOptions) -> None:
    """Project, compare, draw; raises StudioError."""
    console = Console(stderr=True)
    coder, dataset = open_pose_model(options.model, options.recordings, console)
    autoencoder, moving = coder.autoencoder, list(dataset.moving)
    if len({file.stem for file in options.files}) < len(options.files):
        raise StudioError("Two of the recordings have the same name. Give each once.")
    recordings = {
        file.stem: excerpt_of(file, 0.0, options.seconds, coder, dataset.skeleton) for file in options.files
    }
    everything = training_latents(autoencoder, dataset)
    pose_map = PoseMap.of(everything, 3)
    found = projections(autoencoder, list(recordings.values()), moving, PoseMap.of(everything, 2))
    options.out.mkdir(parents=True, exist_ok=True)
    known = pose_map.points(everything)
    map_pictures.draw_projections(options.out / "projections.png", list(recordings), found)
    ground = options.out / "map.png"
    paths = {
        name: pose_map.points(latents_of(autoencoder, one.poses[:, moving])[0])
        for name, one in recordings.items()
    }
    frame = map_pictures.draw_map(
        ground, known, paths, _figures(autoencoder, dataset, pose_map, known), NOBODY
    )
    _write_sheet(options.out / "map.svg", ground, frame)
    _write_page(options.out / "map.html", dataset, recordings, paths)
    report: dict[str, Any] = {
        "directions_explain": _explained(pose_map, everything),
        "projections": {
            one.name: dict(zip(("step", "longest_step"), one.continuity, strict=True)) for one in found
        },
    }
    if len(paths) == 2:
        report["apart"] = _compare(options.out, paths)
    (options.out / "map.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    for projection in found:
        console.print(_continuity(projection), highlight=False)
    console.print(
        f"{options.out}: map.html to turn in a browser, map.png, projections.png, and map.svg to draw a "
        "line on for bunraku path --draw.",
        highlight=False,
        soft_wrap=True,
    )


def _figures(
    autoencoder: Autoencoder, dataset: Dataset, pose_map: PoseMap, known: Array
) -> list[tuple[Array, Array, Sequence[tuple[int, int]]]]:
    """On a grid over the map: place (2,), the figure that is usual there (J, 3) in metres, its bones."""
    low, high = np.percentile(known[:, :2], [1, 99], axis=0)
    step = float((high - low).max()) / (GRID - 1)
    columns, rows = (np.arange(a, b + step / 2, step) for a, b in zip(low, high, strict=True))
    places = np.array([(x, y) for y in rows for x in columns])
    whole = np.tile(dataset.still_pose(), (len(places), 1, 1))
    whole[:, list(dataset.moving)] = poses_of(autoencoder, pose_map.latents(places))
    positions, _ = dataset.skeleton.forward_kinematics(whole, np.zeros((len(places), 3)))
    bones = [(joint, parent) for joint, parent in enumerate(dataset.skeleton.parents) if parent >= 0]
    return [(place, figure, bones) for place, figure in zip(places, positions, strict=True)]


def _compare(out: Path, paths: dict[str, Array]) -> dict[str, float]:
    """Two versions of a phrase: their distance on the map over time."""
    (one, first), (other, second) = paths.items()
    apart = distance_over_time(first, second)
    map_pictures.draw_distance(out / "distance.png", apart, one, other, FPS)
    return {"mean": float(apart.mean()), "largest": float(apart.max()), "at_s": float(apart.argmax() / FPS)}


def _write_sheet(path: Path, ground: Path, frame: tuple[float, float, float, float]) -> None:
    """The map as an SVG whose units are hundredths of the map's, y downwards, for any drawing program."""
    left, right, bottom, top = (UNITS * edge for edge in frame)
    box = f"{left:.2f} {-top:.2f} {right - left:.2f} {top - bottom:.2f}"
    picture = base64.b64encode(ground.read_bytes()).decode()
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{right - left:.2f}" height="{top - bottom:.2f}" '
        f'viewBox="{box}">\n<title>Draw one line over this map: bunraku path --draw</title>\n'
        f'<image x="{left:.2f}" y="{-top:.2f}" width="{right - left:.2f}" height="{top - bottom:.2f}" '
        f'preserveAspectRatio="none" href="data:image/png;base64,{picture}"/>\n</svg>\n',
        encoding="utf-8",
    )


def _write_page(
    path: Path, dataset: Dataset, recordings: dict[str, Recording], paths: dict[str, Array]
) -> None:
    """A page that opens without a network: the paths in three dimensions, and the figure at each point."""
    every = max(PAGE_EVERY, sum(map(len, recordings.values())) // MOST_PAGE_POSES)
    dances = []
    for name, recording in recordings.items():
        positions, _ = dataset.skeleton.forward_kinematics(
            recording.poses[::every], np.zeros((len(recording.poses[::every]), 3))
        )
        points = paths[name][::every]
        if points.shape[1] < 3:
            points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        dances.append(
            {
                "name": name,
                "path": np.round(points, 3).tolist(),
                "figures": np.round(positions.reshape(len(positions), -1), 3).tolist(),
            }
        )
    bones = [[joint, parent] for joint, parent in enumerate(dataset.skeleton.parents) if parent >= 0]
    data = json.dumps({"bones": bones, "fps": FPS / every, "dances": dances}).replace("</", "<\\/")
    template = resources.files("appliance.studio.pose_space").joinpath("map.html").read_text("utf-8")
    path.write_text(template.replace("/*DATA*/", data), encoding="utf-8")


def _explained(pose_map: PoseMap, everything: Array) -> float:
    """Share of the latents' variance along the map's first two directions."""
    return float((pose_map.spread[:2] ** 2).sum() / everything.var(axis=0).sum())


def _continuity(projection: Projection) -> str:
    step, longest = projection.continuity
    return (
        f"- {projection.name}: 20 ms are {step:.1f} % of the map, the longest step {longest:.0f} times that."
    )
