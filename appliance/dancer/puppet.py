"""The puppets: iterative autoencoding of windows with held joints, one run of the network's graph for all."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from appliance.dancer.slerp import FloatArray
from appliance.pose.correctable_error import CorrectableError
from appliance.pose.foreign_file import content
from appliance.pose.skeleton import Skeleton, UnknownJointError
from appliance.show.bundle import LARGEST_FILE
from appliance.show.network import WINDOW, latent_size, network_inputs, rest_pose, resting_feed

_OUTPUT = "poses"
_CURE = "Export the show again, or copy the bundle again."
# Sum of squares of a window of unit quaternions is their count. Rounding moves it by 1e-6 of that; a damaged
# network gives NaN, infinity or lengths that are far from one.
_LENGTH_TOLERANCE = 1e-2


class PuppetError(CorrectableError, ValueError):
    """A network file that cannot dance this skeleton: which file, what is wrong, what to do."""


class PuppetNetwork:
    """One onnxruntime session on one network file, `path`, and the puppets that it dances, all in one run.

    joints: names of the M moving joints; moving (M,): their places in the skeleton; window: poses a window;
    latent: Z numbers that a window is coded in; rest (M, 4).

    The session is bound to the arrays of the rows once: a run allocates nothing here. In int8 the rows'
    activations share a range, so that a row depends a little on the others (docs/notebook.md).
    """

    def __init__(self, path: Path, skeleton: Skeleton, puppets: int = 1) -> None:
        """Raises PuppetError if bunraku did not export the file or it does not fit the skeleton."""
        self.path = path
        self._session, facts = _session(path)
        self.joints, self.latent, self.rest = _read_facts(path, facts)
        self.window = WINDOW
        self.architecture = facts.get("bunraku.architecture", "unknown")
        self.precision = facts.get("bunraku.precision", "unknown")
        try:
            self.moving: NDArray[np.intp] = np.array([skeleton.index(name) for name in self.joints])
        except UnknownJointError as error:
            raise PuppetError(
                f"{path}: the network moves joints that this skeleton does not have. {error} "
                "Use the skeleton that the network was trained on."
            ) from None
        self.inputs = resting_feed(self.rest, self.latent, puppets)
        self.poses: FloatArray = self.inputs["window"].copy()
        self._ports = self._session.io_binding()
        for name, values in self.inputs.items():
            self._ports.bind_cpu_input(name, values)
        self._ports.bind_ortvalue_output(_OUTPUT, onnxruntime.OrtValue.ortvalue_from_numpy(self.poses))
        self.puppets = tuple(Puppet(self, row) for row in range(puppets))

    def dance(self) -> None:
        """Let all puppets iterate their windows as their rows say; their poses are in their rows then."""
        self._session.run_with_iobinding(self._ports)
        for puppet in self.puppets:
            puppet.look()

    def warm_up(self) -> None:
        """One pass over the windows as they are; its poses go nowhere, and no row keeps its iterations."""
        self.inputs["coding_iterations"][:], self.inputs["interaction_iterations"][:] = 1, 0
        self._session.run_with_iobinding(self._ports)


class Puppet:
    """One of a network's puppets: its row of what the network takes and gives, as views.

    window, targets (T, M, 4); mask, weights (M,); noise (Z,), added to the latent; places (M, 3): metres in
    the figure's frame (held_positions.in_figure), and by how much one pass goes there, place_weights (M,).
    poses (T, M, 4): what the last dance gave, unit quaternions unless is_broken.
    """

    def __init__(self, network: PuppetNetwork, row: int) -> None:
        self.network, inputs = network, network.inputs
        self.window: FloatArray = inputs["window"][row]
        self.noise: FloatArray = inputs["noise"][row]
        self.places: FloatArray = inputs["places"][row]
        self.place_weights: FloatArray = inputs["place_weights"][row]
        self.poses: FloatArray = network.poses[row]
        self.is_broken = False
        self._mask: NDArray[np.bool_] = inputs["mask"][row]
        self._targets: FloatArray = inputs["targets"][row]
        self._weights: FloatArray = inputs["weights"][row]
        self._coding, self._interaction, self._liveliness = (
            inputs[name][row : row + 1]
            for name in ("coding_iterations", "interaction_iterations", "liveliness")
        )
        self._flat = self.poses.reshape(-1)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the M moving joints."""
        return self.network.joints

    @property
    def latent(self) -> int:
        """Z: numbers that a window is coded in."""
        return self.network.latent

    @property
    def liveliness(self) -> float:
        """How much of the phrase's own stays while a hand holds; 1: all of it."""
        return float(self._liveliness[0])

    @liveliness.setter
    def liveliness(self, share: float) -> None:
        self._liveliness[0] = share

    def select(self, window: FloatArray) -> FloatArray:
        """The moving joints of one of all joints (T, J, 4): the window (T, M, 4) of the next dance."""
        return np.take(window, self.network.moving, axis=1, out=self.window, mode="clip")

    def scatter(self, pose: FloatArray, whole: FloatArray) -> None:
        """Write a pose of the moving joints (M, 4) into one of all joints (J, 4); numbers (M,) as well."""
        whole[self.network.moving] = pose

    def hold(
        self,
        mask: NDArray[np.bool_],
        targets: FloatArray,
        weights: FloatArray,
        coding_iterations: int,
        interaction_iterations: int,
    ) -> None:
        """Take the held joints and the iterations of the next dance.

        mask (M,), targets (T, M, 4), weights (M,): as hands.Hands gives them, one orientation for each pose
        of the window. The held joints are overwritten in the first interaction_iterations of
        coding_iterations passes, which together bring them as far towards their targets as the weights say.
        """
        self._mask[:], self._targets[:] = mask, targets
        self._weights[:] = weights_of_one_pass(weights, interaction_iterations)
        self._coding[0], self._interaction[0] = coding_iterations, interaction_iterations

    def look(self) -> None:
        """Whether what the last dance gave are poses."""
        length = float(self._flat.dot(self._flat)) * 4 / self._flat.size
        self.is_broken = not math.isfinite(length) or abs(length - 1) > _LENGTH_TOLERANCE


def weights_of_one_pass(weights: FloatArray, interaction_iterations: int) -> FloatArray:
    """By how much (M,) one pass overwrites, so that all of them together overwrite by the weights (M,).

    With the weights themselves nine passes would take a joint three quarters of the way at a weight of 0.1.
    A hand that comes or goes would then move the whole body in the first or last instant of its fade.
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
    except MemoryError:  # not the file's fault
        raise
    except Exception as error:  # onnxruntime has a separate class for every kind of damage
        raise PuppetError(
            f"{path}: onnxruntime cannot read this network ({_short(error)}). {_CURE}"
        ) from None
    known = network_inputs(0, 0)
    for name, (_, shape) in known.items():
        if name in inputs and len(inputs[name]) != 1 + len(shape):
            raise PuppetError(
                f"{path}: the network's input '{name}' has the shape {inputs[name]}, as another release "
                "exported it. Export the show again with this release."
            )
    if inputs.keys() != known.keys() or _OUTPUT not in outputs:
        raise PuppetError(
            f"{path}: this network takes {', '.join(sorted(inputs))} and gives {', '.join(sorted(outputs))}; "
            f"a puppet takes {', '.join(sorted(known))} and gives {_OUTPUT}. Make one with bunraku export."
        )
    return session, facts


def _read_facts(path: Path, facts: dict[str, str]) -> tuple[tuple[str, ...], int, FloatArray]:
    try:
        joints, latents = tuple(facts["bunraku.joints"].split(",")), latent_size(facts)
        window = int(facts["bunraku.window"])
        rest = rest_pose(facts, len(joints))
        if window != WINDOW:
            raise ValueError(f"its windows are {window} poses long; the box dances windows of {WINDOW}")
        if not latents:
            raise ValueError("its latent has no size")
    except (KeyError, ValueError) as error:
        raise PuppetError(
            f"{path}: the network does not say what it moves ({_short(error)}). {_CURE}"
        ) from None
    return joints, latents, rest


def _short(error: Exception) -> str:
    return str(error).strip().splitlines()[0][:200] if str(error).strip() else type(error).__name__
