"""Is a network file a puppet's? Its inputs, outputs and facts, and whether one pass gives sound poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from appliance.pose.foreign_file import content, plain_json
from appliance.show.bundle import COPY_AGAIN, LARGEST_FILE
from appliance.show.config_error import did_you_mean

WINDOW = 8
MOST_JOINTS = 1000
MOST_LATENTS = 4096
UNIT_TOLERANCE = 1e-3
_MOST_NAMED = 5  # joints that a network has and the skeleton has not
_LARGEST_REST = 1 << 20  # characters
_EXPORT_AGAIN = "Export the show again with this release."

Complaint = tuple[str, str]  # message, cure
_TYPES: dict[type[np.generic], str] = {
    np.float32: "tensor(float)",
    np.bool_: "tensor(bool)",
    np.int64: "tensor(int64)",
}


def moving_joints(facts: dict[str, str]) -> list[str]:
    """The joints that a network moves, in its own order, from its metadata."""
    return [name for name in facts.get("bunraku.joints", "").split(",") if name]


def inspect_network(path: Path, skeleton_joints: Sequence[str]) -> tuple[list[str], list[Complaint]]:
    """The joints that the network moves, and what is wrong with the file for this skeleton."""
    import onnxruntime  # here, because a box that only reads its configuration does not need it

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        # As bytes: so a network cannot have other files read as its weights.
        network = content(path, LARGEST_FILE)
        session = onnxruntime.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        facts: dict[str, str] = session.get_modelmeta().custom_metadata_map  # its words need be no text
        inputs = {port.name: port for port in session.get_inputs()}
        outputs = {port.name: port for port in session.get_outputs()}
    except MemoryError:  # not the file's fault
        raise
    except Exception as error:  # onnxruntime has its own exception for each way to be broken
        why = (str(error) or type(error).__name__).splitlines()[0][:120]
        return [], [(f"This cannot be read as a network ({why}).", COPY_AGAIN)]
    joints = moving_joints(facts)
    complaints = list(_fact_complaints(facts, joints, skeleton_joints))
    latents = latent_size(facts)
    if "window" in inputs and len(inputs["window"].shape) == 3:
        complaints.append(("It takes one puppet, as an older release exported it.", _EXPORT_AGAIN))
    elif latents:
        complaints += _port_complaints("input", inputs, _inputs(len(joints), latents))
        complaints += _port_complaints("output", outputs, _outputs(len(joints)))
    if not complaints:
        complaints += _run_complaints(session, resting_feed(rest_pose(facts, len(joints)), latents, 2))
    return joints, complaints


def rest_pose(facts: dict[str, str], joints: int) -> np.ndarray:
    """The rest pose (joints, 4) in a network's metadata. Raises ValueError where there is none."""
    text = facts.get("bunraku.rest", "")
    try:
        rest = np.array(plain_json(text if len(text) <= _LARGEST_REST else ""), dtype=np.float32)
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from None
    if rest.shape != (joints, 4) or not _are_unit(rest):
        raise ValueError(f"its rest pose is not one quaternion for each of {joints} joints")
    return rest


def network_inputs(joints: int, latents: int) -> dict[str, tuple[type[np.generic], tuple[int, ...]]]:
    """A puppet's inputs to its network, by name: kind of numbers, and shape; the network takes P of each."""
    return {
        "window": (np.float32, (WINDOW, joints, 4)),
        "mask": (np.bool_, (joints,)),
        "targets": (np.float32, (WINDOW, joints, 4)),
        "weights": (np.float32, (joints,)),
        "coding_iterations": (np.int64, ()),
        "interaction_iterations": (np.int64, ()),
        "liveliness": (np.float32, ()),
        "noise": (np.float32, (latents,)),
        "places": (np.float32, (joints, 3)),
        "place_weights": (np.float32, (joints,)),
    }


def resting_feed(rest: np.ndarray, latents: int, puppets: int) -> dict[str, np.ndarray]:
    """Inputs of a network for puppets in the rest pose (M, 4): one free pass, nothing held."""
    feed = {
        name: np.zeros((puppets, *shape), dtype)
        for name, (dtype, shape) in network_inputs(len(rest), latents).items()
    }
    feed["window"][:] = feed["targets"][:] = rest
    feed["coding_iterations"][:] = 1
    feed["liveliness"][:] = 1.0
    return feed


def latent_size(facts: dict[str, str]) -> int:
    """How many numbers a window is coded in, from a network's metadata; 0 where that is not said."""
    text = facts.get("bunraku.latent", "")
    size = int(text) if text.isascii() and text.isdigit() and len(text) < 9 else 0
    return size if size <= MOST_LATENTS else 0


_Port = tuple[str, tuple[int | str, ...]]  # type, shape; a word: the file leaves this size open


def _inputs(joints: int, latents: int) -> dict[str, _Port]:
    return {
        name: (_TYPES[dtype], ("P", *shape))
        for name, (dtype, shape) in network_inputs(joints, latents).items()
    }


def _outputs(joints: int) -> dict[str, _Port]:
    return {"poses": ("tensor(float)", ("P", WINDOW, joints, 4))}


def _fact_complaints(
    facts: dict[str, str], joints: list[str], skeleton_joints: Sequence[str]
) -> Iterator[Complaint]:
    """The faults of the metadata."""
    if not joints:
        yield "It does not say which joints it moves (bunraku.joints): it is not a puppet.", _EXPORT_AGAIN
    if len(joints) > MOST_JOINTS:
        yield f"It moves {len(joints)} joints, more than {MOST_JOINTS}: this is no dancer.", _EXPORT_AGAIN
        return
    if len(set(joints)) < len(joints):
        yield "It names a joint twice.", _EXPORT_AGAIN
    for name in [name[:100] for name in joints if name not in skeleton_joints][:_MOST_NAMED]:
        yield (
            f"It moves the joint '{name}', which the show's skeleton does not have.",
            f"{did_you_mean(name, skeleton_joints)} Use the skeleton of the recordings it learned from.",
        )
    if facts.get("bunraku.window") != str(WINDOW):
        found = facts.get("bunraku.window", "nothing")[:20]
        yield f"Its windows are {found} poses long; the box dances windows of {WINDOW}.", _EXPORT_AGAIN
    if not latent_size(facts):
        found = facts.get("bunraku.latent", "nothing")[:20]
        yield f"Its latent has {found} numbers; the box knows 1 to {MOST_LATENTS}.", _EXPORT_AGAIN
    try:
        if joints:
            rest_pose(facts, len(joints))
    except ValueError:
        yield (
            f"Its rest pose (bunraku.rest) is not one quaternion for each of {len(joints)} joints.",
            _EXPORT_AGAIN,
        )


def _port_complaints(kind: str, by_name: dict[str, Any], wanted: dict[str, _Port]) -> Iterator[Complaint]:
    """Inputs or outputs that are missing, unknown, of another type or another shape."""
    for name in by_name.keys() - wanted.keys() if kind == "input" else ():
        yield f"It has an {kind} '{name}' that the box does not know.", _EXPORT_AGAIN
    for name, (dtype, shape) in wanted.items():
        port = by_name.get(name)
        if port is None:
            yield f"It has no {kind} '{name}'.", _EXPORT_AGAIN
        elif port.type != dtype:
            yield f"Its {kind} '{name}' is a {port.type}, not a {dtype}.", _EXPORT_AGAIN
        elif not _fits(port.shape, shape):
            yield f"Its {kind} '{name}' has the shape {port.shape}, not {[*shape]}.", _EXPORT_AGAIN


def _fits(found: Sequence[int | str | None], wanted: Sequence[int | str]) -> bool:
    """A size that the file leaves open fits any, and one that it must leave open no number."""
    return len(found) == len(wanted) and all(
        not isinstance(size, int) or size == right for size, right in zip(found, wanted, strict=True)
    )


def _run_complaints(session: Any, feed: dict[str, np.ndarray]) -> Iterator[Complaint]:
    """One pass over the rest pose: a damaged file gives numbers that are no poses."""
    try:
        (poses,) = session.run(["poses"], feed)
    except Exception as error:
        yield f"It fails when it runs ({str(error).splitlines()[0][:120]}).", COPY_AGAIN
        return
    if poses.shape != feed["window"].shape:
        yield f"It gives poses of the shape {poses.shape}, not {feed['window'].shape}.", _EXPORT_AGAIN
    elif not _are_unit(poses):
        yield (
            "It gives numbers that are no rotations (a damaged file, or one that learned nothing).",
            COPY_AGAIN,
        )


def _are_unit(quaternions: np.ndarray) -> bool:
    """Whether all are finite and of length 1."""
    return bool(np.all(np.abs(np.linalg.norm(quaternions, axis=-1) - 1.0) < UNIT_TOLERANCE))
