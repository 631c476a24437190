"""Coders of pose windows: a network file as it runs on stage, or a checkpoint as it was trained."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from appliance.pose.foreign_file import opened
from appliance.show.network import WINDOW, latent_size, resting_feed
from appliance.show.show import load_show
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.model_uses import IMPROVISER, USES, require_supported
from appliance.studio.studio_error import StudioError

if TYPE_CHECKING:
    from appliance.studio.autoencoder.autoencoder import Autoencoder

Poses = NDArray[np.float32]


class MovedJoints(Protocol):
    """The joints that a network moves: their names, and their rest pose (M, 4)."""

    @property
    def joints(self) -> tuple[str, ...]: ...

    @property
    def rest(self) -> Poses: ...


class Coder(Protocol):
    """Iterates windows; has joint names, their rest pose (M, 4) and facts about the network.

    batch: the most windows worth coding at once.
    """

    joints: tuple[str, ...]
    window: int
    rest: Poses
    facts: dict[str, str]
    batch: int

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[NDArray[Any]] | None = None,
    ) -> tuple[Poses, Poses]:
        """Windows (B, 8, M, 4) -> windows after the last iteration, and its latents (B, Z)."""


class OnnxCoder:
    """A puppet's network file run as the box runs it: one window at a time, one thread."""

    batch = 1
    window = WINDOW

    def __init__(self, path: Path) -> None:
        """Raises StudioError if bunraku did not export the file, or OSError."""
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        opened(path).close()
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
            facts = self._session.get_modelmeta().custom_metadata_map
            self.joints = tuple(facts["bunraku.joints"].split(","))
            self.rest = np.array(json.loads(facts["bunraku.rest"]), dtype=np.float32)
            self._at_rest = resting_feed(self.rest, latent_size(facts), 1)
        except Exception as error:  # onnxruntime raises another class for each kind of damage
            raise StudioError(
                f"{path} is not a network that bunraku exported, or it is damaged. Give "
                "a show folder, a puppet.onnx or a checkpoint.pt."
            ) from error
        if {port.name for port in self._session.get_inputs()} != self._at_rest.keys():
            raise StudioError(f"{path}: another release exported this network. Export the show again.")
        self.facts = {
            "file": path.name,
            "architecture": facts.get("bunraku.architecture", "unknown"),
            "precision": facts.get("bunraku.precision", "unknown"),
        }

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[NDArray[Any]] | None = None,
    ) -> tuple[Poses, Poses]:
        feed = dict(self._at_rest)
        feed["coding_iterations"] = np.full(1, coding_iterations, dtype=np.int64)
        feed["interaction_iterations"] = np.full(1, interaction_iterations, dtype=np.int64)
        if hold is not None:
            feed["mask"], feed["weights"] = hold.mask[None], hold.weights[None]
        poses, latents = [], []
        for number in range(len(windows)):
            feed["window"] = windows[number : number + 1]
            if hold is not None:
                feed["targets"] = hold.targets[number : number + 1]
            coded = self._session.run(["poses", "latent"], feed)
            poses.append(coded[0])
            latents.append(coded[1])
        return np.concatenate(poses), np.concatenate(latents)


class TorchCoder:
    """A network in training or from a checkpoint: many windows at once."""

    batch = 512

    def __init__(self, autoencoder: Autoencoder, joints: Sequence[str], facts: dict[str, str]) -> None:
        self.autoencoder, self.joints, self.facts = autoencoder, tuple(joints), facts
        self.window = autoencoder.shape.window
        self.rest = autoencoder.rest.cpu().numpy()

    def iterate(
        self,
        windows: Poses,
        coding_iterations: int,
        interaction_iterations: int = 0,
        hold: HeldJoints[NDArray[Any]] | None = None,
    ) -> tuple[Poses, Poses]:
        import torch

        def tensor(values: NDArray[Any]) -> torch.Tensor:
            return torch.from_numpy(values).to(self.autoencoder.rest.device)

        held = None if hold is None else HeldJoints(*map(tensor, hold))
        with torch.no_grad():
            poses, latents = self.autoencoder.iterate(
                tensor(windows), coding_iterations, interaction_iterations, held
            )
        return poses.cpu().numpy(), latents.cpu().numpy()


def load_checkpoint(path: Path) -> tuple[TorchCoder, dict[str, Any]]:
    """The averaged network of a checkpoint and the checkpoint's whole state. Raises StudioError."""
    from appliance.studio.autoencoder.training import load_autoencoder

    if load_state(path)["settings"].get("model") == IMPROVISER:
        raise StudioError(f"{path} is an improviser, for bunraku improvise --model, and no autoencoder.")
    with _from_training(path):
        autoencoder, joints, state = load_autoencoder(path)
    architecture = state["settings"]["network"]
    facts = {"file": path.name, "architecture": architecture, "precision": "fp32 in PyTorch"}
    return TorchCoder(autoencoder, joints, facts), state


def load_state(path: Path) -> dict[str, Any]:
    """All of a checkpoint, whatever was trained. Raises StudioError, or OSError."""
    import torch

    opened(path).close()
    with _from_training(path):
        state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        state["settings"]["seed"]
    require_supported(state["settings"].get("network", ""), path)
    return state


@contextmanager
def _from_training(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # torch raises many classes for a file that it did not write
        raise StudioError(
            f"{path} is not a checkpoint of bunraku train, or it is damaged. Give the checkpoint.pt of a "
            "training."
        ) from error


def load_puppet(path: Path) -> tuple[TorchCoder, dict[str, Any]]:
    """The same for a network that the box can dance. Raises StudioError."""
    coder, state = load_checkpoint(path)
    model = state["settings"].get("model", "puppet")
    if model != "puppet":
        raise StudioError(f"{path} is a {model} model, for {USES[model]}; a show needs a puppet.")
    if coder.window != WINDOW:
        raise StudioError(
            f"{path} has windows of {coder.window} poses, and the box dances windows of {WINDOW}. It dances "
            "by itself with bunraku granular; for a show train one without --window."
        )
    return coder, state


def open_coder(path: Path) -> Coder:
    """A show folder, an .onnx file, a checkpoint.pt, or a folder that is still training."""
    if path.is_dir():
        if not (path / "show.yaml").exists() and (path / "checkpoint.pt").exists():
            return load_puppet(path / "checkpoint.pt")[0]
        return OnnxCoder(load_show(path).network)
    return load_puppet(path)[0] if path.suffix.casefold() == ".pt" else OnnxCoder(path)
