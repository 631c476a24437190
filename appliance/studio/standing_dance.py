"""A generated dance on its feet, and the excerpt of a recording that it was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from appliance.dancer.grounding import Floor, Grounding, survey
from appliance.dancer.material.steps import floor_under
from appliance.pose import quaternion
from appliance.pose.reading_options import AS_THE_FILES_SAY, ReadingOptions
from appliance.pose.recording import Recording
from appliance.studio.data.dataset import FPS, Dataset
from appliance.studio.data.regions import joints_of, put_on_region
from appliance.studio.data.remembered import Remembered
from appliance.studio.evaluation.coders import MovedJoints, Poses
from appliance.studio.evaluation.evaluation import load_takes
from appliance.studio.improviser.footing import Progress, plant_feet
from appliance.studio.studio_error import StudioError


def excerpt_of(
    file: Path,
    start_s: float,
    seconds: float,
    coder: MovedJoints,
    dataset: Dataset,
    reading: ReadingOptions = AS_THE_FILES_SAY,
) -> Recording:
    """A part of a BVH file at 50 Hz, its floor at height 0, read as asked, else as the dataset was.

    Raises StudioError for another skeleton than the dataset's, or where it is too short.
    """
    skeleton = dataset.skeleton
    (take,) = load_takes([file], coder, reading, Remembered(dataset.catalogue.reading, skeleton))
    recording = take.recording
    if not recording.skeleton.same_joints(skeleton):
        raise StudioError(f"{file} has another skeleton than the recordings that the model was trained on.")
    if start_s >= recording.seconds:
        raise StudioError(f"{file} is {recording.seconds:.1f} s long: --start {start_s:g} is not in it.")
    excerpt = recording.excerpt(start_s, min(start_s + seconds, recording.seconds))
    roots = excerpt.roots.copy()
    roots[:, 1] -= floor_under(excerpt)
    return replace(excerpt, roots=roots)


def standing(
    poses: Poses, given: Recording | None, dataset: Dataset, progress: Progress = iter, is_quick: bool = False
) -> Recording:
    """Poses (T, M, 4) of the moving joints with all joints, on the path of a recording or on the spot.

    The feet are planted in a cycle: danced there and back, a dance is one. progress: through the steps.
    is_quick: they stand as the stage stands them, tick by tick, which takes no torch.
    """
    dance = on_the_spot(poses, dataset) if given is None else _on_its_path(poses, given, dataset)
    if is_quick:
        return as_on_stage(dance, survey(dance if given is None else given), progress)
    there_and_back = replace(
        dance,
        poses=quaternion.continuous(np.concatenate([dance.poses, dance.poses[::-1]])),
        roots=np.concatenate([dance.roots, dance.roots[::-1]]),
    )
    return plant_feet(there_and_back, progress=progress).excerpt(0.0, len(poses) / FPS)


def only_in(regions: Sequence[str], poses: Poses, given: Recording, dataset: Dataset) -> Poses:
    """Poses (T, M, 4) of a dance in these regions of the body, of the given phrase elsewhere.

    Raises StudioError for a region that the body does not have.
    """
    moving = list(dataset.moving)
    whole = given.poses[: len(poses)].copy()
    whole[:, moving] = poses[: len(whole)]
    joints = joints_of(regions, dataset.skeleton, moving)
    mixed: Poses = put_on_region(dataset.skeleton, given.poses, whole, joints)[:, moving].astype(np.float32)
    return mixed


def as_on_stage(dance: Recording, floor: Floor, progress: Progress = iter) -> Recording:
    """The dance as the box stands it on the floor of a recording that is no shorter: root, feet, arms."""
    grounding, free = Grounding(dance.skeleton, floor), np.zeros(len(dance.skeleton), dtype=np.float32)
    poses, roots = (each.astype(np.float32) for each in (dance.poses, dance.roots))
    for tick in progress(range(len(dance))):
        grounding.ground_pose(poses[tick], roots[tick], float(floor.lifts[tick]), None, free)
        poses[tick], roots[tick] = grounding.pose, grounding.root
    return replace(dance, poses=quaternion.continuous(poses.astype(float)), roots=roots.astype(float))


def on_the_spot(poses: Poses, dataset: Dataset) -> Recording:
    """Poses (T, M, 4) with all joints, at the recordings' mean height; other joints stand as in those."""
    whole = np.tile(dataset.still_pose(), (len(poses), 1, 1))
    whole[:, list(dataset.moving)] = poses
    height = float(np.mean([take.recording.roots[:, 1].mean() for take in dataset.training]))
    roots = np.tile([0.0, height, 0.0], (len(poses), 1))
    return Recording(dataset.skeleton, quaternion.continuous(whole), roots, FPS)


def _on_its_path(poses: Poses, given: Recording, dataset: Dataset) -> Recording:
    whole = given.poses[: len(poses)].copy()
    whole[:, list(dataset.moving)] = poses
    return Recording(dataset.skeleton, quaternion.continuous(whole), given.roots[: len(poses)], FPS)
