"""A camera makes a live dancer: MediaPipe's landmarks of one person, sent to the box as OSC.

    python mediapipe_dancer.py --to 10.0.0.5 --camera 0

Copy this one file to the machine with the camera; it needs `pip install mediapipe opencv-python` and no
part of Bunraku. MediaPipe 0.10.14 brings its network along. MediaPipe 1.2 does not: give it a pose landmarker
(a .task file, from MediaPipe's page of models) with `--model FILE`.
"""

from __future__ import annotations

import argparse
import importlib
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


def pictures(source: str) -> Iterator[Any]:
    """A camera's pictures, by its number, or a file's; RGB."""
    cv2 = importlib.import_module("cv2")
    camera = cv2.VideoCapture(int(source) if source.isdigit() else source)
    if not camera.isOpened():
        sys.exit(f"The camera or file {source} cannot be opened.")
    while (taken := camera.read())[0]:
        yield cv2.cvtColor(taken[1], cv2.COLOR_BGR2RGB)


def main() -> None:
    """Send until the pictures end, or Ctrl-C."""
    as_written = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=as_written)
    parser.add_argument("--to", required=True, metavar="ADDRESS", help="the box's address")
    parser.add_argument("--port", type=int, default=9002, help="the box's control port (9002)")
    parser.add_argument("--camera", default="0", help="number of the camera, or a video file")
    parser.add_argument("--model", metavar="FILE", help="a pose landmarker (.task)")
    given = parser.parse_args()
    find, begun, sent, missed = landmarker(given.model), time.monotonic(), 0, 0
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for picture in pictures(given.camera):
        found = find(picture, int(1000 * (time.monotonic() - begun)))
        if found is None:
            missed += 1
        else:
            out.sendto(packet(found), (given.to, given.port))
            sent += 1
        if (sent + missed) % 100 == 1:
            print(f"{sent} poses sent; nobody seen in {missed} pictures.", flush=True)
    print(f"The pictures ended. {sent} poses sent; nobody seen in {missed} pictures.")


if __name__ == "__main__":
    main()
