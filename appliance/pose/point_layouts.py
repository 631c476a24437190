"""Layouts of tracked points: which part of a body each point of a camera program is, in its order."""

from __future__ import annotations

from typing import NamedTuple


class Layout(NamedTuple):
    """program: as people call it; parts: a word for each point, '' for one that says nothing here; is_y_down:
    whether the program counts downwards until its figure shows otherwise.
    """

    program: str
    parts: tuple[str, ...]
    is_y_down: bool = False


def _parts(words: str) -> tuple[str, ...]:
    """'-' for a point that says nothing; l. and r. stand for left and right."""
    return tuple(
        word.replace("-", "").replace("l.", "left ").replace("r.", "right ") for word in words.split()
    )


LAYOUTS = {
    # The order of COCO's key points (cocodataset.org), as most camera networks have it.
    "coco": Layout(
        "COCO",
        _parts(
            "nose l.eye r.eye l.ear r.ear l.shoulder r.shoulder l.elbow r.elbow l.wrist r.wrist "
            "l.hip r.hip l.knee r.knee l.ankle r.ankle"
        ),
    ),
    # Human3.6M's 17 joints, as networks send them that lift a picture's points into the room.
    "h36m": Layout(
        "Human3.6M",
        _parts(
            "- r.hip r.knee r.ankle l.hip l.knee l.ankle chest - nose head "
            "l.shoulder l.elbow l.wrist r.shoulder r.elbow r.wrist"
        ),
    ),
    # Azure Kinect Body Tracking SDK, k4abt_joint_id_t.
    "kinect": Layout(
        "Azure Kinect",
        _parts(
            "- - chest - - l.shoulder l.elbow l.wrist l.hand - l.thumb - r.shoulder r.elbow r.wrist r.hand - "
            "r.thumb l.hip l.knee l.ankle l.toe r.hip r.knee r.ankle r.toe - nose l.eye l.ear r.eye r.ear"
        ),
        is_y_down=True,
    ),
    # MediaPipe's pose landmarks (BlazePose GHUM).
    "mediapipe": Layout(
        "MediaPipe",
        _parts(
            "nose - l.eye - - r.eye - l.ear r.ear - - l.shoulder r.shoulder l.elbow r.elbow l.wrist r.wrist "
            "l.little r.little l.index r.index - - l.hip r.hip l.knee r.knee l.ankle r.ankle - - l.toe r.toe"
        ),
        is_y_down=True,
    ),
    # Stereolabs' ZED SDK, BODY_34_PARTS and BODY_38_PARTS.
    "zed34": Layout(
        "ZED 34",
        _parts(
            "- - chest - - l.shoulder l.elbow l.wrist l.hand - l.thumb - r.shoulder r.elbow r.wrist r.hand - "
            "r.thumb l.hip l.knee l.ankle l.toe r.hip r.knee r.ankle r.toe - nose l.eye l.ear r.eye r.ear - -"
        ),
    ),
    "zed38": Layout(
        "ZED 38",
        _parts(
            "- - - chest - nose l.eye r.eye l.ear r.ear - - l.shoulder r.shoulder l.elbow r.elbow l.wrist "
            "r.wrist l.hip r.hip l.knee r.knee l.ankle r.ankle l.toe r.toe - - - - - - l.index r.index - - "
            "l.little r.little"
        ),
    ),
}
BY_COUNT = {len(layout.parts): name for name, layout in LAYOUTS.items() if name != "h36m"}
