"""A cue is written into show.yaml, and nothing else in it changes."""

from __future__ import annotations

import pytest
import yaml

from appliance.show.bundle import default_show_path
from appliance.show.yaml_edit import with_cue

CUE = {
    "name": "anna: 'still'",
    "phrase": "vary",
    "motion": {"vary": {"sigma": 1.25, "seed": 12}},
    "hands": [],
}
HEAD = "name: One   # of many\ndancer: {network: puppet.onnx}\n"


@pytest.mark.parametrize(
    ("cues", "rest"),
    [
        ("", ""),
        ("cues: []\n", "master: 1\n"),
        ("cues: [{name: a}]  # short\n", "looks: []\n"),
        ("cues:\n- name: a\n  master: 1   # full\n- {name: b}\n", ""),
        ("cues:   # by word\n    - name: a\n\n    - name: b   # last\n", "\n# about looks\nlooks: []\n"),
    ],
)
@pytest.mark.parametrize("end", ["\n", ""])
def test_it_comes_last_and_all_else_stays(cues: str, rest: str, end: str) -> None:
    text = (HEAD + cues + rest).removesuffix("\n") + end
    written = with_cue(text, CUE)
    before, after = yaml.safe_load(text), yaml.safe_load(written)
    assert after.pop("cues") == [*(before.pop("cues", None) or []), CUE]
    assert after == before
    for comment in ("# of many", "# short", "# full", "# by word", "# last", "# about looks"):
        assert (comment in written) == (comment in text)
    assert yaml.safe_load(with_cue(written, {"name": "two"}))["cues"][-2:] == [CUE, {"name": "two"}]


def test_the_show_that_comes_with_the_box_gains_one_line() -> None:
    text = (default_show_path() / "show.yaml").read_text()
    old, new = text.splitlines(), with_cue(text, CUE).splitlines()
    (added,) = [line for line in new if line not in old]
    assert added.startswith("  - {name: ") and [line for line in new if line != added] == old


@pytest.mark.parametrize("text", ["", "- a\n", "{name: a}\n", "cues: 3\n"])
def test_what_is_no_show_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"no show\.yaml|no list"):
        with_cue(text, CUE)
