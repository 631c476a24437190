"""Pace: speed, smoothness, trembling and stillness of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.studio.data.jumps import runs

SLOW_SHARE = 0.25  # fraction of the recordings' mean pace: a slower dancer is still
TREMBLING_HZ = 8.0  # hardly any of a dancer's motion is faster than this
SMOOTHING_S = 0.5


@dataclass(frozen=True)
class Pace:
    """How a motion moves. Speeds are those of all moving joints, degrees a second, only their own turns."""

    speed: float
    speed_p99: float
    jerk_p50: float  # degrees / s^3
    jerk_p99: float
    trembling: float  # share of the turning's power above 8 Hz
    root_jerk_p99: float  # m / s^3
    longest_still_s: float  # slower than a quarter of the recordings' mean pace


def pace(recording: Recording, moving: Sequence[int], usual_speed: float, cyclic: bool = False) -> Pace:
    """How the recording moves; usual_speed: mean joint speed, degrees a second, the measure of stillness.

    cyclic: the last frame leads into the first.
    """
    fps = recording.fps
    turning = joint_turning(recording, moving, cyclic)
    speeds = np.linalg.norm(turning, axis=-1)
    roots = np.concatenate([recording.roots, recording.roots[:3]]) if cyclic else recording.roots
    jerk = np.linalg.norm(np.diff(turning, n=2, axis=0), axis=-1) * fps**2
    root_jerk = np.linalg.norm(np.diff(roots, n=3, axis=0), axis=-1) * fps**3
    power = np.abs(np.fft.rfft(turning * np.hanning(len(turning))[:, None, None], axis=0)) ** 2
    fast = np.fft.rfftfreq(len(turning), 1 / fps) > TREMBLING_HZ
    width = max(1, min(round(SMOOTHING_S * fps), len(turning)))
    smooth = np.convolve(speeds.mean(axis=1), np.ones(width) / width, mode="valid")
    still = runs(smooth < SLOW_SHARE * usual_speed)
    return Pace(
        speed=float(speeds.mean()),
        speed_p99=float(np.percentile(speeds, 99)),
        jerk_p50=float(np.percentile(jerk, 50)),
        jerk_p99=float(np.percentile(jerk, 99)),
        trembling=float(power[fast].sum() / power.sum()),
        root_jerk_p99=float(np.percentile(root_jerk, 99)),
        longest_still_s=max((end - first for first, end in still), default=0) / fps,
    )


def joint_turning(recording: Recording, moving: Sequence[int], cyclic: bool = False) -> Array:
    """Angular velocity (N - 1, M, 3), or (N, M, 3) of a cycle, of each moving joint in degrees a second."""
    poses = recording.poses[:, list(moving)]
    following = np.roll(poses, -1, axis=0) if cyclic else poses[1:]
    earlier = poses if cyclic else poses[:-1]
    axis, angle = quaternion.to_axis_angle(quaternion.multiply(quaternion.inverse(earlier), following))
    return np.degrees(axis * angle[..., None]) * recording.fps


def mean_pace(paces: Sequence[Pace], weights: Sequence[int]) -> Pace:
    """Weighted means; of the stillness, the maximum."""
    rows = {name: [asdict(one)[name] for one in paces] for name in asdict(paces[0])}
    means = {name: float(np.average(values, weights=weights)) for name, values in rows.items()}
    return Pace(**{**means, "longest_still_s": max(rows["longest_still_s"])})


def mean_speed(parts: Sequence[Recording], moving: Sequence[int]) -> float:
    """Mean speed of all moving joints in all recordings, degrees a second."""
    return float(
        np.concatenate([np.linalg.norm(joint_turning(p, moving), axis=-1).mean(1) for p in parts]).mean()
    )
