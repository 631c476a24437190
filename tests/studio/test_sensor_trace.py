"""A worn sensor's trace, as CSV, for the experiments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.studio.data.dataset import FPS
from appliance.studio.experiments.experiment import read_trace
from appliance.studio.studio_error import StudioError


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seconds,w,x,y,z\n0,1,0,0\n", "line 2: a row has seconds and a quaternion"),
        ("0,1,0,0,0\n0.02,0,0,0,0\n", "line 2"),
        ("0,1,0,0,0\n0.02,nan,0,0,0\n", "line 2"),
        ("0.02,1,0,0,0\n0.01,1,0,0,0\n", "line 2: 0.01 s comes after 0.02 s"),
        ("", "has no trace"),
    ],
)
def test_a_wrong_trace_is_told_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "trace.csv"
    file.write_text(text)
    with pytest.raises(StudioError, match=message):
        read_trace(file)


@pytest.mark.parametrize(("first", "encoding"), [("seconds,w,x,y,z\n", "utf-8"), ("", "utf-8-sig")])
def test_a_trace_is_read_at_the_ticks(first: str, encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "trace.csv"
    times = np.arange(0, 2, 0.01)
    half = np.radians(45 * times)
    rows = [f"{t},{np.cos(h)},{np.sin(h)},0,0" for t, h in zip(times, half, strict=True)]
    file.write_text(first + "\r\n".join(rows) + "\r\n\r\n", encoding)
    found = read_trace(file)
    assert len(found) == 100
    np.testing.assert_allclose(2 * np.degrees(np.arccos(found[:, 0])), 90 * np.arange(100) / FPS, atol=0.05)
