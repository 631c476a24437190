"""A prompt continued: the improviser goes on where a recording ends, or at a second of it, without a seam."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from appliance.dancer.loop import Placement, turns_about_y, yaws
from appliance.dancer.material.improvising import BEFORE, MOVE, Choreographer, improvised
from appliance.dancer.material.steps import HOP, Coder, Steps, danced_again, motion_of, steps_of
from appliance.pose import quaternion
from appliance.pose.ease import ease
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, WINDOW, Dataset
from appliance.studio.standing_dance import standing
from appliance.studio.studio_error import StudioError

PRIMER = 35  # steps of a recording that the improviser continues: 2.8 s
STEPS_S = FPS / HOP
KNOWN = 5  # the prompt's last steps, decoded again by this network so that the motion can be faded over
AROUND_S = 0.3  # on either side of the join, where a seam would show


@dataclass(frozen=True)
class Continuation:
    """dance: the prompt and what follows; joined_s: where that begins; seam: the largest step of a joint from
    tick to tick around there; usual: the 99th percentile of the prompt's largest steps; both in degrees.
    """

    dance: Recording
    joined_s: float
    seam: float
    usual: float


class Follower(Protocol):
    """An improviser: ours (MovesFollower) or the published one (pose_mixtures.PoseImproviser)."""

    def follow(
        self, prompt: Recording, dataset: Dataset, seconds: float, temperature: float, seed: int
    ) -> tuple[Recording, int, int]:
        """Motion at 50 Hz, the frame of the prompt that it begins with, and how many of its frames are faded
        over into it: the prompt's own, danced again.
        """


@dataclass(frozen=True)
class MovesFollower:
    """Ours: goes on in the latents of its autoencoder, move by move."""

    coder: Coder
    networks: Choreographer

    def follow(
        self, prompt: Recording, dataset: Dataset, seconds: float, temperature: float, seed: int
    ) -> tuple[Recording, int, int]:
        """See Follower. Raises StudioError for a prompt that is too short."""
        coder, moving = self.coder, list(dataset.moving)
        steps = steps_of(coder, prompt, moving)
        if len(steps) < BEFORE + MOVE:
            least = HOP * (BEFORE + MOVE + 1) + WINDOW
            raise StudioError(
                f"The prompt has {len(prompt) / FPS:.1f} s; the improviser continues from {least / FPS:.1f} "
                "s or more. Give a longer one, or a later --from."
            )
        primer = np.asarray(steps.features[-PRIMER:], np.float32)[None]
        moves = math.ceil(seconds * STEPS_S / MOVE)
        danced = improvised(self.networks, primer, moves, temperature, seed)[0]
        together = Steps.of_features(np.concatenate([steps.features[-KNOWN:], danced]))
        poses, roots = motion_of(coder, together, prompt.poses[-1], moving)
        poses = danced_again(coder, poses, moving)
        first = HOP * (len(steps) - KNOWN + 1) + WINDOW // 2
        return Recording(prompt.skeleton, poses, roots, FPS), first, (KNOWN - 1) * HOP


def continued(
    follower: Follower,
    dataset: Dataset,
    prompt: Recording,
    seconds: float,
    temperature: float,
    seed: int,
    is_quick: bool = False,
) -> Continuation:
    """prompt: at 50 Hz, its floor at height 0; is_quick: see standing.

    Raises StudioError where the prompt is too short.
    """
    moving = list(dataset.moving)
    motion, first, fade = follower.follow(prompt, dataset, seconds, temperature, seed)
    made = _placed(motion, prompt, first)
    count = min(first + len(made), first + fade + round(seconds * FPS))
    whole = _joined(prompt, made, first, fade, count)
    planted = standing(whole.poses[:, moving].astype(np.float32), whole, dataset, is_quick=is_quick)
    dance = _joined(whole, _placed(_from(planted, first), whole, first), first, fade, count)
    return Continuation(dance, (first + fade) / FPS, *_seam(dance, prompt, first, fade, moving))


def _placed(made: Recording, prompt: Recording, first: int) -> Recording:
    """Turned and moved to the prompt's place at that frame."""
    old, new = (
        (roots[0], roots[2], float(yaws(quaternion.heading(pose[0]))))
        for roots, pose in ((made.roots[0], made.poses[0]), (prompt.roots[first], prompt.poses[first]))
    )
    placement = Placement.bringing(old, new)
    poses, roots = made.poses.copy(), made.roots.copy()
    turn = np.broadcast_to(turns_about_y(np.array(placement.yaw)), poses[:, 0].shape)
    poses[:, 0] = quaternion.multiply(turn, poses[:, 0])
    roots[:, 0], roots[:, 2] = placement.point(roots[:, 0].copy(), roots[:, 2].copy())
    return replace(made, poses=poses, roots=roots)


def _joined(before: Recording, made: Recording, first: int, fade: int, count: int) -> Recording:
    """`before` up to a frame, then faded over into what was made from that frame on."""
    share = ease((np.arange(fade) + 0.5) / fade)
    over = slice(first, first + fade)
    poses = np.concatenate(
        [
            before.poses[:first],
            quaternion.slerp(before.poses[over], made.poses[:fade], share[:, None]),
            made.poses[fade : count - first],
        ]
    )
    roots = np.concatenate(
        [
            before.roots[:first],
            before.roots[over] + share[:, None] * (made.roots[:fade] - before.roots[over]),
            made.roots[fade : count - first],
        ]
    )
    return Recording(before.skeleton, quaternion.continuous(poses), roots, FPS)


def _from(recording: Recording, first: int) -> Recording:
    return replace(recording, poses=recording.poses[first:], roots=recording.roots[first:])


def _seam(
    dance: Recording, prompt: Recording, first: int, fade: int, moving: list[int]
) -> tuple[float, float]:
    def largest(poses: Array) -> Array:
        turns = quaternion.angle_between(poses[1:, moving], poses[:-1, moving])
        steps: Array = np.degrees(turns).max(axis=1)
        return steps

    around = round(AROUND_S * FPS)
    seam = largest(dance.poses[max(0, first - around) : first + fade + around])
    return float(seam.max()), float(np.percentile(largest(prompt.poses), 99))
