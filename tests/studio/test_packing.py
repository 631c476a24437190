"""show.yaml of a trained show: as rich as the default show's, whatever joints are called; own files."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from appliance.show.bundle import default_show_path
from appliance.studio.data.catalogue import recordings_in
from appliance.studio.data.dataset import load_dataset
from appliance.studio.evaluation.findings import few_data
from appliance.studio.export.packing import write_show_yaml
from tests.studio.tiny import write_recordings


@pytest.mark.parametrize(
    "joint", ["lShldr", "mixamorig:LeftArm", "Bip01 L UpperArm", "no", "Skeleton 001:Arm"]
)
def test_the_show_has_what_the_default_show_has(tmp_path: Path, joint: str) -> None:
    hand = {"sensor": "left-wrist", "joint": joint, "at_neutral": [0.766, 0.0, 0.0, -0.643]}
    path = write_show_yaml(tmp_path, "Anna: one", [hand], "Danced by Anna # and Bert.", "made of\nanna.bvh")
    text = path.read_text(encoding="utf-8")
    found, given = yaml.safe_load(text), yaml.safe_load((default_show_path() / "show.yaml").read_text())
    assert set(found) == set(given) - {"springs", "strings"}
    assert found["name"] == "Anna: one" and found["acknowledgement"] == "Danced by Anna # and Bert."
    assert found["hands"] == [hand]
    assert found["dancer"] == given["dancer"] and found["looks"] == given["looks"]
    assert found["cues"][0]["hands"] == [joint] and found["cues"][-1]["hands"] == [joint]
    assert "# made of anna.bvh" in text and text.count("#") > 8
    path.write_text("name: mine\n")
    write_show_yaml(tmp_path, "other", [hand])
    assert path.read_text() == "name: mine\n"


def test_a_show_s_own_phrase_is_no_recording(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "dancer")
    before = recordings_in(folder)
    (folder / "phrase.bvh").write_text("HIERARCHY")
    assert folder / "phrase.bvh" in recordings_in(folder)
    (folder / "checkpoint.pt").touch()
    (folder / "skeleton.bvh").write_text("HIERARCHY")
    assert recordings_in(folder) == before
    assert "2 minutes of dance are enough to begin with" in few_data(load_dataset(folder))[0]
