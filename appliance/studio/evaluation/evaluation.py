"""How well a network reproduces a dance: joint angles and positions after K iterations, and its latents."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from appliance.pose import quaternion
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.skeleton import UnknownJointError
from appliance.studio.data.dataset import (
    WINDOW,
    Take,
    find_catalogue,
    load_take,
    window_starts,
)
from appliance.studio.data.remembered import NOTHING, Remembered
from appliance.studio.evaluation.coders import Coder, MovedJoints
from appliance.studio.studio_error import StudioError

ITERATIONS = (1, 2, 5, 10)
POSITION_ITERATIONS = (1, 10)
PATIENCE_S = 40.0
HOPS = (1, 2, 4, 8)
PART = 64  # windows whose figures are reckoned at once, if the network codes fewer at once
Figures = NDArray[np.float32]


@dataclass(frozen=True)
class Evaluation:
    """Errors of N windows of 8 poses. degrees[k], centimetres[k]: (N, 8, M) after k iterations;
    latents (N, Z) of the first iteration."""

    joints: tuple[str, ...]
    degrees: dict[int, Figures]
    centimetres: dict[int, Figures]
    latents: Figures
    frames: int
    masked_frames: int
    hop: int

    def as_json(self) -> dict[str, Any]:
        """Keys degrees.{1,2,5,10}.{mean,p95,max}, centimetres.{1,10}.{mean,max}, latent.{mean,std} and more.

        latent.mean and latent.std are over all values together; mean_of_each_size is the average distance of
        each dimension's mean from 0, std_of_each the average of the dimensions' standard deviations.
        """
        z = self.latents.astype(np.float64)
        return {
            "degrees": {str(k): _spread(v, p95=True) for k, v in self.degrees.items()},
            "centimetres": {str(k): _spread(v) for k, v in self.centimetres.items()},
            "latent": {
                "mean": round(float(z.mean()), 5),
                "std": round(float(z.std()), 5),
                "mean_of_each_size": round(float(np.abs(z.mean(axis=0)).mean()), 5),
                "std_of_each": round(float(z.std(axis=0).mean()), 5),
            },
            "by_joint_degrees": {
                str(k): {name: round(float(v[..., j].mean()), 4) for j, name in enumerate(self.joints)}
                for k, v in self.degrees.items()
            },
            "windows": len(self.latents),
            "hop": self.hop,
            "frames": self.frames,
            "masked_frames": self.masked_frames,
        }


def load_takes(
    files: Sequence[Path],
    coder: MovedJoints,
    reading: ReadingOptions = AS_THE_FILES_SAY,
    trained: Remembered = NOTHING,
) -> list[Take]:
    """Recordings as training reads them: at their true rate, T-pose dropped, capture errors masked, 50 Hz.

    Reading options come first, then those of the training, then a catalogue that lists the file.
    """
    takes = []
    for file in files:
        known = find_catalogue(file.parent, [file]).with_options(trained.options_for(file, reading))
        takes.append(load_take(file, known, dict(zip(coder.joints, coder.rest, strict=True))))
    return takes


def evaluate(
    coder: Coder,
    takes: Sequence[Take],
    hop: int = 1,
    progress: Callable[[Iterable[NDArray[np.intp]], int], Iterable[NDArray[np.intp]]] = lambda parts, _: (
        parts
    ),
    iterations: Sequence[int] = ITERATIONS,
) -> Evaluation:
    """Every hop-th sound window of the takes through the network.

    Positions are those of the network's joints, the root at its recorded place, in centimetres.
    progress(parts, count) wraps the work. Raises StudioError if joints are missing or no window is left.
    """
    degrees: dict[int, list[Figures]] = {k: [] for k in iterations}
    centimetres: dict[int, list[Figures]] = {k: [] for k in POSITION_ITERATIONS if k in iterations}
    latents: list[Figures] = []
    work = [(take, part) for take in takes for part in _parts(take, hop, max(coder.batch, PART))]
    if not work:
        raise StudioError(
            "No window of 8 sound poses is left to evaluate. Give a longer or cleaner recording."
        )
    done = progress((part for _, part in work), len(work))
    for (take, _), starts in zip(work, done, strict=True):
        places = _places(take, coder)
        frames = starts[:, None] + np.arange(WINDOW)
        whole = take.recording.poses[frames]
        windows = whole[:, :, places].astype(np.float32)
        recorded = _positions(take, frames, whole) if centimetres else None
        for k in iterations:
            made, found = coder.iterate(windows, k)
            if not np.isfinite(made).all():
                raise StudioError(f"{coder.facts['file']} outputs no poses: the file is damaged.")
            degrees[k].append(np.degrees(quaternion.angle_between(made, windows)).astype(np.float32))
            if recorded is not None and k in centimetres:
                changed = whole.copy()
                changed[:, :, places] = made
                apart = (recorded - _positions(take, frames, changed))[:, :, places]
                centimetres[k].append(np.asarray(100 * np.linalg.norm(apart, axis=-1), dtype=np.float32))
            if k == iterations[0]:
                latents.append(found)
    return Evaluation(
        coder.joints,
        {k: np.concatenate(v) for k, v in degrees.items()},
        {k: np.concatenate(v) for k, v in centimetres.items()},
        np.concatenate(latents),
        sum(len(take.recording) for take in takes),
        sum(int((~take.sound).sum()) for take in takes),
        hop,
    )


def fitting_hop(coder: Coder, takes: Sequence[Take]) -> int:
    """1 if coding every window takes less than PATIENCE_S; 2, 4 or 8 for a slow network."""
    take = max(takes, key=lambda take: len(window_starts(take)))
    first = window_starts(take)[: coder.batch]
    if not len(first):
        return 1
    windows = take.recording.poses[first[:, None] + np.arange(WINDOW)][:, :, _places(take, coder)]
    coder.iterate(windows.astype(np.float32), 1)
    began = time.perf_counter()
    coder.iterate(windows.astype(np.float32), sum(ITERATIONS))
    cost_s = (time.perf_counter() - began) / len(first) * sum(len(window_starts(take)) for take in takes)
    return next((hop for hop in HOPS if cost_s / hop <= PATIENCE_S), HOPS[-1])


def _parts(take: Take, hop: int, batch: int) -> list[NDArray[np.intp]]:
    starts = window_starts(take, hop)
    return [starts[at : at + batch] for at in range(0, len(starts), batch)]


def _places(take: Take, coder: Coder) -> list[int]:
    """Indices of the network's joints in the recording's skeleton."""
    try:
        return [take.recording.skeleton.index(name) for name in coder.joints]
    except UnknownJointError as error:
        raise StudioError(
            f"{take.name}: the network moves a joint that this recording lacks. {error} "
            "Evaluate on recordings with the joint names that it learned from."
        ) from None


def _positions(take: Take, frames: NDArray[np.intp], poses: NDArray[Any]) -> NDArray[Any]:
    """(B, 8, J, 3) metres: where poses put the joints, the root at its recorded place."""
    recording = take.recording
    bones = None if recording.translations is None else recording.translations[frames]
    return recording.skeleton.forward_kinematics(poses, recording.roots[frames], bones)[0]


def _spread(values: Figures, p95: bool = False) -> dict[str, float]:
    spread = {"mean": float(values.mean(dtype=np.float64))}
    if p95:
        spread["p95"] = float(np.percentile(values, 95))
    spread["max"] = float(values.max())
    return {name: round(value, 4) for name, value in spread.items()}
