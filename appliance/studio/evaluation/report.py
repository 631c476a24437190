"""report.json: the figures of a show's own dancer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from appliance.studio.autoencoder import rotation
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.data.dataset import Dataset, window_starts, windows
from appliance.studio.evaluation.coders import TorchCoder
from appliance.studio.evaluation.evaluation import Evaluation
from appliance.studio.export.gate import LIMITS_DEGREES, Verdict

RANDOM_LATENTS = 4096
LISTED = ("network", "seed", "batch", "learning_rate", "mirror", "weights")


def write_up(
    coder: TorchCoder,
    state: dict[str, Any],
    dataset: Dataset,
    evaluation: Evaluation,
    evaluated_on: Sequence[str],
    verdict: Verdict,
    difference: float,
    median_ms: dict[str, float],
) -> dict[str, Any]:
    """The report as JSON. difference: largest between ONNX and PyTorch in any quaternion component."""
    figures = evaluation.as_json()
    takes = [[take] for take in dataset.training if len(window_starts(take))]  # one by one: for the memory
    of_takes = (windows(one, _places(coder, dataset), mirror=dataset.mirrors) for one in takes)
    ranges = torch.stack([joint_ranges(coder.autoencoder, found) for found in of_takes]).amax(dim=0)
    return {
        "network": {
            "architecture": state["settings"]["network"],
            **{name: state["shape"][name] for name in ("window", "joints", "latent", "width", "depth")},
            "parameters": sum(p.numel() for p in coder.autoencoder.network.parameters()),
            "ships": verdict.precision,
        },
        "training": {
            "minutes": round(state["seconds"] / 60, 2),
            "steps": state["step"],
            **{name: state["origin"][name] for name in ("from",) if name in state.get("origin", {})},
            **{name: state["settings"][name] for name in LISTED},
            "learned": list(state.get("origin", {}).get("catalogue", {}).get("learned", ())),
            "takes": sorted(take.name for take in dataset.training),
            "held_out": sorted(take.name for take in dataset.held_out),
        },
        "evaluated_on": list(evaluated_on),
        **figures,
        "quantization": {
            "passed": verdict.passed,
            "message": verdict.sentence(),
            "limits_degrees": {str(k): limit for k, limit in LIMITS_DEGREES.items()},
            "degrees": {
                str(k): {"mean": round(verdict.mean[k], 4), "max": round(verdict.largest[k], 4)}
                for k in LIMITS_DEGREES
            },
        },
        "equality_with_pytorch": {"iterations": 10, "largest_difference": float(f"{difference:.2g}")},
        "median_ms_of_ten_iterations": {name: round(ms, 3) for name, ms in median_ms.items()},
        "joint_range_degrees": {
            name: round(float(r), 2) for name, r in zip(coder.joints, ranges, strict=True)
        },
        "random_latents": (random := random_dance(coder.autoencoder, ranges)),
        "bounds": bounds(figures, random),
    }


def bounds(figures: Mapping[str, Any], random: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Properties that a dancer should have, with those of this one: for the person who trains, and no reason
    to refuse it.
    """
    latent = figures["latent"]
    rows = {
        "degrees after one iteration": (figures["degrees"]["1"]["mean"], 0.0, 2.0),
        "mean of the latents": (latent["mean"], -0.05, 0.05),
        "mean of each latent number": (latent["mean_of_each_size"], 0.0, 0.3),
        "standard deviation of the latents": (latent["std"], 0.85, 1.15),
        "standard deviation of each latent number": (latent["std_of_each"], 0.8, 1.2),
        "random poses within the recorded range": (random["share_within_range"], 0.999, 1.0),
        "degrees of a random pose beyond that range": (random["furthest_beyond_degrees"], 0.0, 30.0),
    }
    return {
        name: {"value": value, "from": least, "to": most, "holds": bool(least <= value <= most)}
        for name, (value, least, most) in rows.items()
    }


def joint_ranges(autoencoder: Autoencoder, training: np.ndarray[Any, np.dtype[np.float32]]) -> Tensor:
    """(M,): how far each joint turns from its rest orientation in the training windows, in degrees."""
    widest = [torch.zeros(autoencoder.shape.joints)]
    for part in torch.split(torch.from_numpy(training), 4096):
        level = autoencoder.without_heading(part, autoencoder.facing(part))
        widest.append(_degrees_from_rest(autoencoder, level).amax(dim=(0, 1)))
    return torch.stack(widest).amax(dim=0)


def random_dance(autoencoder: Autoencoder, ranges: Tensor, seed: int = 0) -> dict[str, float]:
    """Poses decoded from the prior: the share of joint angles within the recordings' range."""
    noise = torch.randn(
        RANDOM_LATENTS, autoencoder.shape.latent, generator=torch.Generator().manual_seed(seed)
    )
    with torch.no_grad():
        angles = _degrees_from_rest(autoencoder, autoencoder.decode(noise))
    beyond = (angles - ranges).clamp_min(0)
    return {
        "decoded": RANDOM_LATENTS,
        "share_within_range": round(float((beyond == 0).float().mean()), 6),
        "furthest_beyond_degrees": round(float(beyond.max()), 2),
    }


def _degrees_from_rest(autoencoder: Autoencoder, poses: Tensor) -> Tensor:
    return torch.rad2deg(rotation.angle_between(poses, autoencoder.rest.expand_as(poses)))


def _places(coder: TorchCoder, dataset: Dataset) -> list[int]:
    return [dataset.skeleton.index(name) for name in coder.joints]
