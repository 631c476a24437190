"""The example that makes a camera a live dancer: what it sends moves a figure at the real control port."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import sys
from contextlib import closing
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from appliance.box.live_pose import LivePoseReader
from appliance.levers.sources import LIVE
from appliance.pose.bvh import read_bvh
from appliance.pose.point_layouts import LAYOUTS
from appliance.show_control.packet import messages_in
from appliance.studio.exchange.landmarks_file import read_landmarks
from tests.conftest import ROOT
from tests.pose.landmarks import Landmarks
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts, until
from tools.mediapipe_dancer import frame_of, packet

PARTS = LAYOUTS["mediapipe"].parts


@dataclass
class Landmark:
    x: float
    y: float
    z: float
    visibility: float | None = 0.9


def landmarks() -> list[Landmark]:
    """A person that stands before the camera, as MediaPipe's world landmarks: Y down, from the hips."""
    skeleton = read_bvh(files("appliance.show").joinpath("default_show", "skeleton.bvh")).skeleton
    seen = np.nan_to_num(Landmarks(skeleton).seen(PARTS, skeleton.standing, np.zeros(3)), nan=0.1)
    return [Landmark(x, -y, -z) for x, y, z in seen.tolist()]


def test_its_packet_moves_a_figure_and_hidden_points_leave_their_bones_to_the_phrase(tmp_path: Path) -> None:
    skeleton = read_bvh(files("appliance.show").joinpath("default_show", "skeleton.bvh")).skeleton
    hidden = landmarks()
    hidden[PARTS.index("left wrist")].visibility = 0.1
    hidden[PARTS.index("left hip")].visibility = 0.0  # always sent
    show = replace(facts(), skeleton=skeleton, phrases=("main", LIVE))
    with StageDouble(tmp_path, show), closing(LivePoseReader(tmp_path)) as reader:
        control = ControlInThread(tmp_path)
        asker = Asker(control.port)
        with contextlib.ExitStack() as ends:
            ends.callback(control.close)
            ends.callback(asker.close)
            asker.ask("/ping")
            for one, is_known in ((landmarks(), True), (hidden, False)):

                def came(one: list[Landmark] = one, is_known: bool = is_known) -> bool:
                    asker.socket.send(packet(one))
                    if (heard := reader.read()) is None:
                        return False
                    known = np.isfinite(np.frombuffer(heard.rotations, np.float32).reshape(-1, 4)).all(axis=1)
                    right, left = (skeleton.roles[f"{side} forearm"] for side in ("right", "left"))
                    return bool(known[right]) and bool(known[left]) == is_known

                until(came)


def test_its_packet_names_the_layout_and_is_osc() -> None:
    (message,) = messages_in(packet(landmarks()))
    assert message[0] == "/mocap/0/joint/pos_world" and message[1][0] == "mediapipe"
    assert len(message[1]) == 1 + 3 * len(PARTS)
    hidden = landmarks()
    hidden[0].visibility, hidden[1].visibility = 0.0, None
    numbers = messages_in(packet(hidden))[0][1][1:]
    assert [math.isnan(one) for one in numbers[:6]] == [True] * 3 + [False] * 3
    with pytest.raises(ValueError, match="33 landmarks"):
        packet(landmarks()[:17])


def test_what_it_saves_is_what_import_reads(tmp_path: Path) -> None:
    """Also a frame in which nobody was seen, and landmarks of which MediaPipe does not say how visible."""
    for one in (seen := landmarks()):
        one.visibility = None
    reported = [frame_of(seen, 0.0), frame_of(None, 0.033), frame_of(seen, 0.066)]
    (tmp_path / "dance.json").write_text(json.dumps({"frames": reported}))
    read = read_landmarks(tmp_path / "dance.json")
    assert read.times.tolist() == [0.0, 0.033, 0.066] and not read.is_flat
    assert np.isnan(read.points[1]).all() and read.seen[0].min() == 1.0
    np.testing.assert_allclose(read.points[2, PARTS.index("left wrist"), 0], seen[15].x)


def test_it_runs_by_itself_without_bunraku_or_mediapipe(tmp_path: Path) -> None:
    """The file is copied to another machine: its help needs nothing but Python."""
    script = tmp_path / "mediapipe_dancer.py"
    script.write_bytes((ROOT / "tools" / "mediapipe_dancer.py").read_bytes())
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(script), "--help"], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0 and "--camera" in done.stdout, done.stderr


def test_a_file_for_which_there_is_no_folder_is_refused_before_the_video(tmp_path: Path) -> None:
    script, out = ROOT / "tools" / "mediapipe_dancer.py", tmp_path / "no" / "dance.json"
    asked = [sys.executable, str(script), "--camera", "dance.mp4", "--save", str(out)]
    result = subprocess.run(asked, capture_output=True, text=True)
    assert result.returncode == 2 and "there is no folder" in result.stderr
