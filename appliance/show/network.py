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
UNIT_TOLERANCE = 1e-3
_MOST_NAMED = 5  # joints that a network has and the skeleton has not
_LARGEST_REST = 1 << 20  # characters
_EXPORT_AGAIN = "Export the show again with this release."

Complaint = tuple[str, str]  # message, cure


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
    except Exception as error:  # onnxruntime has its own exception for each way to be broken
        why = (str(error) or type(error).__name__).splitlines()[0][:120]
        return [], [(f"This cannot be read as a network ({why}).", COPY_AGAIN)]
    joints = moving_joints(facts)
    complaints = list(_fact_complaints(facts, joints, skeleton_joints))
    complaints += _port_complaints("input", inputs, _inputs(len(joints)))
    complaints += _port_complaints("output", outputs, _outputs(len(joints)))
    if not complaints:
        complaints += _run_complaints(session, rest_pose(facts, len(joints)))
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


def _inputs(joints: int) -> dict[str, tuple[str, list[int]]]:
    return {
        "window": ("tensor(float)", [WINDOW, joints, 4]),
        "mask": ("tensor(bool)", [joints]),
        "targets": ("tensor(float)", [WINDOW, joints, 4]),
        "weights": ("tensor(float)", [joints]),
        "coding_iterations": ("tensor(int64)", []),
        "interaction_iterations": ("tensor(int64)", []),
    }


def _outputs(joints: int) -> dict[str, tuple[str, list[int]]]:
    return {"poses": ("tensor(float)", [WINDOW, joints, 4])}


def _fact_complaints(
    facts: dict[str, str], joints: list[str], skeleton_joints: Sequence[str]
) -> Iterator[Complaint]:
    """What is wrong with the metadata."""
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
    try:
        if joints:
            rest_pose(facts, len(joints))
    except ValueError:
        yield (
            f"Its rest pose (bunraku.rest) is not one quaternion for each of {len(joints)} joints.",
            _EXPORT_AGAIN,
        )


def _port_complaints(
    kind: str, by_name: dict[str, Any], wanted: dict[str, tuple[str, list[int]]]
) -> Iterator[Complaint]:
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
            yield f"Its {kind} '{name}' has the shape {port.shape}, not {shape}.", _EXPORT_AGAIN


def _fits(found: Sequence[int | str | None], wanted: Sequence[int]) -> bool:
    """Dimensions that the file leaves open fit."""
    return len(found) == len(wanted) and all(
        not isinstance(size, int) or size == right for size, right in zip(found, wanted, strict=True)
    )


def _run_complaints(session: Any, rest: np.ndarray) -> Iterator[Complaint]:
    """One pass over the rest pose: a damaged file gives numbers that are no poses."""
    joints = len(rest)
    feed = {
        "window": np.tile(rest, (WINDOW, 1, 1)),
        "mask": np.zeros(joints, bool),
        "targets": np.tile(rest, (WINDOW, 1, 1)),
        "weights": np.zeros(joints, np.float32),
        "coding_iterations": np.array(1, np.int64),
        "interaction_iterations": np.array(0, np.int64),
    }
    try:
        (poses,) = session.run(["poses"], feed)
    except Exception as error:
        yield f"It fails when it runs ({str(error).splitlines()[0][:120]}).", COPY_AGAIN
        return
    if poses.shape != (WINDOW, joints, 4):
        yield f"It gives poses of the shape {poses.shape}, not {(WINDOW, joints, 4)}.", _EXPORT_AGAIN
    elif not _are_unit(poses):
        yield (
            "It gives numbers that are no rotations (a damaged file, or one that learned nothing).",
            COPY_AGAIN,
        )


def _are_unit(quaternions: np.ndarray) -> bool:
    """Whether all are finite and of length 1."""
    return bool(np.all(np.abs(np.linalg.norm(quaternions, axis=-1) - 1.0) < UNIT_TOLERANCE))
