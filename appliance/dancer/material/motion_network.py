"""Motion network: encoder and decoder of an autoencoder of windows or of single poses, by onnxruntime."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from appliance.dancer.material.latent_paths import Latents
from appliance.pose import quaternion
from appliance.pose.foreign_file import content, plain_json
from appliance.pose.quaternion import Array
from appliance.show.bundle import LARGEST_FILE
from appliance.show.network import moving_joints, rest_pose

POSES_AT_ONCE = 512  # in the windows of a run: what else a run needs grows with them
LONGEST_WINDOW = 512

Poses = NDArray[np.float32]


class MotionNetworkError(ValueError):
    """A file that is no motion network of this skeleton; the message says why."""


class MotionNetwork:
    """A network's encoder and decoder, on one thread.

    window: poses of a window, 1 for a network of single poses; joints: those that it moves; places: their
    indices in the skeleton; latent: numbers of a latent, standard Gaussian in the prior. ground: for a
    network of poses, the map's 0 to 1: its middle (Z,), directions (2, Z), low and high (2,).
    """

    kind = "motion"

    def __init__(self, path: Path, skeleton_joints: Sequence[str]) -> None:
        """Raises MotionNetworkError."""
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        options.enable_cpu_mem_arena = False
        options.add_session_config_entry("session.disable_prepacking", "1")
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            network = content(path, LARGEST_FILE)  # as bytes: it cannot have other files read as its weights
            self._session = onnxruntime.InferenceSession(network, options, ["CPUExecutionProvider"])
            self._session._model_bytes = None  # it would keep the file's 1 to 8 MB for other providers
            facts: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
            self.joints = tuple(moving_joints(facts))
            self.rest = rest_pose(facts, len(self.joints)).astype(np.float32)
            self.window, self.latent = int(facts["bunraku.window"]), int(facts["bunraku.latent"])
            if facts.get("bunraku.kind") != self.kind or not 1 <= self.window <= LONGEST_WINDOW:
                raise ValueError(f"it is no network of the kind '{self.kind}'")
            self._idle = {  # the parts of the file that a run does not need get the least
                one.name: np.zeros([size if isinstance(size, int) else 1 for size in one.shape], np.float32)
                for one in self._session.get_inputs()
            }
            self._take_facts(facts)
            self.places = [list(skeleton_joints).index(name) for name in self.joints]
            self.ground = _ground(facts.get("bunraku.map", ""), self.latent)
        except MemoryError:  # not the file's fault
            raise
        except Exception as error:  # onnxruntime has its own exception for each way to be broken
            why = (str(error) or type(error).__name__).splitlines()[0][:120]
            raise MotionNetworkError(f"This cannot be read as a network of motion ({why}).") from None

    def encode(self, windows: Array) -> tuple[Latents, Array]:
        """Windows (W, T, M, 4), without sign jumps -> latents (W, Z), and where each of them faces (W, 4)."""
        facing = quaternion.heading(windows[:, windows.shape[1] // 2, 0])
        latents = np.empty((len(windows), self.latent), np.float32)
        for part in self.parts(len(windows)):
            level = np.array(windows[part], dtype=np.float32)
            level[:, :, 0] = quaternion.multiply(quaternion.inverse(facing[part])[:, None], level[:, :, 0])
            latents[part] = self._run(["coded"], windows=quaternion.aligned(level, self.rest))[0]
        return latents, facing

    def decode(self, latents: Latents) -> Poses:
        """Latents (W, Z) -> windows (W, T, M, 4) that face ahead; a short quaternion is an uncertain one.

        Raises MotionNetworkError where it gives no sound poses.
        """
        windows = np.empty((len(latents), self.window, len(self.joints), 4), np.float32)
        for part in self.parts(len(latents)):
            windows[part] = self._run(["decoded"], latents=latents[part].astype(np.float32))[0]
        if not np.isfinite(windows).all():
            raise MotionNetworkError("The network gives poses that are not numbers.")
        return windows

    def parts(self, windows: int) -> list[slice]:
        """So many windows in parts for one run each."""
        most = max(1, POSES_AT_ONCE // self.window)
        return [slice(first, first + most) for first in range(0, windows, most)]

    def _take_facts(self, facts: Mapping[str, str]) -> None:
        """Further metadata of a file of this kind. Raises ValueError, LookupError."""

    def _run(self, outputs: list[str], **inputs: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        found: list[NDArray[np.float32]] = self._session.run(outputs, {**self._idle, **inputs})
        return found


def map_facts(middle: Array, directions: Array, low: Array, high: Array) -> str:
    """The ground of a map as a network's metadata."""
    return json.dumps(
        [np.round(np.asarray(part, float), 6).tolist() for part in (middle, directions, low, high)]
    )


def _ground(text: str, latent: int) -> tuple[Array, Array, Array, Array] | None:
    if not text:
        return None
    middle, directions, low, high = (np.array(part, dtype=np.float64) for part in plain_json(text))
    if (
        middle.shape != (latent,)
        or directions.shape != (2, latent)
        or low.shape != (2,)
        or high.shape != (2,)
    ):
        raise ValueError("its map has another shape than its latents")
    return middle, directions, low, high
