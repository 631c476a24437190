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
from appliance.outputs.joint_frame import Floats, JointFrame, PuppetFrame
from appliance.outputs.puppet_facts import PuppetFacts, layout_of, led_by, unpacked
from appliance.pose.foreign_file import plain_json
from appliance.pose.skeleton import Skeleton, stance_facts, stance_of


@dataclass(frozen=True)
class Facts:
    """Facts about the show that stay the same while a stage runs, for readers."""

    show_directory: Path
    box_file: Path | None
    show_name: str
    skeleton: Skeleton
    puppets: tuple[PuppetFacts, ...]  # in the order of the frame's
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
    has_partner: bool = False
    goes_on: bool = False
    rehearsal: bool = False  # its sensors are emulated: nothing is kept
    cards: tuple[str, ...] = ()
    look_styles: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # style, own colours
    motion: Mapping[str, Any] = field(default_factory=dict)  # sources that are made ahead, as in show.yaml
    trackers: Mapping[str, Sequence[str]] = field(default_factory=dict)  # joints that each VMC tracker moves

    @property
    def layout(self) -> FrameLayout:
        """The byte layout of its frames."""
        return layout_of(len(self.skeleton), self.puppets, self.phrases)

    @property
    def led(self) -> PuppetFacts:
        """The puppet that cues and orders lead."""
        return led_by(self.puppets)

    def led_in(self, frame: JointFrame) -> PuppetFrame:
        """That puppet in a frame of this stage."""
        return frame.puppets[self.puppets.index(self.led)]

    def packed(self) -> bytes:
        skeleton = self.skeleton
        facts = {name: getattr(self, name) for name in self.__dataclass_fields__} | {
            "show_directory": str(self.show_directory),
            "box_file": None if self.box_file is None else str(self.box_file),
            "puppets": [puppet.packed() for puppet in self.puppets],
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
        names = ("phrases", "cues", "looks", "lights", "springs", "cards")
        return cls(
            **facts
            | {name: tuple(facts[name]) for name in names}
            | {
                "puppets": unpacked(facts["puppets"]),
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
        self._puppets = puppets_in(payload, layout)
        self._hands, self._live = others_in(payload, layout)
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
        for out, puppet in zip(self._puppets, frame.puppets, strict=True):
            out.root[...] = puppet.root
            out.pose[...] = puppet.pose
            out.source[...] = puppet.source
            out.world[...] = puppet.world
            out.positions[...] = puppet.positions
            out.holds[...] = puppet.holds
        self._hands[: len(frame.hands)] = frame.hands
        self._live[: len(frame.live)] = frame.live
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


def others_in(payload: bytes | memoryview, layout: FrameLayout) -> tuple[Floats, Floats]:
    """The hands (H, 4) and the live dancer (J, 3) in a frame's payload, as writable as that is."""
    hands = np.frombuffer(payload, "<f4", 4 * layout.hands, layout.hands_at).reshape(-1, 4)
    return hands, np.frombuffer(payload, "<f4", 3 * layout.live, layout.live_at).reshape(-1, 3)


def puppets_in(payload: bytes | memoryview, layout: FrameLayout) -> tuple[PuppetFrame, ...]:
    """The puppets' arrays in a frame's payload, as writable as that is."""
    joints, found = layout.joints, []
    for at in range(0, layout.puppets * layout.stride, layout.stride):
        pose, source, world = (
            np.frombuffer(payload, "<f4", 4 * joints, at + begin).reshape(joints, 4)
            for begin in (layout.pose_at, layout.source_at, layout.world_at)
        )
        root = np.frombuffer(payload, "<f4", 3, at + layout.root_at)
        positions = np.frombuffer(payload, "<f4", 3 * joints, at + layout.positions_at).reshape(joints, 3)
        holds = np.frombuffer(payload, "<f4", joints, at + layout.holds_at)
        found.append(PuppetFrame(root, pose, source, world, positions, holds))
    return tuple(found)
