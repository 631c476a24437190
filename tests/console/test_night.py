"""Pictures of the night: one is drawn from a frame, kept, and gone after a night."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree

from appliance.console.box_view import BoxView
from appliance.console.night import KEEP_S, Night
from appliance.console.stage_view import StageView
from appliance.outputs.frame_layout import BROWSER_HEAD

PARENTS = [-1, 0, 1]
FALLEN = {"name": "receiver-gone", "about": "<10.0.0.9>", "active": True}


class Seen:
    """A stage's newest frame, and what the page tells."""

    def __init__(self, frame: bytes) -> None:
        self.with_ghost, self.facts = frame, {"parents": PARENTS}
        self.value: dict[str, Any] = {
            "sensors": [],
            "fallbacks": [FALLEN],
            "status": {"show": "A & B", "state": "dancing", "cue": "", "rate_hz": 50.0, "late": 0},
        }


def night(folder: Path, frame: bytes) -> Night:
    seen = Seen(frame)
    return Night(cast(StageView, seen), cast(BoxView, seen), folder)


def frame() -> bytes:
    """Three joints one above the other, as browsers get them."""
    world, places = [1.0, 0, 0, 0] * 3, [0.0, 1.0, 0, 0, 1.5, 0, 0, 2.0, 0]
    return BROWSER_HEAD.pack(7.0, 0, 3) + struct.pack("<24f", *world, *places, *[0.0] * 3)


def test_a_picture_has_the_bones_and_the_words(tmp_path: Path) -> None:
    drawn = ElementTree.fromstring(night(tmp_path, frame()).picture(0.0))
    bones = [one for one in drawn.iter() if one.tag.endswith("path")][1:]
    assert [one.get("d") for one in bones] == ["M320.0 135.0L320.0 220.0", "M320.0 50.0L320.0 135.0"]
    text = " ".join(one.text or "" for one in drawn.iter() if one.tag.endswith("text"))
    assert "A & B  dancing" in text and "receiver-gone <10.0.0.9>" in text


def test_without_a_frame_there_are_only_words(tmp_path: Path) -> None:
    for spoilt in (b"", b"short", BROWSER_HEAD.pack(7.0, 0, 9) + b"1234"):
        drawn = ElementTree.fromstring(night(tmp_path, spoilt).picture(0.0))
        assert len([one for one in drawn.iter() if one.tag.endswith("path")]) == 1, "the floor"


def test_pictures_of_a_night_are_kept_and_older_ones_go(tmp_path: Path) -> None:
    pictures = night(tmp_path, frame())
    for now in (1000.0, 1060.0, 1000.0 + KEEP_S + 30.0):
        pictures.keep(now)
    assert pictures.times() == [1060, int(1030 + KEEP_S)]
