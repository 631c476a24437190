"""Shows of two phrases with two hands and cues, and the box that they are danced on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from tests.bundles import swaying_phrase, write_show

BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
NOW = 1000.0
HANDS: list[dict[str, object]] = [
    {"fixed": {"orientation": [0, 1, 0, 0]}, "joint": "lShldr"},
    {"osc": True, "joint": "Chest"},
]


def write_show_with_phrase(
    folder: Path, name: str, phrase: Recording, cues: Sequence[dict[str, Any]]
) -> Path:
    """A show with both hands that has a second phrase, of this name, and these cues."""
    write_show(folder, HANDS)
    write_bvh(folder / f"{name}.bvh", phrase)
    values = yaml.safe_load((folder / "show.yaml").read_text())
    values |= {"motion": {"phrases": {name: f"{name}.bvh"}}, "cues": list(cues)}
    (folder / "show.yaml").write_text(yaml.safe_dump(values))
    return folder


def walking() -> Recording:
    """Turns and walks away, so that place and heading on the stage grow with each loop."""
    phrase = swaying_phrase(5.0)
    time_s = np.arange(len(phrase)) / 50
    poses = phrase.poses.copy()
    poses[:, 0] = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.3 * time_s)
    return replace(phrase, poses=poses, roots=phrase.roots + np.outer(time_s, [0.4, 0.0, 0.1]))
