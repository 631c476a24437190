"""What codes windows of poses: a network file as it plays on stage, or a checkpoint as it trained."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from appliance.show.network import WINDOW
from appliance.show.show import load_show
from appliance.studio.studio_error import StudioError

if TYPE_CHECKING:
    from appliance.studio.autoencoder.autoencoder import Autoencoder

Poses = NDArray[np.float32]


class Coder(Protocol):
    """Iterates windows; knows its joints, their rest pose (M, 4), and how it came about.

    batch: how many windows it takes at once; more are no use.
    """

    joints: tuple[str, ...]
    rest: Poses
    facts: dict[str, str]
    batch: int

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        mask: NDArray[np.bool_] | None = None,
        targets: Poses | None = None,
        weights: NDArray[np.float32] | None = None,
    ) -> tuple[Poses, Poses]:
        """Windows (B, 8, M, 4) -> windows after so many iterations, latents (B, Z) of the last one.

        mask (M,), targets (B, 8, M, 4), weights (M,): held joints, overwritten in so many iterations.
        """


class OnnxCoder:
    """A puppet's network file run as the box runs it: one window at a time, one thread."""

    batch = 1

    def __init__(self, path: Path) -> None:
        """Raises StudioError where the file is no network of ours."""
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
            facts = self._session.get_modelmeta().custom_metadata_map
            self.joints = tuple(facts["bunraku.joints"].split(","))
            self.rest = np.array(json.loads(facts["bunraku.rest"]), dtype=np.float32)
        except Exception as error:  # onnxruntime has a class of its own for every way to be damaged
            raise StudioError(
                f"{path} is not a network that bunraku exported ({str(error).splitlines()[0][:150]}). "
                "Give a show folder, a puppet.onnx or a checkpoint.pt."
            ) from error
        self.facts = {
            "file": path.name,
            "architecture": facts.get("bunraku.architecture", "unknown"),
            "precision": facts.get("bunraku.precision", "unknown"),
        }
        joints = len(self.joints)
        self._free: dict[str, Any] = {
            "mask": np.zeros(joints, dtype=bool),
            "targets": np.tile(self.rest, (WINDOW, 1, 1)),
            "weights": np.zeros(joints, dtype=np.float32),
        }

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        mask: NDArray[np.bool_] | None = None,
        targets: Poses | None = None,
        weights: NDArray[np.float32] | None = None,
    ) -> tuple[Poses, Poses]:
        made = []
        for number, window in enumerate(windows):
            held: dict[str, Any] = {}
            if mask is not None and targets is not None and weights is not None:
                held = {"mask": mask, "targets": targets[number], "weights": weights}
            made.append(self.run(window, coding_iterations, interaction_iterations, **held))
        return np.stack([poses for poses, _ in made]), np.stack([latent for _, latent in made])

    def run(
        self, window: Poses, coding_iterations: int, interaction_iterations: int = 0, **held: Any
    ) -> tuple[Poses, Poses]:
        """One window (8, M, 4) -> poses and latent; held: mask (M,), targets (8, M, 4), weights (M,)."""
        counts = {
            "coding_iterations": np.array(coding_iterations, dtype=np.int64),
            "interaction_iterations": np.array(interaction_iterations, dtype=np.int64),
        }
        feed = {"window": window, **self._free, **held, **counts}
        poses, latent = self._session.run(["poses", "latent"], feed)
        return poses, latent


class TorchCoder:
    """A network as it trains or as a checkpoint keeps it: many windows at once."""

    batch = 512

    def __init__(self, autoencoder: Autoencoder, joints: Sequence[str], facts: dict[str, str]) -> None:
        self.autoencoder, self.joints, self.facts = autoencoder, tuple(joints), facts
        self.rest = autoencoder.rest.cpu().numpy()

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        mask: NDArray[np.bool_] | None = None,
        targets: Poses | None = None,
        weights: NDArray[np.float32] | None = None,
    ) -> tuple[Poses, Poses]:
        import torch

        device = self.autoencoder.rest.device
        held = [
            None if values is None else torch.from_numpy(values).to(device)
            for values in (mask, targets, weights)
        ]
        with torch.no_grad():
            given = torch.from_numpy(windows).to(device)
            poses, latents = self.autoencoder.iterate(given, coding_iterations, interaction_iterations, *held)
        return poses.cpu().numpy(), latents.cpu().numpy()


def load_checkpoint(path: Path) -> tuple[TorchCoder, dict[str, Any]]:
    """The averaged network of a checkpoint and the checkpoint's whole state. Raises StudioError."""
    from appliance.studio.autoencoder.training import load_autoencoder

    try:
        autoencoder, joints, state = load_autoencoder(path)
    except Exception as error:  # torch has many for a file that is none of its own
        raise StudioError(
            f"{path} is not a checkpoint of bunraku train ({str(error).splitlines()[0][:150]})."
        ) from error
    architecture = state["settings"]["network"]
    facts = {"file": path.name, "architecture": architecture, "precision": "fp32 in PyTorch"}
    return TorchCoder(autoencoder, joints, facts), state


def open_coder(path: Path) -> Coder:
    """A show folder, an .onnx file, a checkpoint.pt, or a folder that is still training."""
    if path.is_dir():
        if not (path / "show.yaml").exists() and (path / "checkpoint.pt").exists():
            return load_checkpoint(path / "checkpoint.pt")[0]
        return OnnxCoder(load_show(path).network)
    if not path.exists():
        raise StudioError(f"{path} does not exist. Give a show folder, a puppet.onnx or a checkpoint.pt.")
    return load_checkpoint(path)[0] if path.suffix == ".pt" else OnnxCoder(path)
