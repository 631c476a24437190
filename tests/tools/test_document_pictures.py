"""The pictures of the documents: what they must show, whatever the dancer and the measurement are."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from appliance.levers.status import Status
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.show.bundle import default_show_path
from tools import certificate_picture
from tools.certificate_picture import NOTES, note_of
from tools.joints_picture import FINGERS, draw_joints
from tools.loop_picture import HANG, SECONDS, arm_at
from tools.page_pictures import at_rest, run_of_the_evening


def test_the_arm_of_the_loop_hangs_at_its_start_and_comes_round() -> None:
    hanging = quaternion.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.radians(HANG))
    assert abs(float(arm_at(0.0) @ hanging)) == pytest.approx(1.0)
    assert abs(float(arm_at(SECONDS) @ arm_at(0.0))) == pytest.approx(1.0)
    assert abs(float(arm_at(SECONDS / 4) @ hanging)) < 0.7  # it has gone far away


def test_every_joint_but_fingers_and_eyes_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    text = ImageDraw.ImageDraw.text

    def noted(pen: ImageDraw.ImageDraw, at: tuple[float, float], message: str, **style: object) -> None:
        written.append(message)
        text(pen, at, message, **style)  # type: ignore[arg-type]

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", noted)
    assert Image.open(draw_joints(tmp_path / "joints.png")).size == (960, 760)
    names = read_bvh(default_show_path() / "skeleton.bvh").skeleton.names
    assert set(names) & set(written) == {name for name in names if not any(one in name for one in FINGERS)}


def test_the_pages_of_the_documents_are_of_a_box_at_rest() -> None:
    """However busy the machine was that took them; what is not of its load stays."""
    sensor = {
        "name": "left",
        "heard": True,
        "is_worn": True,
        "rate_hz": 41.0,
        "loss": 0.2,
        "round_trip_s": 0.3,
    }
    lost = {**sensor, "name": "right", "heard": False}
    status = Status(state="dancing", show="A", late=22, skipped=3, rate_hz=41.0, cue="storm", level=1.0)
    reported = {
        "frames": "fresh", "trouble": "", "time": 7.0, "since": 6.0, "status": status._asdict(),
        "fallbacks": [{"name": "tick-late", "active": True, "message": "Late."}],
        "processes": [{"process": "lights", "late": 4}], "sensors": [sensor], "verdict": {"level": "warning"},
    }  # fmt: skip
    rest = json.loads(at_rest(json.dumps(reported), 5000.0))
    assert (rest["verdict"]["level"], rest["verdict"]["values"]["rate"]) == ("well", 50.0)
    assert rest["status"]["cue"] == "storm" and not any(one["active"] for one in rest["fallbacks"])
    assert rest["sensors"][0]["loss"] == 0.0
    missing = json.loads(at_rest(json.dumps({**reported, "sensors": [sensor, lost]}), 5000.0))
    assert missing["verdict"]["key"] == "sensors_missing", "what is wrong with the box is still shown"
    nothing = json.dumps({**reported, "status": None})
    assert at_rest(nothing, 5000.0) == nothing


def test_header_and_journal_of_the_documents_tell_of_the_same_evening() -> None:
    """As many late ticks, and none after the time that the header names."""
    status = Status(state="dancing", show="A", rate_hz=50.0, level=1.0)
    reported = {"frames": "fresh", "trouble": "", "status": status._asdict(), "processes": [], "sensors": []}
    rest = json.loads(at_rest(json.dumps(reported), 5000.0))
    run = run_of_the_evening({}, 5000.0)
    (late,) = [place for place, count in enumerate(run["late"]) if count]
    assert rest["status"]["late"] == run["late"][late] > 0
    begun, since = run["begun"] + late * run["bin_s"], rest["verdict"]["values"]["since"]
    assert begun <= since <= begun + run["bin_s"]


def test_each_limit_of_a_measurement_has_its_own_note() -> None:
    page = certificate_picture.verdict(_figures())
    notes = [note_of(limit.label) for limit in page]
    assert len(set(notes)) == len(page)
    assert set(notes) == set(NOTES.values())


def test_a_limit_without_a_note_is_an_error() -> None:
    with pytest.raises(KeyError):
        note_of("brightness")


def _figures() -> dict[str, object]:
    """A measurement with every figure that has a limit."""
    percentiles = {"p50": 1.0, "p99": 1.0, "p999": 1.0, "max": 1.0}
    ways = ("transport_ms", "free_running_transport_ms", "response_ms", "tick_ms", "hand_to_light_ms")
    ways = (*ways, "hand_to_sound_ms")
    soon = ("power_on_to_reading_s", "restart_to_reading_s", "kill_to_reading_s")
    return {
        **dict.fromkeys((*ways, *soon), percentiles),
        "ticks": 100,
        "late_ticks": 0,
        "missing_frames": 0,
        "rss_mb": 90.0,
        "dance_to_light_ms": 45.0,
        "start_to_first_frame_s": 1.0,
        "firmware": False,
    }
