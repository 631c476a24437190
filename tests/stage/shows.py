"""Shows of two phrases with two hands and cues, and the box that they are danced on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from tests.bundles import write_show

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
