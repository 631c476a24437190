"""Packing a show bundle: network, skeleton, phrase, show.yaml, report and checksums in one folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from appliance.exchange.glb_body import write_body
from appliance.pose.body_facts import with_stance
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton

SKELETON, PHRASE, SHOW = "skeleton.bvh", "phrase.bvh", "show.yaml"
PHRASE_DIGITS = 4  # in degrees and centimetres: finer than any eye or projector resolves


def write_skeleton(folder: Path, skeleton: Skeleton, still_pose: NDArray[np.floating]) -> Path:
    """skeleton.bvh: the hierarchy and one frame, the pose in which the still joints stand."""
    rest = Recording(skeleton, still_pose[None], np.zeros((1, 3)), 50.0)
    write_bvh(folder / SKELETON, rest)
    return folder / SKELETON


def write_phrase(folder: Path, phrase: Recording, name: str = PHRASE) -> Path:
    """A phrase at 50 Hz."""
    write_bvh(folder / name, replace(phrase.resampled(50.0), fps=50.0), digits=PHRASE_DIGITS)
    return folder / name


def write_show_yaml(
    folder: Path,
    name: str,
    hands: list[dict[str, Any]],
    acknowledgement: str = "",
    phrase: str = "the show's phrase",
    has_feet: bool = True,
) -> Path:
    """show.yaml with what the artist will want to change; refuses to overwrite the artist's own.

    phrase: what phrase.bvh is, in words.
    """
    path = folder / SHOW
    if not path.exists():
        text = f"name: {_flow(name)}\n"
        if acknowledgement:
            text += yaml.safe_dump({"acknowledgement": acknowledgement}, allow_unicode=True, width=100)
        text += _TEMPLATE.replace("PHRASE", " ".join(phrase.split()))
        text = text.replace("GROUNDED\n", "" if has_feet else _GROUNDED)
        text = text.replace("HANDS", "\n".join(_hand(hand) for hand in hands))
        path.write_text(text.replace("HELD", _flow([hand["joint"] for hand in hands])), encoding="utf-8")
    return path


def _hand(hand: dict[str, Any]) -> str:
    """A hand as an item of a YAML list."""
    lines = [f"{key}: {_flow(value)}" for key, value in hand.items()]
    if "at_neutral" in hand:
        lines[-1] += "   # a dancer who stands still lets the arm hang"
    return "  - " + "\n    ".join(lines)


def _flow(value: Any) -> str:
    """A value on one line of YAML."""
    dumped = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10_000)
    return dumped.removesuffix("\n").removesuffix("\n...")


_GROUNDED = "  grounded: false              # no joint is named foot or ankle: nothing stands on the floor\n"
_TEMPLATE = """
dancer:
  network: puppet.onnx
  coding_iterations: 10        # more: away from the phrase, towards the dancer's habits
  interaction_iterations: 9    # the last pass is free, so nothing mirrors the hand
  hop: 1

motion:
  phrase: phrase.bvh           # PHRASE
GROUNDED

hands:
HANDS

looks:                         # the first one is shown at the start; more: docs/configuration.md
  - {name: plaster, style: plaster}
  - {name: lines, style: lines, camera: {move: orbit}}
  - {name: ink, style: ink}
  - {name: cloud, style: cloud, camera: {move: orbit, period_s: 120}}
  - {name: veil, style: veil}

cues:                          # /cue opening, or /cue alone for the next one; what is left out stays as it is
  - name: opening
    iterations: [10, 9]
    hands: HELD
    look: plaster
    master: 1
    fade_s: 3
  - name: threads              # nearer to the phrase: fewer passes of the puppet
    iterations: [4, 3]
    look: lines
  - name: alone                # the hand lets go: the puppet dances alone
    iterations: [10, 9]
    hands: []
    look: cloud
    fade_s: 4
  - name: finale
    hands: HELD
    look: veil
    fade_s: 6
"""


def write_surface(folder: Path) -> None:
    """The surface of the body whose skeleton is in the bundle."""
    write_body(folder, with_stance(read_bvh(folder / SKELETON)))
