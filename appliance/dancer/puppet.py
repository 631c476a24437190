"""The puppet: iterative autoencoding of a window with held joints, one run of the network's graph."""

from __future__ import annotations

import math
from copy import copy
from pathlib import Path
from typing import Any, Self

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from appliance.dancer.slerp import FloatArray
from appliance.pose.foreign_file import content
from appliance.pose.skeleton import Skeleton, UnknownJointError
from appliance.show.bundle import LARGEST_FILE
from appliance.show.network import WINDOW, rest_pose

_INPUTS = {  # and how many dimensions each has
    "window": 3,
    "mask": 1,
    "targets": 3,
    "weights": 1,
    "coding_iterations": 0,
    "interaction_iterations": 0,
}
_OUTPUT = "poses"
_CURE = "Export the show again, or copy the bundle again."
# Sum of squares of a window of unit quaternions is their count. Rounding moves it by 1e-6 of that; a damaged
# network gives NaN, infinity or lengths that are far from one.
_LENGTH_TOLERANCE = 1e-2


class PuppetError(ValueError):
    """A network file that cannot dance this skeleton: which file, what is wrong, what to do."""


class Puppet:
    """One onnxruntime session on one network file; joints that the network does not move bypass it.

    joints: names of the M moving joints; moving (M,): their places in the skeleton; window: poses a window;
    latent: Z numbers that a window is coded in.
    is_broken: whether the last dance() gave invalid poses (it then returned the last valid ones).
    """

    def __init__(self, path: Path, skeleton: Skeleton) -> None:
        """Raises PuppetError if bunraku did not export the file or it does not fit the skeleton."""
        self._session, facts = _session(path)
        self.joints, self.window, self.latent, self.rest = _read_facts(path, facts)
        self.architecture = facts.get("bunraku.architecture", "unknown")
        self.precision = facts.get("bunraku.precision", "unknown")
        try:
            self.moving: NDArray[np.intp] = np.array([skeleton.index(name) for name in self.joints])
        except UnknownJointError as error:
            raise PuppetError(
                f"{path}: the network moves joints that this skeleton does not have. {error} "
                "Use the skeleton that the network was trained on."
            ) from None
        self._clear_memory()

    def another(self) -> Self:
        """A puppet of the same network: it shares the session, and nothing that changes."""
        other = copy(self)
        other._clear_memory()
        return other

    def _clear_memory(self) -> None:
        self.is_broken = False
        self._window = np.zeros((self.window, len(self.joints), 4), dtype=np.float32)
        self._sound: FloatArray | None = None
        self._iterations = np.zeros((), dtype=np.int64), np.zeros((), dtype=np.int64)
        self._feed: dict[str, Any] = {
            "coding_iterations": self._iterations[0],
            "interaction_iterations": self._iterations[1],
        }

    def select(self, window: FloatArray) -> FloatArray:
        """The moving joints (window, M, 4) of one of all joints (window, J, 4); overwritten each time."""
        return np.take(window, self.moving, axis=1, out=self._window, mode="clip")

    def restore(self, pose: FloatArray, whole: FloatArray) -> None:
        """Write a pose of the moving joints (M, 4) into one of all joints (J, 4); numbers (M,) as well."""
        whole[self.moving] = pose

    def dance(
        self,
        window: FloatArray,
        mask: NDArray[np.bool_],
        targets: FloatArray,
        weights: FloatArray,
        coding_iterations: int,
        interaction_iterations: int,
    ) -> FloatArray:
        """Iterate a window (window, M, 4); returns unit quaternions (window, M, 4).

        mask (M,), targets (window, M, 4), weights (M,): the held joints, with one orientation for each pose
        of the window, as hands.Hands gives them. The held joints are overwritten in the first
        interaction_iterations of coding_iterations passes, which together bring them as far towards their
        targets as the weights say.
        """
        self._iterations[0][...] = coding_iterations
        self._iterations[1][...] = interaction_iterations
        feed = self._feed
        feed["window"], feed["mask"], feed["targets"] = window, mask, targets
        feed["weights"] = weights_of_one_pass(weights, interaction_iterations)
        poses: FloatArray = self._session.run((_OUTPUT,), feed)[0]
        flat = poses.ravel()
        length = float(flat.dot(flat)) * 4 / flat.size
        self.is_broken = not math.isfinite(length) or abs(length - 1) > _LENGTH_TOLERANCE
        if not self.is_broken:
            self._sound = poses
        elif self._sound is None:
            return window
        else:
            return self._sound
        return poses


def weights_of_one_pass(weights: FloatArray, interaction_iterations: int) -> FloatArray:
    """By how much (M,) one pass overwrites, so that all of them together overwrite by the weights (M,).

    With the weights themselves nine passes would take a joint three quarters of the way at a weight of 0.1,
    and a hand that comes or goes would move the whole body in the first or last instant of its fade.
    """
    passes = np.float32(max(1, interaction_iterations))
    shares: FloatArray = 1 - (1 - weights) ** (1 / passes)
    return shares


def _session(path: Path) -> tuple[onnxruntime.InferenceSession, dict[str, str]]:
    """The network and what it says of itself."""
    if not path.is_file():
        raise PuppetError(f"{path}: there is no such network file. {_CURE}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.log_severity_level = 3
    # A spinning pool would keep a core busy between the ticks.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    try:
        network = content(path, LARGEST_FILE)  # as bytes: a network then cannot name other files to be read
        session = onnxruntime.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        inputs = {value.name: value.shape for value in session.get_inputs()}
        outputs = {value.name for value in session.get_outputs()}
        facts: dict[str, str] = session.get_modelmeta().custom_metadata_map  # its words need be no text
    except Exception as error:  # onnxruntime has a class of its own for every way to be damaged
        raise PuppetError(
            f"{path}: onnxruntime cannot read this network ({_short(error)}). {_CURE}"
        ) from None
    if inputs.keys() != _INPUTS.keys() or _OUTPUT not in outputs:
        raise PuppetError(
            f"{path}: this network takes {', '.join(sorted(inputs))} and gives {', '.join(sorted(outputs))}; "
            f"a puppet takes {', '.join(sorted(_INPUTS))} and gives {_OUTPUT}. Make one with bunraku export."
        )
    for name, shape in inputs.items():
        if len(shape) != _INPUTS[name]:
            raise PuppetError(
                f"{path}: the network's input '{name}' has the shape {shape}, as another release exported "
                "it. Export the show again with this release."
            )
    return session, facts


def _read_facts(path: Path, facts: dict[str, str]) -> tuple[tuple[str, ...], int, int, FloatArray]:
    try:
        joints = tuple(facts["bunraku.joints"].split(","))
        window = int(facts["bunraku.window"])
        latent = int(facts["bunraku.latent"])
        rest = rest_pose(facts, len(joints))
        if window != WINDOW:
            raise ValueError(f"its windows are {window} poses long; the box dances windows of {WINDOW}")
    except (KeyError, ValueError) as error:
        raise PuppetError(
            f"{path}: the network does not say what it moves ({_short(error)}). {_CURE}"
        ) from None
    return joints, window, latent, rest


def _short(error: Exception) -> str:
    return str(error).strip().splitlines()[0][:200] if str(error).strip() else type(error).__name__
