"""A study of blind pairs: clips of two dances, in random order and on random sides, as one page."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from appliance.dancer.loop import turns_about_y, yaws
from appliance.pose import quaternion
from appliance.pose.quaternion import Array
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.whole_file import write_text_whole
from appliance.studio.blind_pairs.votes import packed_key
from appliance.studio.data.catalogue import find_catalogue, recordings_in
from appliance.studio.data.dataset import FPS
from appliance.studio.data.takes import load_take
from appliance.studio.studio_error import StudioError

EVERY = 2  # poses of a clip that the page gets: 25 a second


@dataclass(frozen=True)
class StudyOptions:
    """The command line of bunraku compare-blind; first, other: BVH files, or folders of them."""

    first: Path
    other: Path
    out: Path
    pairs: int
    seconds: float
    seed: int
    question: str
    reading: ReadingOptions


def write_study(options: StudyOptions) -> None:
    """Write the page. Raises StudioError where a dance is too short."""
    rng = np.random.default_rng(options.seed)
    dances = [_dances(path, options) for path in (options.first, options.other)]
    names = [path.stem for path in (options.first, options.other)]
    if names[0] == names[1]:
        names = [str(options.first), str(options.other)]
    first_is_left = rng.permutation(np.arange(options.pairs) % 2 == 0)  # as often on each side
    pairs = []
    for is_left in first_is_left:
        clips = [_clip(_excerpt(each, options.seconds, rng)) for each in dances]
        pairs.append(clips if is_left else clips[::-1])
    facts = {
        "study": f"{names[0]}-{names[1]}-{options.seed}-{rng.integers(1 << 48):012x}",
        "a": names[0],
        "b": names[1],
        "key": packed_key(first_is_left.tolist()),
        "question": options.question,
        "fps": FPS / EVERY,
        "pairs": pairs,
    }
    data = json.dumps(facts, separators=(",", ":")).replace("</", "<\\/")
    template = resources.files("appliance.studio.blind_pairs").joinpath("study.html").read_text("utf-8")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    write_text_whole(options.out, template.replace("/*DATA*/", data))


def _dances(path: Path, options: StudyOptions) -> list[Recording]:
    files = recordings_in(path) if path.is_dir() else [path]
    takes = [load_take(one, find_catalogue(one.parent, [one]).with_options(options.reading)) for one in files]
    long = [take.recording for take in takes if take.recording.seconds >= options.seconds]
    if not long:
        raise StudioError(
            f"{path} has no BVH recording of {options.seconds:g} s. Give longer ones, or fewer --seconds."
        )
    return long


def _excerpt(dances: list[Recording], seconds: float, rng: np.random.Generator) -> Recording:
    """A random moment; a longer recording is chosen more often."""
    room = np.array([len(one) - round(seconds * FPS) + 1 for one in dances])
    chosen = int(rng.choice(len(dances), p=room / room.sum()))
    start = int(rng.integers(room[chosen])) / FPS
    return dances[chosen].excerpt(start, start + seconds)


def _clip(excerpt: Recording) -> dict[str, Any]:
    """Bones (joint, parent, width), points of the head, and places in centimetres.

    It faces the viewer at first and dances around the middle of its way.
    """
    turn = turns_about_y(-np.asarray(yaws(quaternion.heading(excerpt.poses[0, 0]))))
    poses, skeleton = excerpt.poses[::EVERY].copy(), excerpt.skeleton
    poses[:, 0] = quaternion.multiply(np.broadcast_to(turn, poses[:, 0].shape), poses[:, 0])
    way = excerpt.roots[::EVERY] - excerpt.roots.mean(axis=0)
    roots = quaternion.rotate(np.broadcast_to(turn, (len(way), 4)), way)
    positions, turns = skeleton.forward_kinematics(poses, roots)
    ends = [
        positions[:, joint] + quaternion.rotate(turns[:, joint], np.broadcast_to(offset, (len(poses), 3)))
        for joint, offset in skeleton.ends
    ]
    whole: Array = np.concatenate([positions, *(end[:, None] for end in ends)], axis=1)
    whole[..., 1] -= np.percentile(whole[..., 1].min(axis=1), 10)
    bones = [
        (joint, parent, skeleton.offsets[joint]) for joint, parent in enumerate(skeleton.parents) if joint
    ]
    bones += [(len(skeleton) + number, joint, offset) for number, (joint, offset) in enumerate(skeleton.ends)]
    top = skeleton.roles.get("head")
    head = set() if top is None else {top, *skeleton.descendants(top)}
    in_head = [joint for joint, parent, _ in bones if parent in head] or sorted(head)
    return {
        "bones": [
            [joint, parent, round(min(5.0, 1.5 + 15 * float(np.linalg.norm(offset))), 1)]
            for joint, parent, offset in bones
            if parent not in head
        ],
        "head": in_head,
        "figures": np.round(100 * whole.reshape(len(whole), -1)).astype(int).tolist(),
    }
