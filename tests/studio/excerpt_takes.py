"""Takes that are each one kind of excerpt from end to end, and trials on excerpts of them."""

from __future__ import annotations

import numpy as np

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import default_show_path
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.data.dataset import FPS, Take
from appliance.studio.evaluation.coders import Coder, Poses
from appliance.studio.experiments.excerpts import choose
from appliance.studio.experiments.families import Trial, usual_trace
from appliance.studio.experiments.null_networks import Paste

SECONDS = 12.0
ARMS = ("rShldr", "lShldr", "rForeArm", "lForeArm")
LEGS = ("rThigh", "lThigh", "rShin", "lShin")
TORSO = ("abdomen", "chest")
JOINTS = ("hip", *TORSO, "head", *ARMS, *LEGS)
JOINT = "lShldr"


def whole_skeleton() -> Skeleton:
    """The default show's."""
    return read_bvh(default_show_path() / "skeleton.bvh").skeleton


def take(skeleton: Skeleton, name: str, **swings: tuple[tuple[str, ...], float, float]) -> Take:
    """A body at rest whose joints swing: what it is called = (joints, degrees, cycles a second)."""
    count = round(SECONDS * FPS)
    time = np.arange(count) / FPS
    poses = np.tile(quaternion.IDENTITY.astype(float), (count, len(skeleton), 1))
    for joints, degrees, hertz in swings.values():
        angles = np.radians(degrees) * np.sin(2 * np.pi * hertz * time)
        for joint in joints:
            poses[:, skeleton.index(joint)] = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), angles)
    roots = np.tile([0.0, 1.0, 0.0], (count, 1))
    recording = Recording(skeleton, poses, roots, FPS)
    return Take(name, name, recording, np.ones(count, dtype=bool), FPS, FPS)


def five_takes(skeleton: Skeleton) -> list[Take]:
    """Each of them is one of the five kinds from end to end."""
    return [
        take(skeleton, "nothing", all=(JOINTS, 0.5, 0.2)),
        take(skeleton, "bending", torso=(TORSO, 30, 0.3), arms=(ARMS, 1, 0.3), legs=(LEGS, 1, 0.3)),
        take(skeleton, "apart", arms=(ARMS, 30, 0.35), legs=(LEGS, 30, 0.87)),
        take(skeleton, "in_step", arms=(ARMS, 30, 0.5), legs=(LEGS, 30, 0.5)),
        take(skeleton, "everything", all=(JOINTS, 40, 0.6), arms=(ARMS, 40, 0.75)),
    ]


def trials(
    takes: list[Take],
    coder: Coder,
    joints: tuple[str, ...] = (JOINT,),
    names: tuple[str, ...] = ("still", "coordinated", "torso"),
) -> list[Trial]:
    excerpts = choose(takes, JOINTS)
    trace = usual_trace(excerpts, takes[0].recording.skeleton.index(JOINT))
    return [Trial(coder, one, joints, trace) for one in excerpts if one.name in names]


class Pausing(Paste):
    """Rounds every angle to steps, above one pass."""

    def __init__(self) -> None:
        super().__init__(JOINTS, np.tile(quaternion.IDENTITY, (len(JOINTS), 1)))
        self.coding = 1

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[np.ndarray] | None = None,
    ) -> tuple[Poses, Poses]:
        self.coding = coding_iterations
        return super().iterate(windows, coding_iterations, interaction_iterations, hold)

    def code(self, level: Poses) -> Poses:
        if self.coding == 1:
            return level.copy()
        made = level.copy()
        made[..., 1] = np.round(made[..., 1] * 8) / 8
        return quaternion.normalize(made).astype(np.float32)
