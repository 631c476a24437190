"""docs/configuration.md is what the models say, and its examples are files that the box reads."""

from __future__ import annotations

import re
from pathlib import Path

from appliance.pose.bvh import write_bvh
from appliance.show.box import load_box
from appliance.show.reference import reference
from appliance.show.show import load_show
from tests.show.conftest import recording

PAGE = Path(__file__).resolve().parents[2] / "docs" / "configuration.md"


def test_the_page_is_not_stale() -> None:
    made = "python -m appliance.show.reference > docs/configuration.md"
    assert PAGE.read_text(encoding="utf-8") == reference(), f"docs/configuration.md is stale. Run: {made}"


def test_its_examples_are_accepted(bundle: Path) -> None:
    show_example, box_example = re.findall(r"```yaml\n(.*?)```", reference(), re.DOTALL)
    (bundle / "box.yaml").write_text(box_example)
    box = load_box(bundle / "box.yaml")
    assert (len(box.outputs.osc), len(box.outputs.dmx), len(box.outputs.posistagenet)) == (2, 2, 1)
    (bundle / "show.yaml").write_text(show_example.replace("head", "chest"))
    write_bvh(bundle / "quiet.bvh", recording(20))
    config = load_show(bundle).config
    assert (len(config.hands), len(config.cues), len(config.looks)) == (2, 2, 2)
    assert (len(config.lights.fixtures), len(config.lights.mappings)) == (2, 1)
