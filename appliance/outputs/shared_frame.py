"""The shared frame: each joint frame, and once a second the box's health, in shared memory."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Facts:
    """What readers need to know about the show and what stays the same while a stage runs."""

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
    springs: tuple[str, ...] = ()  # names of their settings
    rehearsal: bool = False  # its sensors are emulated: nothing is kept

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
        names = ("held", "hands", "phrases", "cues", "looks", "lights", "springs")
        return cls(
            **facts
            | {name: tuple(facts[name]) for name in names}
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
        packed, layout = facts.packed(), FrameLayout(len(facts.skeleton))
        shapes = [(1, len(packed)), (HEALTH_SLOTS, HEALTH_BYTES), (FRAME_SLOTS, layout.bytes)]
        self._file = RingFileWriter.new(folder / FILE, KIND, FORMAT, shapes)
        self._file.rings[FACTS].write(packed)
        self._ring = self._file.rings[FRAMES]
        self._payload = payload = self._ring.payload
        self._joints = layout.joints
        self._root = np.frombuffer(payload, "<f4", 3, layout.root_at)
        self._holds = np.frombuffer(payload, "<f4", layout.joints, layout.holds_at)
        self._pose, self._world, self._positions = (
            np.frombuffer(payload, "<f4", layout.joints * width, at).reshape(layout.joints, width)
            for width, at in ((4, layout.pose_at), (4, layout.world_at), (3, layout.positions_at))
        )
        self._file.publish()

    def write(self, frame: JointFrame) -> None:
        """Publish a frame: one copy, no system call, nothing for the collector."""
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
        self._root[...] = frame.root
        self._pose[...] = frame.pose
        self._world[...] = frame.world
        self._positions[...] = frame.positions
        self._holds[...] = frame.holds
        self._ring.publish()

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
