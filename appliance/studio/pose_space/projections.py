"""Maps from a body to few numbers, side by side: PCA, the pose autoencoder, UMAP if it is installed.

'Beyond Imitation', Figures 2 and 3: each with the heading in the figure and without it. Only PCA and the
autoencoder are continuous and lead back from the map to a pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.improviser.naturalness import figure_shapes
from appliance.studio.pose_space.latent_poses import PoseMap, latents_of

if TYPE_CHECKING:
    from appliance.studio.coded_windows import Network

WITHOUT_UMAP = (
    "UMAP is not installed here: projections.png has PCA and the pose autoencoder only, and the map is the "
    "autoencoder's, as always. Add UMAP with: pip install umap-learn"
)
MOST_NEIGHBOURS_OF = 4000  # figures that UMAP is fitted to


@dataclass(frozen=True)
class Projection:
    """name; points (T, D) of each recording; continuity: median step along a recording, in hundredths of the
    map's spread, and the longest step in those: a map that tears has a long one.
    """

    name: str
    points: tuple[Array, ...]

    @property
    def continuity(self) -> tuple[float, float]:
        spread = float(np.concatenate(self.points).std(axis=0).max()) or 1.0
        steps = np.concatenate([np.linalg.norm(np.diff(one, axis=0), axis=1) for one in self.points])
        middle = float(np.median(steps))
        return 100 * middle / spread, float(steps.max()) / max(middle, 1e-9)


def projections(
    network: Network, recordings: Sequence[Recording], moving: Sequence[int], pose_map: PoseMap
) -> list[Projection]:
    """Two numbers a pose by every method, for recordings at 50 Hz; the autoencoder's only without heading."""
    level = [figure_shapes(one, moving) for one in recordings]
    turned = [_shapes_with_heading(one, moving) for one in recordings]
    latents = [latents_of(network, one.poses[:, list(moving)])[0] for one in recordings]
    found = [
        Projection("PCA, heading kept", _principal(turned)),
        Projection("PCA, heading removed", _principal(level)),
        Projection("pose autoencoder", tuple(pose_map.points(one)[:, :2] for one in latents)),
    ]
    for name, shapes in (("UMAP, heading kept", turned), ("UMAP, heading removed", level)):
        neighbours = _umap(shapes)
        found += [] if neighbours is None else [Projection(name, neighbours)]
    return found


def _shapes_with_heading(recording: Recording, moving: Sequence[int]) -> Array:
    """Positions (N, M * 3) in centimetres from the hip, as the body faces."""
    zero = np.zeros((len(recording), 3))
    positions, _ = recording.skeleton.forward_kinematics(recording.poses, zero)
    return 100 * positions[:, list(moving)].reshape(len(recording), -1)


def _principal(shapes: Sequence[Array]) -> tuple[Array, ...]:
    whole = np.concatenate(shapes).astype(np.float32)
    found = PoseMap.of(whole, whole, 2)
    return tuple(found.points(one.astype(np.float32)) for one in shapes)


def _umap(shapes: Sequence[Array]) -> tuple[Array, ...] | None:
    """None where umap-learn is not installed."""
    try:
        from umap import UMAP
    except ImportError:
        return None
    whole = np.concatenate(shapes)
    fitted = UMAP(random_state=1, n_jobs=1).fit(whole[:: max(1, len(whole) // MOST_NEIGHBOURS_OF)])
    return tuple(np.asarray(fitted.transform(one)) for one in shapes)
