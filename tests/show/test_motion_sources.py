"""Sources that are made ahead in show.yaml: their networks, bounds and names, and what a cue changes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from appliance.show.config_error import ConfigError
from appliance.show.show import load_show
from tests.bundles import write_show
from tests.sources import write_show_with_sources


def test_a_source_whose_network_is_missing_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"show.yaml:\d+: .*no file 'sequence.onnx'"):
        load_show(write_show(tmp_path, motion={"vary": {"sigma": 1.0}}))


@pytest.mark.parametrize(
    ("motion", "why"),
    [
        ({"vary": {"sigma": 5.0}}, "4"),
        ({"source": "live"}, "starts from 'live'"),
        ({"source": "quiet"}, "starts from 'quiet'"),
        ({"granular": {"from": "main", "to": "quiet"}}, "no phrase 'quiet'"),
        ({"phrases": {"vary": "phrase.bvh"}}, "'vary' is what"),
        ({"kept": ["path"]}, "names something else"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, motion: dict[str, Any], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        load_show(write_show_with_sources(tmp_path, motion))


def test_a_cue_names_the_parameters_that_it_changes_and_no_others(tmp_path: Path) -> None:
    called = {"name": "again", "phrase": "anna"}
    kept = load_show(write_show_with_sources(tmp_path, {"kept": ["anna"]}, cues=[called]))
    assert kept.config.names["phrase"][-1] == "anna"
    cue = {"name": "wild", "phrase": "vary", "motion": {"vary": {"sigma": 2.0}}}
    show = load_show(write_show_with_sources(tmp_path, {"source": "granular"}, cues=[cue]))
    assert show.config.cues[0].model_dump(mode="json")["motion"] == {"vary": {"sigma": 2.0}}
    assert show.config.names["phrase"] == ("main", "vary", "granular", "path", "improvise")
    assert show.motion_networks["path"] == tmp_path / "pose.onnx"
    drawn: dict[str, Any] = {"path": {"points": [0.1, 0.9, 0.5, 0.5]}}
    show = load_show(write_show_with_sources(tmp_path, cues=[cue | {"motion": drawn}]))
    assert show.config.cues[0].model_dump(mode="json")["motion"] == drawn
    for points in ([0.5], [0.5, 1.5]):
        with pytest.raises(ConfigError, match="points"):
            wrong = {"path": {"points": points}}
            load_show(write_show_with_sources(tmp_path, cues=[cue | {"motion": wrong}]))
    with pytest.raises(ConfigError, match="sigma"):
        load_show(write_show_with_sources(tmp_path, cues=[cue | {"motion": {"vary": {"sigma": -1.0}}}]))
