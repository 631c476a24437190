"""Pictures of the night: one is drawn from a frame, kept, and gone after a night."""

from __future__ import annotations

import base64
import io
import struct
import time
from pathlib import Path
from typing import Any, cast
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

import appliance.console.night
from appliance.console.box_view import BoxView
from appliance.console.night import KEEP_S, Night
from appliance.console.stage_view import StageView
from appliance.outputs.frame_layout import BROWSER_HEAD
from appliance.projector.seen_wall import SeenWall

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
    return Night(cast(StageView, seen), cast(BoxView, seen), folder, folder)


def frame() -> bytes:
    """Three joints one above the other, as browsers get them."""
    world, places = [1.0, 0, 0, 0] * 3, [0.0, 1.0, 0, 0, 1.5, 0, 0, 2.0, 0]
    return BROWSER_HEAD.pack(7.0, 0, 3) + struct.pack("<24f", *world, *places, *[0.0] * 3)


def test_a_picture_has_the_bones_and_the_words(tmp_path: Path) -> None:
    drawn = ElementTree.fromstring(night(tmp_path, frame()).picture(0.0))
    bones = [one for one in drawn.iter() if one.tag.endswith("path")][1:]
    assert not list(drawn.iter("{http://www.w3.org/2000/svg}image"))
    assert [one.get("d") for one in bones] == ["M320.0 135.0L320.0 220.0", "M320.0 50.0L320.0 135.0"]
    text = " ".join(one.text or "" for one in drawn.iter() if one.tag.endswith("text"))
    assert "A & B  dancing" in text and "receiver-gone <10.0.0.9>" in text


def test_without_a_frame_there_are_only_words(tmp_path: Path) -> None:
    for spoilt in (b"", b"short", BROWSER_HEAD.pack(7.0, 0, 9) + b"1234"):
        drawn = ElementTree.fromstring(night(tmp_path, spoilt).picture(0.0))
        assert not [one for one in drawn.iter() if one.tag.endswith("path")]


def test_pictures_of_a_night_are_kept_and_older_ones_go(tmp_path: Path) -> None:
    pictures = night(tmp_path, frame())
    for now in (1000.0, 1060.0, 1000.0 + KEEP_S + 30.0):
        pictures.keep(now)
    assert pictures.times() == [1060, int(1030 + KEEP_S)]


def test_a_picture_is_of_the_wall_while_a_projector_shows_it(tmp_path: Path) -> None:
    pictures = night(tmp_path, frame())
    wall = SeenWall(tmp_path)
    wall.offer(0.0, (960, 540), lambda: bytes([200, 40, 10, 255]) * (960 * 540 // 2) + bytes(960 * 540 * 2))
    assert wall._writing is not None
    wall._writing.join()
    drawn = ElementTree.fromstring(pictures.picture(time.time()))
    (image,) = drawn.iter("{http://www.w3.org/2000/svg}image")
    jpeg = base64.b64decode(image.attrib["href"].partition("base64,")[2])
    shown = Image.open(io.BytesIO(jpeg))
    assert shown.size == (480, 270) and len(jpeg) < 30_000
    bottom, top = shown.getpixel((240, 250)), shown.getpixel((240, 20))
    assert np.allclose(bottom, (200, 40, 10), atol=12) and np.allclose(top, 0, atol=12), "upright"
    old = ElementTree.fromstring(pictures.picture(time.time() + 60.0))
    assert not list(old.iter("{http://www.w3.org/2000/svg}image")), "of a projector that hangs"
    wall.close()
    assert not list(
        ElementTree.fromstring(pictures.picture(time.time())).iter("{http://www.w3.org/2000/svg}image")
    )


def test_the_pictures_take_no_more_room_than_they_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = night(tmp_path, frame())
    size = len(pictures.picture(0.0))
    monkeypatch.setattr(appliance.console.night, "MOST_BYTES", int(3.5 * size))
    for minute in range(6):
        pictures.keep(1000.0 + 60.0 * minute)
    assert pictures.times() == [1180, 1240, 1300]
