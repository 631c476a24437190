"""Packing a show bundle: network, skeleton, phrase, show.yaml, report and checksums in one folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from appliance.pose.bvh import write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.show.bundle import write_checksums

PHRASE_DIGITS = 4  # of degrees and centimetres: below what any eye or projector resolves


def write_skeleton(folder: Path, skeleton: Skeleton, still_pose: NDArray[np.floating]) -> Path:
    """skeleton.bvh: the hierarchy and one frame, the pose in which the still joints stand."""
    rest = Recording(skeleton, still_pose[None], np.zeros((1, 3)), 50.0)
    write_bvh(folder / "skeleton.bvh", rest)
    return folder / "skeleton.bvh"


def write_phrase(folder: Path, phrase: Recording, name: str = "phrase.bvh") -> Path:
    """A phrase at 50 Hz."""
    write_bvh(folder / name, replace(phrase.resampled(50.0), fps=50.0), digits=PHRASE_DIGITS)
    return folder / name


def write_show_yaml(
    folder: Path, name: str, hands: list[dict[str, Any]], acknowledgement: str = "", **dancer: int
) -> Path:
    """show.yaml with what the artist will want to change; refuses to overwrite the artist's own."""
    path = folder / "show.yaml"
    if path.exists():
        return path
    show: dict[str, Any] = {"name": name}
    if acknowledgement:
        show["acknowledgement"] = acknowledgement
    show["dancer"] = {"network": "puppet.onnx", **dancer}
    show["motion"] = {"phrase": "phrase.bvh"}
    show["hands"] = hands
    path.write_text(yaml.safe_dump(show, sort_keys=False, allow_unicode=True, width=100), encoding="utf-8")
    return path


def seal(folder: Path) -> None:
    """Write the checksums over all that is in the bundle."""
    write_checksums(folder)
