"""A small skeleton with the CMU dancers' joint names, a swaying recording, and shows made of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import write_checksums
from appliance.studio.autoencoder.architectures import build
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.export import packing
from appliance.studio.export.export import export

_BONES = [
    ("hip", "", (0, 0, 0)),
    ("abdomen", "hip", (0, 0.2, 0)),
    ("chest", "abdomen", (0, 0.15, 0)),
    ("neck", "chest", (0, 0.2, 0)),
    ("head", "neck", (0, 0.08, 0)),
    ("rCollar", "chest", (-0.03, 0.18, 0)),
    ("rShldr", "rCollar", (-0.1, 0, 0)),
    ("rForeArm", "rShldr", (-0.28, 0, 0)),
    ("rHand", "rForeArm", (-0.23, 0, 0)),
    ("lCollar", "chest", (0.03, 0.18, 0)),
    ("lShldr", "lCollar", (0.1, 0, 0)),
    ("lForeArm", "lShldr", (0.28, 0, 0)),
    ("lHand", "lForeArm", (0.23, 0, 0)),
    ("rThigh", "hip", (-0.09, -0.02, 0)),
    ("rShin", "rThigh", (0, -0.37, 0)),
    ("rFoot", "rShin", (0, -0.4, 0)),
    ("lThigh", "hip", (0.09, -0.02, 0)),
    ("lShin", "lThigh", (0, -0.37, 0)),
    ("lFoot", "lShin", (0, -0.4, 0)),
    ("leftEye", "head", (0.03, 0.08, 0.08)),
]
STILL = ("rCollar", "lCollar", "leftEye")


def skeleton() -> Skeleton:
    """20 joints, 17 of them moving."""
    names = tuple(bone[0] for bone in _BONES)
    parents = tuple(names.index(bone[1]) if bone[1] else -1 for bone in _BONES)
    ends = tuple((names.index(n), (0.0, 0.0, 0.1)) for n in ("rHand", "lHand", "rFoot", "lFoot", "leftEye"))
    return Skeleton(names, parents, np.array([bone[2] for bone in _BONES], dtype=float), ends)


def moving() -> tuple[int, ...]:
    return tuple(j for j, name in enumerate(skeleton().names) if name not in STILL)


def swaying(seconds: float = 3.0, seed: int = 0, fps: float = 50.0) -> Recording:
    """Every moving joint swings smoothly about an axis of its own, the root turns a little."""
    bones = skeleton()
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * fps)) / fps
    poses = np.tile(np.array([1.0, 0, 0, 0]), (len(time), len(bones), 1))
    for joint in moving():
        axis = rng.normal(size=3)
        angle = rng.uniform(0.1, 0.5) * np.sin(2 * np.pi * time / 3 * rng.integers(1, 4) + rng.uniform(0, 6))
        poses[:, joint] = quaternion.from_axis_angle(axis, angle)
    roots = np.stack([0.1 * np.sin(2 * np.pi * time / 3), np.full(len(time), 0.8), 0 * time], axis=-1)
    return Recording(bones, quaternion.continuous(poses), roots, fps)


def write_recordings(folder: Path, count: int = 3, seconds: float = 4.0) -> Path:
    """A folder of small BVH recordings to train on."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        write_bvh(folder / f"sway_{number}.bvh", swaying(seconds, seed=number))
    return folder


def untrained(network: str = "mlp", width: int = 32, seed: int = 0) -> Autoencoder:
    """A network as small as its kind allows, its weights random so that nothing cancels."""
    torch.manual_seed(seed)
    built, shape = build(network, 8, len(moving()), width=width, latent=16)
    rest = torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(len(moving()), 1)
    built.start_at(rest.flatten())
    for layer in built.modules():
        if isinstance(layer, torch.nn.Linear) and not layer.weight.any():
            torch.nn.init.xavier_uniform_(layer.weight)
    return Autoencoder(built, shape, rest).eval()


def write_tiny_show(folder: Path) -> Path:
    """The bundle of the tiny_show fixture."""
    folder.mkdir(parents=True, exist_ok=True)
    phrase = swaying()
    names = [phrase.skeleton.names[j] for j in moving()]
    export(untrained(), names, folder / "puppet.onnx", int8=False, architecture="mlp")
    packing.write_skeleton(folder, phrase.skeleton, phrase.poses[0])
    packing.write_phrase(folder, phrase)
    packing.write_show_yaml(folder, "tiny", [{"sensor": "left-wrist", "joint": "lShldr"}])
    packing.write_surface(folder)
    write_checksums(folder)
    return folder


FLIP = quaternion.from_axis_angle([1.0, 0.0, 0.2], np.radians(170.0))


def turned(recording: Recording, joint: str, turns: np.ndarray, first: int = 0) -> Recording:
    """The recording with a joint turned besides, by turns (K, 4) from a frame on."""
    poses, place = recording.poses.copy(), recording.skeleton.index(joint)
    span = slice(first, first + len(turns))
    poses[span, place] = quaternion.multiply(turns, poses[span, place])
    return replace(recording, poses=quaternion.continuous(poses))


def flipped(recording: Recording, joint: str, start_s: float, end_s: float) -> Recording:
    """The recording with a joint upside down from `start_s` to `end_s`."""
    first, last = round(start_s * recording.fps), round(end_s * recording.fps)
    return turned(recording, joint, np.tile(FLIP, (last - first, 1)), first)


def upside_down(folder: Path) -> Path:
    """Three takes of 12 s; in one the head hangs upside down from 4 to 6 s, in another from 8 to 9 s."""
    folder.mkdir()
    for number, (start, end) in enumerate([(4, 6), (8, 9), (0, 0)]):
        dance = swaying(12.0, seed=number)
        write_bvh(folder / f"sway_{number}.bvh", flipped(dance, "head", start, end))
    return folder
