"""Measures the losses of a video: landmarks made of true recordings become a dance again.

    python -m tools.video_loss recordings/anna_1.bvh

The camera looks down a little, takes 30 uneven frames a second and loses some. Landmarks tremble, limbs are
hidden for a while, left and right change places. Beside it: the same without repairs, a mean pose, a T-pose.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from appliance.dancer.grounding import sole_positions
from appliance.pose import quaternion
from appliance.pose.point_layouts import IN_FILES, LAYOUTS
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import ReadingOptions, read_upright
from appliance.pose.recording import Recording
from appliance.pose.roles import ROLES
from appliance.studio.exchange.landmarks_dance import dance_of
from appliance.studio.exchange.landmarks_file import LandmarksFile
from tests.pose.landmarks import Landmarks

GROUPS = {
    "hips and trunk": ("hips", "spine", "chest"),
    "head": ("neck", "head"),
    "upper arms": ("left upper arm", "right upper arm"),
    "forearms": ("left forearm", "right forearm"),
    "hands": ("left hand", "right hand"),
    "thighs": ("left thigh", "right thigh"),
    "shins": ("left shin", "right shin"),
    "feet": ("left foot", "right foot"),
}
PLANTED_M_S = 0.15  # a point of the soles slower than this in the truth stands
LOW_M = 0.03


class Camera(NamedTuple):
    """noise_m: standard deviation of a landmark; of its depth twice that. lost: share of frames."""

    fps: float = 30.0
    noise_m: float = 0.015
    lost: float = 0.03
    hidden_a_minute: float = 12.0
    swapped_a_minute: float = 6.0
    down_degrees: float = 10.0
    metres_away: float = 4.0


def seen_by(camera: Camera, dance: Recording, rng: np.random.Generator, flat: bool = False) -> LandmarksFile:
    """The landmarks of a dance at 50 poses a second, as a network would find them; flat: in the picture."""
    layout = IN_FILES["body25"] if flat else LAYOUTS["mediapipe"]
    eye, parts = Landmarks(dance.skeleton), layout.parts
    times = np.arange(0.0, dance.seconds - 0.05, 1.0 / camera.fps)
    times = times + rng.normal(0.0, 0.003, len(times))
    times = np.sort(times[rng.random(len(times)) > camera.lost])
    nearest = np.clip(np.round(times * dance.fps).astype(int), 0, len(dance) - 1)
    places = np.array([eye.seen(parts, dance.poses[frame], dance.roots[frame]) for frame in nearest])
    times = nearest / dance.fps + 1e-6 * np.arange(len(nearest))
    down = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.radians(camera.down_degrees))
    seen = np.ones(places.shape[:2])
    if flat:
        ahead = quaternion.rotate(np.broadcast_to(down, (*places.shape[:2], 4)), places - [0.0, 1.0, 0.0])
        depth = camera.metres_away - ahead[..., 2:]
        places = np.concatenate([1000.0 * ahead[..., :2] / depth, np.zeros_like(depth)], axis=-1)
        places[..., 1] *= -1.0
        noise = 1000.0 * camera.noise_m / camera.metres_away * np.array([1.0, 1.0, 0.0])
    else:
        hips = [parts.index(f"{side} hip") for side in ("left", "right")]
        places = places - places[:, hips].mean(axis=1, keepdims=True)
        places = quaternion.rotate(np.broadcast_to(down, (*places.shape[:2], 4)), places)
        places = places * np.array([1.0, -1.0, -1.0])
        noise = camera.noise_m * np.array([1.0, 1.0, 2.0])
    shake, tremble = np.zeros_like(places[0]), np.empty_like(places)
    for frame in range(len(places)):  # networks' errors last for some frames
        shake = 0.6 * shake + rng.normal(0.0, 0.8, shake.shape) * noise
        tremble[frame] = shake
    places = places + tremble
    minutes = dance.seconds / 60
    for _ in range(rng.poisson(camera.hidden_a_minute * minutes)):
        first, frames = int(rng.integers(0, len(times))), int(rng.integers(5, 25))
        side, limb = rng.choice(["left", "right"]), str(rng.choice(["arm", "leg"]))
        names = ("elbow", "wrist", "index", "little") if limb == "arm" else ("knee", "ankle", "toe")
        hidden = [parts.index(f"{side} {name}") for name in names if f"{side} {name}" in parts]
        places[first : first + frames, hidden] += rng.normal(0, 1, (len(hidden), 3)) * 8 * noise
        seen[first : first + frames, hidden] = 0.1
    for _ in range(rng.poisson(camera.swapped_a_minute * minutes)):
        first, frames = int(rng.integers(0, len(times))), int(rng.integers(1, 6))
        for one in [part for part in parts if part.startswith("left ")]:
            left, right = parts.index(one), parts.index(one.replace("left", "right"))
            places[first : first + frames, [left, right]] = places[first : first + frames, [right, left]]
    return LandmarksFile(layout, places, seen, times, flat)


def losses(dance: Recording, true: Recording) -> Mapping[str, float]:
    """Mean degrees in the room for each group of joints; centimetres of all joints from the hips, and of the
    hips' way; slide of feet while the true ones do not move, cm/s.
    """
    count = min(len(dance), len(true))
    roles = true.skeleton.roles
    poses, truth = (
        one.skeleton.forward_kinematics(one.poses[:count], one.roots[:count])[1] for one in (dance, true)
    )
    found = {}
    for group, names in GROUPS.items():
        joints = [roles[name] for name in names if name in roles]
        apart = quaternion.angle_between(poses[:, joints], truth[:, joints])
        found[group] = float(np.degrees(apart).mean())
    named = [roles[role] for role in ROLES if role in roles]
    ours, theirs = (
        one.skeleton.forward_kinematics(one.poses[:count], one.roots[:count])[0][:, named]
        for one in (dance, true)
    )
    from_hips = np.linalg.norm((ours - ours[:, :1]) - (theirs - theirs[:, :1]), axis=-1)
    found["joints, cm"] = 100 * float(from_hips.mean())
    for axis, words in ((0, "way sideways, cm"), (2, "way in depth, cm")):
        apart = (dance.roots - true.roots[0])[:count, axis] - (true.roots - true.roots[0])[:count, axis]
        found[words] = 100 * float(np.abs(apart - np.median(apart)).mean())
    found["slide, cm/s"] = _slide(dance, true, count)
    return found


def _slide(dance: Recording, true: Recording, count: int) -> float:
    """Speed of the points of the soles while the true ones stand."""
    soles, stands = (
        sole_positions(one.skeleton, one.poses[:count], one.roots[:count]) for one in (dance, true)
    )
    speed = np.linalg.norm(np.diff(stands[..., [0, 2]], axis=0), axis=-1) * true.fps
    low = stands[1:, :, 1] < np.percentile(stands[..., 1], 5, axis=0) + LOW_M
    moved = np.linalg.norm(np.diff(soles[..., [0, 2]], axis=0), axis=-1) * dance.fps
    return 100 * float(moved[(speed < PLANTED_M_S) & low].mean())


def still(true: Recording, pose: Array) -> Recording:
    """A null product: one pose throughout."""
    poses = np.tile(pose, (len(true), 1, 1))
    roots = np.tile(np.array([0.0, true.roots[:, 1].mean(), 0.0]), (len(true), 1))
    return Recording(true.skeleton, poses, roots, true.fps)


def mean_pose(true: Recording) -> Array:
    """(J, 4): the mean of the dance itself, which no product could know."""
    signs = np.sign((true.poses * true.poses[:1]).sum(axis=-1, keepdims=True))
    return quaternion.normalize((true.poses * signs).mean(axis=0))


def compared(true: Recording, camera: Camera, seed: int) -> Mapping[str, Mapping[str, float]]:
    """The losses of the dance from landmarks, and of the null products, by their names."""
    here, figure = Path("landmarks"), true.skeleton
    found = {}
    for name, flat in (("world landmarks", False), ("picture (2D)", True)):
        read = seen_by(camera, true, np.random.default_rng(seed), flat)
        found[name] = losses(dance_of(here, read, figure).recording, true)
        if not flat:
            found["not repaired"] = losses(dance_of(here, read, figure, repairs=False).recording, true)
    found["mean pose"] = losses(still(true, mean_pose(true)), true)
    found["T-pose"] = losses(still(true, figure.standing), true)
    return found


def main() -> None:
    """Print the table of all recordings' means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--noise", type=float, default=Camera().noise_m, help="metres (0.015)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each recording (20)")
    parser.add_argument("--true-fps", type=float)
    given = parser.parse_args()
    rows = []
    for seed, file in enumerate(given.recordings):
        options = ReadingOptions(true_fps={"*": given.true_fps} if given.true_fps else {})
        true = read_upright(file, options)[0].resampled(50.0).excerpt(1.0, 1.0 + given.seconds)
        rows.append(compared(true, Camera(noise_m=given.noise), seed))
    names = list(rows[0])
    print(f"{'':18}" + "".join(f"{name:>17}" for name in names))
    for figure in rows[0][names[0]]:
        means = [np.mean([row[name][figure] for row in rows]) for name in names]
        print(f"{figure:18}" + "".join(f"{mean:17.1f}" for mean in means))


if __name__ == "__main__":
    main()
