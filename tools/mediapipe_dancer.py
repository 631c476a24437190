"""A camera makes a live dancer: MediaPipe's landmarks of one person, sent to the box as OSC, or saved.

    python mediapipe_dancer.py --to 10.0.0.5 --camera 0
    python mediapipe_dancer.py --camera dance.mp4 --save dance.json

The second one is for `bunraku import dance.json --out dance.bvh`.

Copy this one file to the machine with the camera; it needs `pip install mediapipe opencv-python` and no
part of Bunraku. MediaPipe 0.10.14 brings its network along. MediaPipe 1.2 does not: give it a pose landmarker
(a .task file, from MediaPipe's page of models) with `--model FILE`.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import math
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

ADDRESS, LAYOUT = "/mocap/0/joint/pos_world", "mediapipe"
POINTS = 33
TRUNK = (11, 12, 23, 24)  # shoulders and hips: always sent, as the network guesses where they are hidden
LEAST_VISIBLE = 0.3  # below this a point is sent as not seen: its bones stay with the phrase


def packet(landmarks: Sequence[Any], least_visible: float = LEAST_VISIBLE) -> bytes:
    """One OSC message: the layout's name, then x, y, z of all landmarks in metres; not seen: no numbers.

    landmarks: MediaPipe's world landmarks, with x, y, z and visibility. Raises ValueError unless 33 come.
    """
    if len(landmarks) != POINTS:
        raise ValueError(f"MediaPipe has {POINTS} landmarks of a pose, and {len(landmarks)} came.")
    numbers: list[float] = []
    for number, one in enumerate(landmarks):
        is_seen = number in TRUNK or one.visibility is None or one.visibility >= least_visible
        numbers += (one.x, one.y, one.z) if is_seen else (math.nan,) * 3
    head = b"".join(_padded(text.encode()) for text in (ADDRESS, f",s{'f' * len(numbers)}", LAYOUT))
    return head + struct.pack(f">{len(numbers)}f", *numbers)


def _padded(text: bytes) -> bytes:
    return text + bytes(4 - len(text) % 4)


def landmarker(model: str | None) -> Callable[[Any, int], Sequence[Any] | None]:
    """From a picture (RGB, uint8) and its time in milliseconds to the world landmarks of one person."""
    mediapipe = importlib.import_module("mediapipe")
    if model is None:
        if not hasattr(mediapipe, "solutions"):
            sys.exit(f"MediaPipe {mediapipe.__version__} brings no network along. Give one with --model.")
        pose = mediapipe.solutions.pose.Pose()

        def packed(picture: Any, _: int) -> Sequence[Any] | None:
            found = pose.process(picture).pose_world_landmarks
            return None if found is None else list(found.landmark)

        return packed
    if not Path(model).is_file():
        sys.exit(f"There is no file {model}.")
    tasks, vision = mediapipe.tasks, importlib.import_module("mediapipe.tasks.python.vision")
    options = vision.PoseLandmarkerOptions(
        base_options=tasks.BaseOptions(model_asset_path=model), running_mode=vision.RunningMode.VIDEO
    )
    pose = vision.PoseLandmarker.create_from_options(options)

    def given(picture: Any, milliseconds: int) -> Sequence[Any] | None:
        image = mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=picture)
        found = pose.detect_for_video(image, milliseconds).pose_world_landmarks
        return found[0] if found else None

    return given


def pictures(source: str) -> Iterator[tuple[Any, float]]:
    """A camera's pictures, by its number, or a file's, RGB; and its second: of a file as it was filmed."""
    cv2 = importlib.import_module("cv2")
    camera, begun = cv2.VideoCapture(int(source) if source.isdigit() else source), time.monotonic()
    if not camera.isOpened():
        sys.exit(f"The camera or file {source} cannot be opened.")
    while (taken := camera.read())[0]:
        at = time.monotonic() - begun if source.isdigit() else camera.get(cv2.CAP_PROP_POS_MSEC) / 1000
        yield cv2.cvtColor(taken[1], cv2.COLOR_BGR2RGB), at


def frame_of(found: Sequence[Any] | None, at: float) -> dict[str, Any]:
    """A frame of the file: its second, and x, y, z, visibility of each landmark; nobody seen: none."""
    seen = [] if found is None else found
    return {"time": round(at, 4), "world": [[one.x, one.y, one.z, one.visibility] for one in seen]}


def main() -> None:
    """Send or save until the pictures end, or Ctrl-C."""
    as_written = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=as_written)
    parser.add_argument("--to", metavar="ADDRESS", help="the box's address")
    parser.add_argument("--save", metavar="FILE", help="write the landmarks into this JSON file instead")
    parser.add_argument("--port", type=int, default=9002, help="the box's control port (9002)")
    parser.add_argument("--camera", default="0", help="number of the camera, or a video file")
    parser.add_argument("--model", metavar="FILE", help="a pose landmarker (.task)")
    given = parser.parse_args()
    if (given.to is None) == (given.save is None):
        parser.error("give --to ADDRESS or --save FILE")
    if given.save and not Path(given.save).resolve().parent.is_dir():
        parser.error(f"there is no folder for {given.save}")
    find, sent, missed, frames = landmarker(given.model), 0, 0, list[dict[str, Any]]()
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with contextlib.suppress(KeyboardInterrupt):
        for picture, at in pictures(given.camera):
            found = find(picture, int(1000 * at))
            missed += found is None
            sent += found is not None
            if given.save:
                frames.append(frame_of(found, at))
            elif found is not None:
                out.sendto(packet(found), (given.to, given.port))
            if (sent + missed) % 100 == 1:
                print(f"{sent} poses; nobody seen in {missed} pictures.", flush=True)
    if given.save:
        Path(given.save).write_text(json.dumps({"frames": frames}), encoding="utf-8")
    print(f"The pictures ended. {sent} poses; nobody seen in {missed} pictures.")


if __name__ == "__main__":
    main()
