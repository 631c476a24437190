"""Maker: a recipe becomes a loop: a phrase varied, a walk, a path over the map, or an improvisation.

The same recipe gives the same loop, bit for bit, on the same machine with the same versions: a replay makes
what was danced again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appliance.dancer.grounding import Floor, survey
from appliance.dancer.loop import Loop, Placement
from appliance.dancer.material import latent_paths
from appliance.dancer.material.carrying import carried
from appliance.dancer.material.cyclic import Cycle, Starts, even_starts
from appliance.dancer.material.improviser_network import ImproviserNetwork
from appliance.dancer.material.improvising import MOVE, improvised
from appliance.dancer.material.motion_network import MotionNetwork, Poses
from appliance.dancer.material.pose_paths import even_path, wobbled
from appliance.dancer.material.prompt import CLOSING, closing_frame, homed, unpacked_steps
from appliance.dancer.material.put_on import put_on
from appliance.dancer.material.steps import HOP, Steps, danced_again, motion_of
from appliance.dancer.phrase import FPS, X, Z
from appliance.levers.sources import GRANULAR, IMPROVISE, KEPT, MAIN, PATH, VARY
from appliance.pose import quaternion
from appliance.pose.possible import possible_roots
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

GRANULAR_S, POINT_S = 20.0, 12.0  # seconds of a walk; of a point or a stroke of the map, there and back
_FEWEST, _FADE = 50, 25  # frames of an excerpt, and of the fade from its end to its start
Recipe = Mapping[str, Any]


def open_network(source: str, file: Path, joints: Sequence[str]) -> MotionNetwork:
    """The network of a source. Raises MotionNetworkError."""
    return (ImproviserNetwork if source == IMPROVISE else MotionNetwork)(file, joints)


class Maker:
    """Makes loops of a show. loop_of: the whole loop of a phrase by its name.

    networks: the files of the sources' networks by source; each is read when it is needed.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        networks: Mapping[str, Path],
        loop_of: Callable[[str], Loop],
        grounded: bool,
    ) -> None:
        self._skeleton, self._files, self._grounded = skeleton, networks, grounded
        self._loop_of = loop_of
        self._networks: dict[Path, MotionNetwork] = {}

    def make(self, recipe: Recipe) -> Loop:
        """Raises MotionNetworkError, and LookupError or ValueError for a recipe that is none of this show."""
        if recipe["source"] == KEPT:
            return self.make({**recipe["of"], "number": recipe["number"]})
        network = self.network(recipe["source"])
        if isinstance(network, ImproviserNetwork):
            cycle, poses = self._improvised(network, recipe)
        else:
            make = {VARY: self._varied, GRANULAR: self._walked, PATH: self._path}[recipe["source"]]
            cycle, poses = make(network, recipe)
        floor = self._floor(cycle, poses)
        lifts, heights = (None, None) if floor is None else (floor.lifts, floor.rest_heights)
        return cycle.loop(poses, lifts, heights, recipe["number"])

    def _varied(self, network: MotionNetwork, recipe: Recipe) -> tuple[Cycle, Poses]:
        """The phrase moved by noise of sigma standard deviations, the same for all its windows; at 0 the
        phrase itself.
        """
        cycle = Cycle.of(self._loop_of(recipe["phrase"]))
        starts, latents, facing = _encoded(network, cycle)
        noise = np.random.default_rng(recipe["seed"]).standard_normal(network.latent)
        moved = (latents + recipe["sigma"] * noise).astype(np.float32)
        known, varied = (
            cycle.blended(_decoded(network, path, starts, facing), network.places)[:, network.places]
            for path in (latents, moved)
        )
        poses = cycle.poses.copy()
        poses[:, network.places] = put_on(poses[:, network.places], known, varied, cycle.step.yaw)
        return cycle, quaternion.continuous(poses).astype(np.float32, copy=False)

    def _walked(self, network: MotionNetwork, recipe: Recipe) -> tuple[Cycle, Poses]:
        """A walk through the prior, or the path between two excerpts, that leads into its own start."""
        seed = recipe["seed"]
        if recipe.get("from"):
            seconds = recipe.get("seconds", 0.0)
            cycle = self._excerpt(recipe["from"], recipe.get("from_start_s", 0.0), seconds)
            other = self._excerpt(recipe.get("to") or recipe["from"], recipe.get("to_start_s", 0.0), seconds)
            starts, one, facing = _encoded(network, cycle)
            _, two, _ = _encoded(network, other)
            two = np.resize(two, one.shape)  # the shorter one goes round
            path = latent_paths.between(one, two, recipe["mix"], recipe["offset"], seed)
            return cycle, cycle.blended(_decoded(network, path, starts, facing), network.places)
        cycle = self._on_the_spot(GRANULAR_S)
        starts = even_starts(len(cycle.poses), network.window)
        waves = recipe["speed"] * GRANULAR_S
        path = latent_paths.walked(len(starts), network.latent, recipe["spread"], waves, seed)
        return cycle, cycle.blended(_decoded(network, path, starts), network.places)

    def _excerpt(self, name: str, start_s: float, seconds: float) -> Cycle:
        """Seconds of a phrase from start_s on, all within it, as a cycle; 0: the whole phrase."""
        loop = self._loop_of(name)
        if not seconds:
            return Cycle.of(loop)
        count = min(max(round(seconds * FPS), _FEWEST), loop.length)
        first = min(max(round((start_s - loop.start_s) * FPS), 0), loop.length - count)
        part = slice(first, first + count)
        return Cycle.of(Loop(loop.poses[part], loop.track[part], _FADE, loop.start_s + first / FPS))

    def _path(self, network: MotionNetwork, recipe: Recipe) -> tuple[Cycle, Poses]:
        """A phrase's own path, or a point or stroke of the map, that wobbles."""
        points, rate = recipe.get("points"), recipe["frequency"]
        if not points:
            cycle = Cycle.of(self._loop_of(recipe["phrase"]))
            starts, latents, facing = _encoded(network, cycle)
        else:
            cycle = self._on_the_spot(POINT_S)
            starts, facing = np.arange(len(cycle.poses)), None
            latents = _on_the_map(network, np.array(points, float).reshape(-1, 2), len(starts))
        seconds = len(latents) / FPS
        rate = max(1, round(rate * seconds)) / seconds  # a whole number of waves leads into the start
        moved = wobbled(latents, recipe["wobble"], rate, recipe["seed"])
        return cycle, cycle.blended(_decoded(network, moved, starts, facing), network.places)

    def _improvised(self, network: ImproviserNetwork, recipe: Recipe) -> tuple[Cycle, Poses]:
        """The motion with which the dancer continues the recipe's prompt; its end leads into its start."""
        heard = unpacked_steps(recipe["prompt"], network.features)
        moves = math.ceil(recipe["seconds"] * FPS / HOP / MOVE)
        danced = improvised(network, heard[None], moves, recipe["temperature"], recipe["seed"])[0]
        main = self._loop_of(MAIN)
        together = Steps.of_features(np.concatenate([heard, danced]))
        poses, roots = motion_of(network, together, main.poses[0], network.places)
        poses = danced_again(network, poses, network.places).astype(np.float32)
        count = closing_frame(poses[:, network.places])
        track = np.repeat(main.track[:1], count, axis=0)
        dance = Recording(self._skeleton, poses[:count].astype(float), roots[:count], FPS)
        track[:, X : Z + 1] = homed(possible_roots(carried(dance, cyclic=False).roots, FPS))
        cycle = Cycle.of(Loop(poses[:count], track, CLOSING, -CLOSING / FPS))
        return cycle, cycle.poses

    def _on_the_spot(self, seconds: float) -> Cycle:
        """A dancer that stays in its place, as high as the show's phrase on the mean, in its first pose."""
        main = self._loop_of(MAIN)
        count = round(seconds * FPS)
        poses = np.repeat(main.poses[:1], count, axis=0)
        turned = quaternion.inverse(quaternion.heading(poses[:, 0]))
        poses[:, 0] = quaternion.multiply(turned, poses[:, 0])
        track = np.repeat(main.track[:1], count + 1, axis=0)
        track[:, X : Z + 1] = 0.0, float(main.track[:, 1].mean()), 0.0
        return Cycle(poses, track, Placement(), 0.0)

    def _floor(self, cycle: Cycle, poses: Poses) -> Floor | None:
        if not self._grounded:
            return None
        return survey(Recording(self._skeleton, poses, cycle.track[:-1, X : Z + 1], FPS))

    def network(self, source: str) -> MotionNetwork:
        """The network of a source. Raises MotionNetworkError, LookupError."""
        file = self._files[source]
        if file not in self._networks:
            self._networks.clear()  # one in memory, of 8 to 30 MB, is enough
            self._networks[file] = open_network(source, file, self._skeleton.names)
        return self._networks[file]


def _encoded(network: MotionNetwork, cycle: Cycle) -> tuple[Starts, latent_paths.Latents, Array]:
    """Where windows of a cycle begin, their latents and where they face."""
    starts = even_starts(len(cycle.poses), network.window)
    parts = [
        network.encode(cycle.windows(starts[part], network.window, network.places))
        for part in network.parts(len(starts))
    ]
    return starts, np.concatenate([latents for latents, _ in parts]), np.concatenate([at for _, at in parts])


def _decoded(
    network: MotionNetwork, latents: latent_paths.Latents, starts: Starts, facing: Array | None = None
) -> Iterator[tuple[Poses, Starts]]:
    """Windows of latents, turned to where they face (W, 4), and their starts. In parts: the windows of a
    phrase overlap, and all of them are several times as large as it is.
    """
    for part in network.parts(len(latents)):
        windows = network.decode(latents[part])
        if facing is not None:
            windows[:, :, 0] = quaternion.multiply(facing[part, None], windows[:, :, 0])
        yield windows, starts[part]


def _on_the_map(network: MotionNetwork, points: Array, ticks: int) -> latent_paths.Latents:
    """Latents (ticks, Z) at a point, or along a line there and back; points (N, 2) of 0 to 1."""
    if network.ground is None:
        raise ValueError("This network of poses has no map. Export it again with this release.")
    middle, directions, low, high = network.ground
    places = low + (high - low) * points
    there_and_back = np.concatenate([places, places[-2::-1]])
    line = even_path(there_and_back, ticks) if len(places) > 1 else np.repeat(places, ticks, axis=0)
    return (middle + line @ directions).astype(np.float32)
