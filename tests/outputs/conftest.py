"""A dancer to send, small and in poses that no symmetry hides a fault in; a stage that shares its frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from tests.outputs.small_stage import facts_of, one_puppet, stand

# (joint, parent, offset in metres); lButtock, rButtock and tail have no Unity name.
JOINTS = [
    ("hip", None, (0.0, 0.0, 0.0)),
    ("abdomen", "hip", (0.0, 0.21, -0.01)),
    ("chest", "abdomen", (0.0, 0.12, -0.005)),
    ("neck", "chest", (0.0, 0.22, -0.02)),
    ("head", "neck", (-0.002, 0.07, 0.012)),
    ("lCollar", "chest", (0.03, 0.19, -0.05)),
    ("lShldr", "lCollar", (0.09, -0.02, 0.015)),
    ("lForeArm", "lShldr", (0.28, -0.017, 0.005)),
    ("lHand", "lForeArm", (0.23, 0.008, 0.07)),
    ("lIndex1", "lHand", (0.08, 0.01, 0.056)),
    ("rCollar", "chest", (-0.03, 0.19, -0.05)),
    ("rShldr", "rCollar", (-0.09, -0.02, 0.015)),
    ("rForeArm", "rShldr", (-0.28, -0.017, 0.005)),
    ("rHand", "rForeArm", (-0.23, 0.008, 0.07)),
    ("lButtock", "hip", (0.09, 0.04, 0.012)),
    ("lThigh", "lButtock", (0.0, -0.02, -0.02)),
    ("lShin", "lThigh", (0.0, -0.37, 0.007)),
    ("lFoot", "lShin", (-0.007, -0.45, -0.05)),
    ("rButtock", "hip", (-0.09, 0.04, 0.012)),
    ("rThigh", "rButtock", (0.0, -0.02, -0.02)),
    ("rShin", "rThigh", (0.0, -0.37, 0.007)),
    ("rFoot", "rShin", (0.007, -0.45, -0.05)),
    ("tail", "hip", (0.0, 0.0, -0.1)),
]


@pytest.fixture(scope="session")
def skeleton() -> Skeleton:
    names = tuple(name for name, _, _ in JOINTS)
    parents = tuple(-1 if parent is None else names.index(parent) for _, parent, _ in JOINTS)
    return Skeleton(names, parents, np.array([offset for _, _, offset in JOINTS]))


def fill(frame: JointFrame, skeleton: Skeleton, seed: int) -> JointFrame:
    """A random pose somewhere on the stage."""
    random = np.random.default_rng(seed)
    pose = random.normal(size=(len(skeleton), 4)).astype(np.float32)
    puppet = frame.puppets[0]
    puppet.pose[:] = pose / np.linalg.norm(pose, axis=-1, keepdims=True)
    puppet.root[:] = random.uniform(-3, 3, 3)
    stand(frame, skeleton)
    puppet.holds[:] = random.uniform(0, 1, len(skeleton))
    frame.tick, frame.frame_time = seed, 1000.0 + 0.02 * seed
    return frame


@pytest.fixture
def frame(skeleton: Skeleton) -> JointFrame:
    return fill(one_puppet(len(skeleton)), skeleton, seed=1)


@pytest.fixture
def reader(tmp_path: Path) -> Iterator[FrameReader]:
    reader = FrameReader(tmp_path)
    yield reader
    reader.close()


@pytest.fixture
def writer(tmp_path: Path, skeleton: Skeleton) -> Iterator[FrameWriter]:
    writer = FrameWriter(tmp_path, facts_of(skeleton))
    yield writer
    writer.close()


def write(writer: FrameWriter, skeleton: Skeleton, *ticks: int) -> None:
    frame = one_puppet(len(skeleton))
    for tick in ticks:
        writer.write(fill(frame, skeleton, tick))
