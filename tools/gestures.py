"""Measures the gesture recogniser: `python -m tools.gestures RECORDINGS`.

RECORDINGS: as for tools.heading_drift. Gestures: eight made ones (circles, waves, a salute), and excerpts of
a dancer's wrist. Each is learned from three repetitions; background: every third of the takes. Then it is
made again, in held-out dance: at 0.8 to 1.25 of the speed and 0.8 to 1.2 of the size, with noise of 3
degrees, held otherwise by up to 12 degrees, or as another dancer's hand moves meanwhile. False alarms are
counted in the other takes of both wrists. Null products: the same number of alarms at random
times, and an alarm wherever the hand turns as fast as in the gesture.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.quaternion import Array
from appliance.sensor.gestures import AGAIN_S, RATE_HZ, Gesture, TurningPoint, learned, nearest
from tools.heading_drift import TRUE_FPS

WRISTS = ("lHand", "rHand")
REPEATS, EXCERPTS = 12, 12
TILT, NOISE = 12.0, 3.0  # degrees
NEAR_S = 0.6  # after the end of a gesture, by which it counts as found
JOIN = 8  # orientations from dance into a gesture and back


def wrists(file: Path) -> Iterator[Array]:
    """World orientations (N, 4) of both wrists at RATE_HZ; none where the skeleton has other joints."""
    take = read_bvh(file, true_fps=TRUE_FPS.get(file.stem.partition("_")[0], 120.0)).without_first(3)
    take = take.resampled(RATE_HZ)
    _, world = take.skeleton.forward_kinematics(take.poses, take.roots)
    for name in WRISTS:
        if name in take.skeleton.names:
            yield quaternion.continuous(world[:, take.skeleton.index(name)].copy())


def made_gestures() -> dict[str, Array]:
    """Deliberate gestures as orientations from the identity, at RATE_HZ."""
    t = np.linspace(0.0, 1.0, 33)[:, None]
    wave, rise = np.sin(2 * np.pi * t), np.sin(np.pi * t)
    x, y, z = np.eye(3)
    turns = {
        "circle": 0.7 * (wave * x + (np.cos(2 * np.pi * t) - 1) * y),
        "circle back": 0.7 * (-wave * x + (np.cos(2 * np.pi * t) - 1) * y),
        "eight": 0.8 * (wave * y + np.sin(4 * np.pi * t) * x),
        "wave": 0.8 * np.sin(6 * np.pi * t) * z,
        "salute": 1.8 * rise * x + 0.6 * rise * z,
        "key": 1.6 * wave * z,
        "saw": 0.9 * np.sin(4 * np.pi * t) * x,
        "draw": 1.2 * rise**2 * y + 0.9 * np.sin(3 * np.pi * t) * x,
    }
    return {name: from_rotations(turned) for name, turned in turns.items()}


def from_rotations(turned: Array) -> Array:
    """Rotation vectors (N, 3) as orientations (N, 4)."""
    angle = np.linalg.norm(turned, axis=-1)
    axis = np.where(angle[:, None] > 1e-9, turned, [1.0, 0.0, 0.0])
    return quaternion.from_axis_angle(axis, angle)


def repeated(gesture: Array, rng: np.random.Generator, speed: float, size: float) -> Array:
    """The gesture (N, 4) made again: otherwise timed, sized and held, with a hand's noise."""
    relative = quaternion.multiply(quaternion.inverse(gesture[:1]), gesture)
    relative = quaternion.continuous(relative)
    sine = np.linalg.norm(relative[:, 1:], axis=1)
    axes = np.where(sine[:, None] > 1e-9, relative[:, 1:], [1.0, 0.0, 0.0])
    relative = quaternion.from_axis_angle(axes, size * 2.0 * np.arctan2(sine, relative[:, 0]))
    count = max(8, round(len(gesture) / speed))
    t = np.linspace(0.0, 1.0, count)
    at = (len(gesture) - 1) * np.clip(t + rng.uniform(-0.04, 0.04) * np.sin(2 * np.pi * t), 0.0, 1.0)
    before = np.minimum(at.astype(int), len(gesture) - 2)
    relative = quaternion.slerp(relative[before], relative[before + 1], at - before)
    noise = rng.standard_normal((count + 12, 3))
    noise = np.stack([np.convolve(one, np.hanning(14)[1:-1], "same") for one in noise.T], 1)[6:-6]
    noise *= np.radians(NOISE) / np.sqrt((noise**2).sum(axis=1).mean())
    held = from_rotations(np.radians(TILT) * rng.uniform(-1, 1, (1, 3)) / np.sqrt(3))
    start = quaternion.multiply(gesture[:1], held)
    return quaternion.multiply(start, quaternion.multiply(relative, from_rotations(noise)))


def in_dance(gesture: Array, dance: Array, at: int, rng: np.random.Generator) -> tuple[Array, int]:
    """A stretch of dance with the gesture in it, and where that ends. The hand goes there from the dance and
    back within JOIN orientations; the dancer faces anywhere.
    """
    yaw = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), rng.uniform(-np.pi, np.pi))
    made = quaternion.multiply(yaw, gesture)
    share = np.arange(1, JOIN + 1) / (JOIN + 1)
    into = quaternion.slerp(np.repeat(dance[at : at + 1], JOIN, 0), np.repeat(made[:1], JOIN, 0), share)
    out = quaternion.slerp(np.repeat(made[-1:], JOIN, 0), np.repeat(dance[at : at + 1], JOIN, 0), share)
    whole = np.concatenate([dance[at - 100 : at], into, made, out, dance[at : at + 50]])
    return quaternion.continuous(whole), 100 + JOIN + len(made)


def alarms(gesture: Gesture, near: Array) -> list[int]:
    """Where the recogniser finds the gesture in a stream that came as near as this (N,)."""
    turning = TurningPoint()
    return [
        place
        for place in np.flatnonzero(np.isfinite(near)).tolist()
        if turning.reached(float(near[place]) / gesture.within, gesture, place / RATE_HZ) is not None
    ]


def energetic(gesture: Gesture, stream: Array) -> list[int]:
    """The null product: alarms wherever the hand turns as much as in the gesture."""
    count = gesture.lengths[len(gesture.lengths) // 2]
    turned = [quaternion.angle_between(take[1:], take[:-1]).sum() for take in gesture.takes]
    steps = np.concatenate([[0.0], quaternion.angle_between(stream[1:], stream[:-1])])
    sums = np.convolve(steps, np.ones(count), "full")[: len(stream)]
    hits = np.flatnonzero((sums > 0.8 * min(turned)) & (sums < 1.25 * max(turned)))
    found: list[int] = []
    for place in hits.tolist():
        if not found or place - found[-1] > AGAIN_S * RATE_HZ:
            found.append(place)
    return found


def main() -> None:
    """Print the table."""
    files = [file for file in sorted(Path(sys.argv[1]).rglob("*.bvh")) if file.stat().st_size]
    takes = [[one for one in wrists(file) if len(one) > 300] for file in files]
    background = [one for number, take in enumerate(takes) for one in take if number % 3 == 0]
    heldout = [one for number, take in enumerate(takes) for one in take if number % 3]
    hours = sum(map(len, heldout)) / RATE_HZ / 3600
    known = quaternion.continuous(np.concatenate(background)).astype(np.float32)
    minutes = len(known) / RATE_HZ / 60
    print(f"{hours:.2f} h of dance without the gesture, {minutes:.0f} min of background.")
    rng = np.random.default_rng(1)
    kinds = {"made": [(shape, range(0)) for shape in made_gestures().values()], "a dancer's": []}
    while len(kinds["a dancer's"]) < EXCERPTS:
        number = int(rng.integers(len(heldout)))
        take, begin = heldout[number], sum(map(len, heldout[:number]))
        at, count = int(rng.integers(50, len(take) - 100)), int(rng.integers(20, 45))
        one = take[at : at + count]
        if quaternion.angle_between(one[1:], one[:-1]).sum() > 2.5:
            there = range(begin + at, begin + at + count + round(NEAR_S * RATE_HZ))
            kinds["a dancer's"].append((one, there))
    print(
        "| gesture | hits | hits at its own speed and size | false alarms an hour | random: hits "
        "| turning as fast: hits / false alarms an hour |"
    )
    print("|---|---|---|---|---|---|")
    for kind, gestures in kinds.items():
        for line in rows(kind, gestures, known, heldout, hours):
            print(line, flush=True)


def rows(
    kind: str, gestures: Sequence[tuple[Array, range]], known: Array, heldout: list[Array], hours: float
) -> Iterator[str]:
    """Two rows of the table: without background, and with it. gestures: with where each comes from among all
    held-out orientations: no alarm there is false.
    """
    rng = np.random.default_rng(7)
    hits, same, false = np.zeros(2), np.zeros(2), np.zeros(2)
    by_chance = np.zeros(2)
    null_hits, null_false = 0, 0
    whole = np.concatenate(heldout)
    for shape, there in gestures:
        three = [
            repeated(shape, rng, rng.uniform(0.92, 1.08), rng.uniform(0.93, 1.07)).astype(np.float32)
            for _ in range(3)
        ]
        both = [learned("it", "a cue", "lHand", three, usual) for usual in (None, known)]
        near = nearest(both[0], whole.astype(np.float32))
        found = np.array([sum(place not in there for place in alarms(one, near)) for one in both])
        false += found
        null_false += sum(place not in there for place in energetic(both[0], whole))
        for number in range(REPEATS):
            plain = number % 4 == 0
            speed, size = (1.0, 1.0) if plain else (rng.uniform(0.8, 1.25), rng.uniform(0.8, 1.2))
            dance = heldout[rng.integers(len(heldout))]
            again = repeated(shape, rng, speed, size)
            stream, end = in_dance(again, dance, int(rng.integers(100, len(dance) - 50)), rng)
            counts = range(end - len(again) // 3, end + round(NEAR_S * RATE_HZ))
            near = nearest(both[0], stream.astype(np.float32))
            hit = np.array([any(place in counts for place in alarms(one, near)) for one in both])
            hits, same = hits + hit, same + (hit & plain)
            null_hits += any(place in counts for place in energetic(both[0], stream))
            by_chance += np.minimum(1.0, found / (hours * 3600) * len(counts) / RATE_HZ)
    each, made = len(gestures), len(gestures) * REPEATS
    for row, background in enumerate(("without", "with")):
        yield (
            f"| {kind}, {background} background | {hits[row] / made:.0%} | {same[row] / (made / 4):.0%} | "
            f"{false[row] / each / hours:.1f} | {by_chance[row] / made:.1%} | "
            f"{null_hits / made:.0%} / {null_false / each / hours:.0f} |"
        )


if __name__ == "__main__":
    main()
