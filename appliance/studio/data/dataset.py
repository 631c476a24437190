"""Training data: recordings to windows of poses, split by take, glitches masked, mirrored."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.bvh import leading_tpose_frames, read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

FPS = 50.0
WINDOW = 8
GLITCH_DEGREES = 25.0  # a larger step between two recorded frames is a capture error, not a dancer
EXTREMITY_DEGREES = 110.0  # head, hands and feet further than this from the mean pose: swapped markers
MOVING_DEGREES = 1.0  # joints that turn less than this in every recording are still
TPOSE_FRAMES = 3
CATALOGUES = Path(__file__).parent / "catalogues"


class DatasetError(ValueError):
    """Recordings that cannot be trained on; says which and why."""


@dataclass(frozen=True)
class Take:
    """One recording at 50 Hz with what is known of it."""

    name: str
    take: str
    recording: Recording
    sound: NDArray[np.bool_]  # (N,) frames that are no glitch
    header_fps: float
    true_fps: float


@dataclass(frozen=True)
class Catalogue:
    """What is known of recordings beyond their files: true frame rates, takes, what is held out."""

    true_fps: dict[str, float] = field(default_factory=dict)
    take: dict[str, str] = field(default_factory=dict)
    held_out: tuple[str, ...] = ()
    acknowledgement: str = ""  # whom to thank, in every show made of them

    def fps_of(self, name: str) -> float | None:
        return next((fps for pattern, fps in self.true_fps.items() if fnmatch.fnmatch(name, pattern)), None)

    def take_of(self, name: str) -> str:
        return self.take.get(name, name)


@dataclass(frozen=True)
class Dataset:
    """Takes with one skeleton; which joints move; which takes are kept apart."""

    skeleton: Skeleton
    moving: tuple[int, ...]
    training: tuple[Take, ...]
    held_out: tuple[Take, ...]

    @property
    def moving_names(self) -> tuple[str, ...]:
        return tuple(self.skeleton.names[j] for j in self.moving)

    def still_pose(self) -> NDArray[np.float64]:
        """(J, 4): the mean pose of the training takes, in which the still joints stand for good."""
        return mean_pose(self.training)


def load_dataset(
    folder: Path,
    catalogue: Catalogue | None = None,
    progress: Callable[[Sequence[Path]], Sequence[Path]] = lambda files: files,
) -> Dataset:
    """Read every BVH file of a folder. Raises DatasetError where skeletons differ or nothing is left."""
    files = sorted(folder.glob("*.bvh"))
    if not files:
        raise DatasetError(f"{folder} has no .bvh files. Give the folder that holds your recordings.")
    catalogue = catalogue or find_catalogue(folder, files)
    takes = [load_take(file, catalogue) for file in progress(files)]
    skeleton = takes[0].recording.skeleton
    for file, take in zip(files, takes, strict=True):
        if not take.recording.skeleton.same_joints(skeleton):
            raise DatasetError(
                f"{file.name} has another skeleton than {files[0].name}. Train one dancer on one skeleton: "
                "move the file to a folder of its own."
            )
    held = {take.take for take in takes if any(fnmatch.fnmatch(take.name, p) for p in catalogue.held_out)}
    if not held and len({take.take for take in takes}) > 1:
        held = {sorted({take.take for take in takes})[-1]}
    moving = moving_joints(takes)
    training = tuple(take for take in takes if take.take not in held)
    if not training:
        raise DatasetError("Every take is held out: nothing is left to train on.")
    usual = mean_pose(training)
    tips = extremities(skeleton, moving)
    for take in takes:
        take.sound[:] &= plausible(take.recording.poses[:, tips], usual[tips])
    return Dataset(skeleton, moving, training, tuple(take for take in takes if take.take in held))


def find_catalogue(folder: Path, files: Sequence[Path]) -> Catalogue:
    """catalogue.yaml beside the recordings, else one of the studio's whose file names and sizes all match."""
    own = folder / "catalogue.yaml"
    if own.exists():
        return read_catalogue(own)
    sizes = {file.stem: file.stat().st_size for file in files}
    for known in sorted(CATALOGUES.glob("*.yaml")):
        text = yaml.safe_load(known.read_text(encoding="utf-8"))
        if all(text["bytes"].get(name) == size for name, size in sizes.items()):
            return read_catalogue(known)
    return Catalogue()


def read_catalogue(path: Path) -> Catalogue:
    """Read a catalogue: true_fps (pattern: rate), takes (take: [names]), held_out (patterns),
    acknowledgement."""
    text = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    takes = {name: take for take, names in (text.get("takes") or {}).items() for name in names}
    rates = {str(pattern): float(fps) for pattern, fps in (text.get("true_fps") or {}).items()}
    thanks = str(text.get("acknowledgement") or "").strip()
    return Catalogue(rates, takes, tuple(text.get("held_out") or ()), thanks)


def load_take(file: Path, catalogue: Catalogue) -> Take:
    """One file at its true rate, T-pose dropped, glitches marked, resampled to 50 Hz."""
    header = read_bvh(file)
    fps = catalogue.fps_of(file.stem) or header.fps
    recording = Recording(header.skeleton, header.poses, header.roots, fps, header.translations)
    if leading_tpose_frames(recording):
        recording = recording.without_first(TPOSE_FRAMES)
    steps = np.degrees(quaternion.angle_between(recording.poses[1:], recording.poses[:-1])).max(axis=-1)
    resampled = recording.resampled(FPS)
    sound = np.ones(len(resampled), dtype=bool)
    for frame in np.flatnonzero(steps > GLITCH_DEGREES):
        at = frame * FPS / fps
        sound[max(int(np.floor(at)), 0) : int(np.ceil(at + FPS / fps)) + 1] = False
    return Take(file.stem, catalogue.take_of(file.stem), resampled, sound, header.fps, fps)


def mean_pose(takes: Sequence[Take]) -> NDArray[np.float64]:
    """(J, 4): mean of the sound poses, their heading removed."""
    poses = np.concatenate([take.recording.poses[take.sound] for take in takes])
    facing = quaternion.heading(poses[:, :1])
    poses = np.concatenate([quaternion.multiply(quaternion.inverse(facing), poses[:, :1]), poses[:, 1:]], 1)
    mean = quaternion.aligned(poses, poses[len(poses) // 2]).mean(axis=0)
    return quaternion.normalize(mean).astype(np.float64)


def extremities(skeleton: Skeleton, moving: Sequence[int]) -> list[int]:
    """Moving joints with no moving joint below them: head, hands, feet."""
    inner: set[int] = set()
    for joint in moving:
        while (joint := skeleton.parents[joint]) >= 0:
            inner.add(joint)
    return [joint for joint in moving if joint not in inner]


def plausible(tips: NDArray[np.floating], usual: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(N,): no extremity (N, E, 4) is further from its usual orientation (E, 4) than a body allows.

    No wrist, neck or ankle turns 110 degrees from its mean; where a recording says so, two markers were
    taken for each other (in the CMU dance takes: a head upside down for a whole take, hands, feet).
    """
    away = np.degrees(quaternion.angle_between(tips, usual))
    return np.asarray((away <= EXTREMITY_DEGREES).all(axis=-1))


def moving_joints(takes: Sequence[Take]) -> tuple[int, ...]:
    """Joints that turn more than a degree in any recording."""
    count = len(takes[0].recording.skeleton)
    widest = np.zeros(count)
    for take in takes:
        poses = take.recording.poses
        widest = np.maximum(widest, np.degrees(quaternion.angle_between(poses, poses[:1])).max(axis=0))
    return tuple(int(j) for j in np.flatnonzero(widest > MOVING_DEGREES))


def mirror_pairs(skeleton: Skeleton) -> NDArray[np.intp]:
    """(J,): for each joint its counterpart on the other side (itself for the spine)."""
    others = []
    for name in skeleton.names:
        swaps = [("Left", "Right"), ("Right", "Left"), ("left", "right"), ("right", "left")]
        swaps += [("l", "r"), ("r", "l"), ("L_", "R_"), ("R_", "L_")]
        names = [to + name[len(frm) :] for frm, to in swaps if name.startswith(frm)]
        names += [name[: -len(frm)] + to for frm, to in [("_l", "_r"), ("_r", "_l")] if name.endswith(frm)]
        found = [other for other in names if other in skeleton.names]
        others.append(skeleton.index(found[0]) if found else skeleton.index(name))
    return np.array(others)


def mirrored(recording: Recording) -> Recording:
    """The dance as a mirror shows it: left and right joints swapped, reflected through the x = 0 plane."""
    pairs = mirror_pairs(recording.skeleton)
    poses = recording.poses[:, pairs] * np.array([1.0, 1.0, -1.0, -1.0])
    return Recording(recording.skeleton, poses, recording.roots * np.array([-1.0, 1.0, 1.0]), recording.fps)


def window_starts(take: Take, hop: int = 1) -> NDArray[np.intp]:
    """First frames of every hop-th of a take's windows in which each pose is sound."""
    if len(take.sound) < WINDOW:
        return np.zeros(0, dtype=np.intp)
    whole = np.lib.stride_tricks.sliding_window_view(take.sound, WINDOW).all(axis=-1)
    return np.flatnonzero(whole)[::hop]


def windows(takes: Sequence[Take], moving: Sequence[int], mirror: bool = False) -> NDArray[np.float32]:
    """Every sound window of the takes, (N, 8, M, 4) float32, and after them their mirror images."""
    found = []
    for take in takes:
        recordings = [take.recording, mirrored(take.recording)] if mirror else [take.recording]
        starts = window_starts(take)
        for recording in recordings:
            poses = recording.poses[:, moving].astype(np.float32)
            found.append(poses[starts[:, None] + np.arange(WINDOW)])
    return np.concatenate(found) if found else np.zeros((0, WINDOW, len(moving), 4), dtype=np.float32)
