"""The shared frame: each joint frame, and once a second the box's health, in shared memory."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from appliance.box.ring_file import RingFileWriter
from appliance.outputs.frame_layout import (
    FACTS,
    FILE,
    FORMAT,
    FRAME_HEAD,
    FRAME_SLOTS,
    FRAMES,
    HEALTH,
    HEALTH_BYTES,
    HEALTH_SLOTS,
    KIND,
    LATE,
    FrameLayout,
)
from appliance.outputs.joint_frame import JointFrame
from appliance.pose.foreign_file import plain_json
from appliance.pose.skeleton import Skeleton, stance_facts, stance_of

_Arrays = tuple[np.ndarray[Any, np.dtype[np.float32]], ...]


@dataclass(frozen=True)
class Facts:
    """Facts about the show that stay the same while a stage runs, for readers."""

    show_directory: Path
    box_file: Path | None
    show_name: str
    skeleton: Skeleton
    held: tuple[int, ...]  # joints that hands hold
    hands: tuple[str, ...]  # that hold them
    phrases: tuple[str, ...]
    cues: tuple[dict[str, Any], ...]
    looks: tuple[str, ...]
    lights: tuple[str, ...]  # names of mapping sets
    coding: int
    interaction: int
    most_iterations: int
    pid: int
    started: float  # seconds on the monotonic clock
    springs: tuple[str, ...] = ()  # names of their settings, first the one at the start
    springs_feedback: Mapping[str, float] = field(default_factory=dict)  # 0..1, of each setting
    has_strings: bool = False
    rehearsal: bool = False  # its sensors are emulated: nothing is kept
    cards: tuple[str, ...] = ()
    puppets: tuple[str, ...] = ()  # their names; (): one, without a name
    motion: Mapping[str, Any] = field(default_factory=dict)  # sources that are made ahead, as in show.yaml
    by_position: tuple[int, ...] = ()  # numbers of the hands that give positions
    trackers: Mapping[str, Sequence[str]] = field(default_factory=dict)  # joints that each VMC tracker moves

    @property
    def layout(self) -> FrameLayout:
        """How its frames lie."""
        return FrameLayout(len(self.skeleton), len(self.puppets) or 1)

    def packed(self) -> bytes:
        """As JSON."""
        skeleton = self.skeleton
        facts = {name: getattr(self, name) for name in self.__dataclass_fields__} | {
            "show_directory": str(self.show_directory),
            "box_file": None if self.box_file is None else str(self.box_file),
            "skeleton": {
                "joints": skeleton.names,
                "parents": [int(parent) for parent in skeleton.parents],
                "offsets": np.asarray(skeleton.offsets).tolist(),
                "ends": [(int(joint), [float(part) for part in offset]) for joint, offset in skeleton.ends],
                **stance_facts(skeleton),
            },
        }
        return json.dumps(facts).encode()

    @classmethod
    def unpacked(cls, packed: bytes) -> Facts:
        """From JSON. Raises ValueError, KeyError or TypeError for foreign data."""
        facts = plain_json(packed)
        skeleton, box_file = facts["skeleton"], facts["box_file"]
        names = ("held", "hands", "by_position", "phrases", "cues", "looks", "lights", "springs", "cards")
        return cls(
            **facts
            | {name: tuple(facts[name]) for name in (*names, "puppets")}
            | {
                "show_directory": Path(facts["show_directory"]),
                "box_file": None if box_file is None else Path(box_file),
                "skeleton": Skeleton(
                    tuple(skeleton["joints"]),
                    tuple(skeleton["parents"]),
                    np.asarray(skeleton["offsets"], np.float64),
                    tuple((joint, (x, y, z)) for joint, (x, y, z) in skeleton["ends"]),
                    stance_of(skeleton),
                ),
            }
        )


class FrameWriter:
    """The stage's end: a file `frame` in the runtime folder, a new one for each stage.

    Raises OSError where the folder takes no file of its size.
    """

    def __init__(self, folder: Path, facts: Facts, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        packed, layout = facts.packed(), facts.layout
        shapes = [(1, len(packed)), (HEALTH_SLOTS, HEALTH_BYTES), (FRAME_SLOTS, layout.bytes)]
        self._file = RingFileWriter.new(folder / FILE, KIND, FORMAT, shapes)
        self._file.rings[FACTS].write(packed)
        self._ring = self._file.rings[FRAMES]
        self._payload = payload = self._ring.payload
        self._joints = layout.joints
        self._arrays = [_arrays(payload, layout, puppet) for puppet in range(layout.puppets)]
        self._file.publish()

    def write(self, frame: JointFrame, *others: JointFrame) -> None:
        """Publish the frames of all puppets: one copy, no system call, nothing for the collector."""
        FRAME_HEAD.pack_into(
            self._payload,
            0,
            frame.tick,
            frame.frame_time,
            self._monotonic(),  # after the tick's work: how long that took shifts what the projector shows
            frame.sensor_sequence,
            frame.sensor_arrival,
            LATE if frame.late else 0,
            self._joints,
        )
        self._fill(self._arrays[0], frame)
        if others:
            for puppet, other in enumerate(others, 1):
                self._fill(self._arrays[puppet], other)
        self._ring.publish()

    @staticmethod
    def _fill(arrays: _Arrays, frame: JointFrame) -> None:
        root, pose, source, world, positions, holds = arrays
        root[...] = frame.root
        pose[...] = frame.pose
        source[...] = frame.source
        world[...] = frame.world
        positions[...] = frame.positions
        holds[...] = frame.holds

    def write_health(self, health: Mapping[str, Any]) -> None:
        """Publish the box's health, after the frame has left; a list that is too long loses its end."""
        said = dict(health)
        packed = json.dumps(said).encode()
        while len(packed) > HEALTH_BYTES:
            longest = max(said, key=lambda name: len(json.dumps(said[name])))
            said[longest] = said[longest][: len(said[longest]) // 2]
            packed = json.dumps(said).encode()
        self._file.rings[HEALTH].write(packed)

    def close(self) -> None:
        """Remove the file: readers find no stage."""
        self._file.close(remove=True)


def _arrays(payload: memoryview, layout: FrameLayout, puppet: int) -> _Arrays:
    """Where a puppet's root (3,), pose, source, world (J, 4), positions (J, 3) and holds (J,) are written."""
    joints, at = layout.joints, puppet * layout.stride
    root = np.frombuffer(payload, "<f4", 3, at + layout.root_at)
    holds = np.frombuffer(payload, "<f4", joints, at + layout.holds_at)
    pose, source, world, positions = (
        np.frombuffer(payload, "<f4", joints * width, at + begin).reshape(joints, width)
        for width, begin in (
            *((4, layout.pose_at), (4, layout.source_at), (4, layout.world_at)),
            (3, layout.positions_at),
        )
    )
    return root, pose, source, world, positions, holds
