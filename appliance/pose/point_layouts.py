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


_SIDES = {"l.": ("left",), "r.": ("right",), "*.": ("left", "right")}
_LIMBS = {"arm": ("shoulder", "elbow", "wrist"), "leg": ("hip", "knee", "ankle")}


def _parts(words: str) -> tuple[str, ...]:
    """'-' says nothing; l. and r. are left and right, *. is both in turn; arm and leg have three points."""
    found: list[str] = []
    for word in words.split():
        sides, part = _SIDES.get(word[:2], ("",)), word[2:] if word[:2] in _SIDES else word.strip("-")
        found += [f"{side} {one}".strip() for side in sides for one in _LIMBS.get(part, (part,))]
    return tuple(found)


_KINECT = (
    *_parts("- - chest - - l.arm l.hand - l.thumb - r.arm r.hand - r.thumb"),
    *_parts("l.leg l.toe r.leg r.toe - nose l.eye l.ear r.eye r.ear"),
)
LAYOUTS = {
    # The order of COCO's key points (cocodataset.org), as most camera networks have it.
    "coco": Layout("COCO", _parts("nose *.eye *.ear *.shoulder *.elbow *.wrist *.hip *.knee *.ankle")),
    # Human3.6M's 17 joints, as networks send them that lift a picture's points into the room.
    "h36m": Layout("Human3.6M", _parts("- r.leg l.leg chest - nose head l.arm r.arm")),
    # Azure Kinect Body Tracking SDK, k4abt_joint_id_t.
    "kinect": Layout("Azure Kinect", _KINECT, is_y_down=True),
    # MediaPipe's pose landmarks (BlazePose GHUM).
    "mediapipe": Layout(
        "MediaPipe",
        _parts(
            "nose - l.eye - - r.eye - *.ear - - *.shoulder *.elbow *.wrist *.little *.index - - "
            "*.hip *.knee *.ankle - - *.toe"
        ),
        is_y_down=True,
    ),
    # Stereolabs' ZED SDK, BODY_34_PARTS and BODY_38_PARTS.
    "zed34": Layout("ZED 34", (*_KINECT, "", "")),
    "zed38": Layout(
        "ZED 38",
        _parts(
            "- - - chest - nose *.eye *.ear - - *.shoulder *.elbow *.wrist *.hip *.knee *.ankle *.toe "
            "- - - - - - *.index - - *.little"
        ),
    ),
}
BY_COUNT = {len(layout.parts): name for name, layout in LAYOUTS.items() if name != "h36m"}

# OpenPose's models, which come as files: BODY_25, and COCO with a neck.
IN_FILES = {
    "body25": Layout(
        "OpenPose BODY_25",
        _parts("nose - r.arm l.arm - r.leg l.leg r.eye l.eye r.ear l.ear l.toe - - r.toe - -"),
        is_y_down=True,
    ),
    "openpose-coco": Layout(
        "OpenPose COCO", _parts("nose - r.arm l.arm r.leg l.leg r.eye l.eye r.ear l.ear"), is_y_down=True
    ),
}
