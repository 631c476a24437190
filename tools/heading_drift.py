"""Measures how far headings drift in an evening: `python -m tools.heading_drift RECORDINGS [JOINT]`.

RECORDINGS: a folder with recordings of one skeleton (CMU's salsa, Indian dance and martial arts, named
`salsa_NN.bvh` and so on, in it or below). The arm of held-out takes wears an emulated sensor for two hours of
virtual time. Its drift starts at 60 % of the named rate, warms up over a quarter of an hour, and walks. The
habit comes from other takes of the same dancer.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.quaternion import Array
from appliance.pose.recording import Recording
from appliance.sensor.heading_drift import MOST_RATE, SAMPLE_S, HeadingDrift
from appliance.sensor.heading_habit import HeadingHabit, habit_in
from appliance.sensor.neutral import NeutralPose, Stillness

TRUE_FPS = {"salsa": 60.0}  # CMU's salsa says 120 (cgspeed's conversion)
AT_NEUTRAL = (0.766, 0.0, 0.0, -0.643)  # the left arm hangs
HOURS = 2.0
RATES = (0.0, 0.5, 1.0, 3.0)  # degrees a minute
SEEDS = 2
PAUSE_EVERY_S, PAUSE_S = 300.0, 10.0
FACES_FRONT, FRONT_WITHIN = 0.75, 7.0  # share of the pauses, standard deviation in degrees
TABLE_S = 70.0


@dataclass(frozen=True)
class Evening:
    """arm (N, 4): world orientations every SAMPLE_S, front +z. begins: the sample of the neutral pose."""

    arm: Array
    begins: int = 0


@dataclass(frozen=True)
class Dancer:
    """Held-out takes, each (N, 4) at 1 / SAMPLE_S, and the habit that other takes of the dancer tell."""

    name: str
    takes: list[Array]
    habit: HeadingHabit


def dancers(folder: Path, joint: str) -> Iterator[Dancer]:
    """Both salsa dancers, whose partners turn them all the time, and those that face the front."""
    files = sorted(folder.rglob("*.bvh"))
    salsa = [file for file in files if file.stem.startswith("salsa")]
    first, second = [[f for f in salsa if (int(f.stem[-2:]) > 15) is later] for later in (False, True)]
    groups = {"salsa, dancer A": first, "salsa, dancer B": second}
    groups["Indian dance"] = [file for file in files if file.stem.startswith("indian")]
    groups["martial arts"] = [file for file in files if file.parent.name == "martial"]
    for name, group in groups.items():
        takes, others = group[::2], group[1::2]
        learned = [read_take(file) for file in others]
        number = learned[0].skeleton.index(joint)
        phrases = [(one.poses, one.fps) for one in learned]
        habit = habit_in(phrases, learned[0].skeleton, number, AT_NEUTRAL)
        yield Dancer(name, [arm_in(read_take(file), joint) for file in takes], habit)


def read_take(file: Path) -> Recording:
    """A take without its T-pose, at its true rate."""
    take = read_bvh(file, true_fps=TRUE_FPS.get(file.stem.partition("_")[0], 120.0)).without_first(3)
    return take.resampled(1.0 / SAMPLE_S)


def arm_in(take: Recording, joint: str) -> Array:
    """The joint's world orientations. Front: where the hip faces at first, in quarter turns of the room."""
    world: Array = take.poses[:, 0].astype(np.float64)
    facing = quaternion.heading(world[:5].mean(axis=0))
    quarters = round(2.0 * math.atan2(facing[2], facing[0]) / (math.pi / 2))
    for link in reversed(take.skeleton.ancestors(take.skeleton.index(joint))[:-1]):
        world = quaternion.multiply(world, take.poses[:, link].astype(np.float64))
    return quaternion.multiply(about_vertical(np.array(-90.0 * quarters)), world)


def evening(dancer: Dancer, seed: int, pauses: bool, table: bool) -> Evening:
    """Two hours of takes in any order. pauses: every 5 minutes the dancer stands for 10 s, mostly facing the
    front; table: before the neutral pose the sensor lies on a table.
    """
    rng = np.random.default_rng(seed)
    total, danced_s = round(3600 * HOURS / SAMPLE_S), 0.0
    parts: list[Array] = []
    while sum(len(part) for part in parts) < total:
        take = dancer.takes[rng.integers(len(dancer.takes))]
        parts.append(take)
        danced_s += len(take) * SAMPLE_S
        if pauses and danced_s >= PAUSE_EVERY_S:
            danced_s = 0.0
            faces_front = rng.random() < FACES_FRONT
            facing = rng.normal(0.0, FRONT_WITHIN) if faces_front else rng.uniform(-180.0, 180.0)
            parts.append(standing(facing, round(PAUSE_S / SAMPLE_S), rng))
    arm = np.concatenate(parts)[:total]
    if table:
        still = round(TABLE_S / SAMPLE_S)
        noise = about_vertical(rng.normal(0.0, 0.1, still))
        lying = quaternion.multiply(
            noise, quaternion.from_axis_angle(np.array([1.0, 0.3, 0.2]), np.array(1.1))
        )
        return Evening(np.concatenate([lying, standing(0.0, 10, rng), arm]), still)
    return Evening(arm)


def standing(facing: float, samples: int, rng: np.random.Generator) -> Array:
    """An arm that hangs, nearly still: it sways by half a degree."""
    sway = 0.5 * np.sin(np.arange(samples) * SAMPLE_S * 2.0)
    swing = np.array(math.radians(rng.normal(0.0, 3.0)))
    hangs = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), swing)
    hangs = quaternion.multiply(hangs, np.array(AT_NEUTRAL))
    return quaternion.multiply(about_vertical(facing + sway), hangs)


def drift(samples: int, rate: float, seed: int) -> Array:
    """(N,) degrees; rate: degrees a minute, in one direction or the other."""
    rng = np.random.default_rng(1000 + seed)
    at_s = np.arange(samples) * SAMPLE_S
    walk, keep, value = np.empty(samples), math.exp(-SAMPLE_S / 1200.0), rng.normal()
    for sample in range(samples):
        value = keep * value + math.sqrt(1.0 - keep * keep) * rng.normal()
        walk[sample] = value
    rates = rate * (0.6 + 0.4 * (1.0 - np.exp(-at_s / 900.0)) + 0.2 * walk)
    degrees: Array = np.cumsum(rates) * SAMPLE_S / 60.0 * rng.choice([-1.0, 1.0])
    return degrees


def about_vertical(degrees: Array | float) -> Array:
    half = np.radians(np.asarray(degrees, np.float64)) / 2.0
    return np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=-1)


def estimated(night: Evening, drifted: Array, estimator: HeadingDrift) -> Array:
    """(N,) degrees that the joint's heading is off, from the neutral pose on."""
    read, at_neutral = readings(night, drifted), np.array(AT_NEUTRAL)
    joints = quaternion.multiply(read, at_neutral)
    still, pose, off = Stillness(), NeutralPose((1.0, 0.0, 0.0, 0.0), 0.0, 1), np.zeros(len(read))
    for sample, ((w, y, z, x), joint) in enumerate(zip(read.tolist(), joints.tolist(), strict=True)):
        now, reading = sample * SAMPLE_S * (1 + 1e-9), (w, x, y, z)  # sensor axes: z up, x to the front
        if sample == night.begins:
            pose = replace(pose, heading=math.radians(float(drifted[sample])))
            estimator.take_neutral()
        still.add_reading(reading, now)
        in_force = pose if sample >= night.begins else None
        step = estimator.look(reading, turned_back(joint, pose.heading), in_force, still.still_s, now)
        pose = replace(pose, heading=pose.heading + math.radians(step))
        off[sample] = drifted[sample] - math.degrees(pose.heading)
    return off[night.begins :]


def uncorrected(night: Evening, drifted: Array) -> Array:
    """The laziest thing: nothing."""
    off: Array = drifted[night.begins :] - drifted[night.begins]
    return off


def mean_stays_zero(night: Evening, drifted: Array) -> Array:
    """The next laziest: the mean heading of ten minutes stays at zero, corrected at the same pace."""
    read = readings(night, drifted)[night.begins :]
    taken, mean, off = math.radians(float(drifted[night.begins])), 0j, np.zeros(len(read))
    for sample, heading in enumerate((2.0 * np.arctan2(read[:, 2], read[:, 0])).tolist()):
        left = heading - taken
        mean += (complex(math.cos(left), math.sin(left)) - mean) * SAMPLE_S / 600.0
        step = math.degrees(math.atan2(mean.imag, mean.real)) / 60.0 * SAMPLE_S
        taken += math.radians(min(max(step, -MOST_RATE * SAMPLE_S), MOST_RATE * SAMPLE_S))
        off[sample] = drifted[night.begins + sample] - math.degrees(taken)
    return off


def stillness(night: Evening, drifted: Array) -> Array:
    """The box without any habit: a sensor that lies, a dancer that stands."""
    return estimated(night, drifted, HeadingDrift())


def readings(night: Evening, drifted: Array) -> Array:
    """(N, 4): turns from the neutral pose as the sensor reads them, stage axes."""
    turned = quaternion.multiply(night.arm, quaternion.inverse(np.array(AT_NEUTRAL)))
    return quaternion.multiply(about_vertical(drifted), turned)


def turned_back(rotation: Sequence[float], heading: float) -> tuple[float, float, float, float]:
    """A rotation (w, x, y, z), turned back about the vertical by radians."""
    cosine, sine = math.cos(heading / 2.0), -math.sin(heading / 2.0)
    w, x, y, z = rotation
    return cosine * w - sine * y, cosine * x + sine * z, cosine * y + sine * w, cosine * z - sine * x


def row(name: str, dancer: Dancer, pauses: bool, table: bool) -> str:
    """95th percentiles of the error: a cell for each estimator, a number for each rate."""
    estimators: tuple[Callable[[Evening, Array], Array], ...] = (
        uncorrected,
        mean_stays_zero,
        stillness,
        lambda night, drifted: estimated(night, drifted, HeadingDrift(dancer.habit, AT_NEUTRAL)),
    )
    nights = [evening(dancer, seed, pauses, table) for seed in range(SEEDS)]
    cells = []
    for errors in estimators:
        of_rates = []
        if errors is stillness and not (pauses or table):
            cells.append("as uncorrected")
            continue
        for rate in RATES:
            found = [errors(night, drift(len(night.arm), rate, seed)) for seed, night in enumerate(nights)]
            of_rates.append(f"{np.percentile(np.abs(np.concatenate(found)), 95):.0f}")
        cells.append(" / ".join(of_rates))
    return f"| {name} | " + " | ".join(cells) + " |"


def print_table(folder: Path, joint: str) -> None:
    """The table of docs/notebook.md."""
    print(f"95th percentile of the heading's error, degrees; drift {' / '.join(map(str, RATES))} a minute.\n")
    print("| dancer and evening | uncorrected | mean stays zero | stillness | the box |")
    print("|---|---|---|---|---|")
    for dancer in dancers(folder, joint):
        for text, pauses, table in (
            ("dances on", False, False),
            ("pauses", True, False),
            ("pauses, on a table before", True, True),
        ):
            print(row(f"{dancer.name}; {text}", dancer, pauses, table), flush=True)


if __name__ == "__main__":
    print_table(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "lShldr")
