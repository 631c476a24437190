"""Poses that a dancer never had although each of its limbs had them: where the space of poses is unexplored.

A pose is unseen if it is farther from all recorded ones than takes usually are from each other. It is
plausible if each limb is no farther than that from a recorded one, and the network codes it as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.material.latent_paths import Latents, between
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Dataset, Take
from appliance.studio.data.regions import NAMES, joints_of
from appliance.studio.evaluation.coders import Poses
from appliance.studio.evaluation.dance_figures import degrees_apart
from appliance.studio.evaluation.nearest import without_heading
from appliance.studio.improviser.naturalness import distances, figure_shapes
from appliance.studio.pose_space.latent_poses import latents_of, poses_of
from appliance.studio.standing_dance import on_the_spot

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network

EVERY = 5  # ticks from one known pose to the next
USUAL_PERCENT = 95.0  # percent of the known poses that are as near as that to another take
UNSEEN_PERCENT = 80.0  # percent as well; a pose that is farther from all known ones is unseen
CANDIDATES = 2000
MOST_KNOWN = 6000


@dataclass(frozen=True, eq=False)
class Region:
    """A place that nobody was at: its latent (Z,), how many candidates are near, centimetres from the nearest
    known pose, which is at that second of a take, and the joint that differs most.
    """

    latent: Latents
    share: float
    away_cm: float
    take: str
    at_s: float
    joint: str
    joint_cm: float


@dataclass(frozen=True)
class Known:
    """All that the dancer did. shapes (K, M * 3): figures in centimetres; owners (K,): of the takes; limbs:
    places of each limb's joints among the moving ones; far: distance from which on a pose is unseen; usual,
    usual_of: distances between takes, of the whole and of each limb; coding: degrees that the network is off.
    """

    network: Network
    dataset: Dataset
    takes: Sequence[Take]
    poses: Poses
    shapes: Array
    owners: NDArray[np.intp]
    ticks: NDArray[np.intp]
    limbs: dict[str, list[int]]
    far: float
    usual: float
    usual_of: dict[str, float]
    coding: float

    @staticmethod
    def of(network: Network, dataset: Dataset, seen: Sequence[Take] = ()) -> Known:
        """seen: what was danced since the training takes, which say what usual distances are.

        Raises StudioError for a body without limbs.
        """
        takes = [*dataset.training, *seen]
        moving = list(dataset.moving)
        every = max(EVERY, sum(len(take.recording) for take in takes) // MOST_KNOWN)
        ticks = [np.flatnonzero(take.sound)[::every] for take in takes]
        poses, shapes = [], []
        for take, chosen in zip(takes, ticks, strict=True):
            poses.append(take.recording.poses[chosen][:, moving].astype(np.float32))
            shapes.append(figure_shapes(take.recording, moving)[chosen])
        owners = np.repeat(np.arange(len(takes)), [len(each) for each in ticks])
        whole, known = np.concatenate(shapes), np.concatenate(poses)
        limbs = {
            name: [moving.index(joint) for joint in joints_of([name], dataset.skeleton, moving)]
            for name in NAMES
        }
        ours = owners < len(dataset.training)
        theirs = owners[ours]
        coded = poses_of(network, *latents_of(network, known))
        return Known(
            network,
            dataset,
            takes,
            known,
            whole,
            owners,
            np.concatenate(ticks),
            limbs,
            _usual(whole[ours], theirs, UNSEEN_PERCENT),
            _usual(whole[ours], theirs),
            {name: _usual(_of_joints(whole[ours], places), theirs) for name, places in limbs.items()},
            float(np.percentile(degrees_apart(coded, known), USUAL_PERCENT)),
        )

    def shapes_of(self, poses: Poses) -> Array:
        """(T, M * 3): figures of poses (T, M, 4) of the moving joints."""
        return figure_shapes(on_the_spot(poses, self.dataset), self.dataset.moving)

    def unseen(self, shapes: Array) -> NDArray[np.bool_]:
        """(T,): far from all known figures."""
        far: NDArray[np.bool_] = distances(shapes, self.shapes).min(axis=1) > self.far
        return far

    def plausible(self, shapes: Array) -> NDArray[np.bool_]:
        """(T,): each limb as near to a known one as usual."""
        near = np.ones(len(shapes), bool)
        for name, places in self.limbs.items():
            known = _of_joints(self.shapes, places)
            near &= distances(_of_joints(shapes, places), known).min(axis=1) <= self.usual_of[name]
        return near

    def regions(self, count: int, seed: int) -> tuple[list[Region], float]:
        """The largest and farthest unexplored regions, and the share of the candidates that are in any.

        Candidates are mixtures of known poses: of two latents, or one's arms, legs or trunk with another's
        rest, as the network codes them.
        """
        latents = self._candidates(seed)
        poses = poses_of(self.network, latents)
        again = poses_of(self.network, *latents_of(self.network, poses))
        shapes = self.shapes_of(poses)
        good = self.unseen(shapes) & self.plausible(shapes) & (degrees_apart(again, poses) <= self.coding)
        new = np.flatnonzero(good)
        beyond = distances(shapes[new], self.shapes).min(axis=1) - self.far
        near = distances(shapes[new], shapes[new]) <= self.usual
        found, left = list[Region](), np.ones(len(new), bool)
        while left.any() and len(found) < count:
            best = int((near[:, left].sum(axis=1) * beyond * left).argmax())
            members = near[best] & left
            members[best] = True
            found.append(self._region(latents[new[best]], shapes[new[best]], members.sum() / len(latents)))
            left &= ~members
        return found, float(good.mean())

    def _region(self, latent: Latents, shape: Array, share: float) -> Region:
        apart = distances(shape[None], self.shapes)[0]
        nearest = int(apart.argmin())
        take = self.takes[self.owners[nearest]]
        joints = np.linalg.norm((shape - self.shapes[nearest]).reshape(-1, 3), axis=1)
        worst = int(joints.argmax())
        skeleton, joint = self.dataset.skeleton, self.dataset.moving[worst]
        name = next((role for role, one in skeleton.roles.items() if one == joint), skeleton.names[joint])
        at_s = take.begins_s + self.ticks[nearest] / FPS
        return Region(
            latent, float(share), float(apart[nearest]), take.file, float(at_s), name, float(joints[worst])
        )

    def _candidates(self, seed: int) -> Latents:
        """(N, Z)."""
        rng = np.random.default_rng(seed)
        half = CANDIDATES // 2
        latents = latents_of(self.network, self.poses)[0]
        one, other = latents[rng.integers(len(latents), size=(2, half))]
        mixed = [between(a[None], b[None], 0.5, 0.0, 0)[0] for a, b in zip(one, other, strict=True)]
        level = without_heading(self.poses).astype(np.float32)
        crossed = level[rng.integers(len(level), size=half)]
        donors = level[rng.integers(len(level), size=half)]
        for number, places in enumerate(self.limbs.values()):
            rows = slice(number, None, len(self.limbs))
            inner = [place for place in places if place]  # the root, with its heading, stays
            for place in inner:
                crossed[rows, place] = donors[rows, place]
        return np.concatenate([np.array(mixed), latents_of(self.network, crossed)[0]]).astype(np.float32)


def poses_shown(known: Known, region: Region) -> tuple[Recording, Recording]:
    """The pose of a region, and the known pose that is nearest to it: one frame each, facing ahead."""
    made = on_the_spot(poses_of(known.network, region.latent[None]), known.dataset)
    apart = distances(known.shapes_of(poses_of(known.network, region.latent[None])), known.shapes)[0]
    nearest = known.poses[int(apart.argmin())][None].copy()
    return made, on_the_spot(without_heading(quaternion.normalize(nearest)).astype(np.float32), known.dataset)


def _usual(shapes: Array, owners: NDArray[np.intp], percent: float = USUAL_PERCENT) -> float:
    """The distance to the nearest figure of another take that so many of the figures are within."""
    found = np.full(len(shapes), np.inf)
    for owner in np.unique(owners):
        own = owners == owner
        if not own.all():
            found[own] = distances(shapes[own], shapes[~own]).min(axis=1)
    finite = found[np.isfinite(found)]
    return float(np.percentile(finite, percent)) if len(finite) else 5.0


def _of_joints(shapes: Array, places: Sequence[int]) -> Array:
    """(K, P * 3) of shapes (K, M * 3)."""
    return shapes.reshape(len(shapes), -1, 3)[:, list(places)].reshape(len(shapes), -1)
