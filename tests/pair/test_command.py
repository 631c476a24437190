"""`bunraku pair`: the secret, what is said of a pair, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from appliance.cli.pair import is_well, sentence
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.stage.paired import settings_of
from tests.system.processes import run_bunraku

TOLD = {
    "box": "first",
    "role": "leads",
    "peer": True,
    "ready": True,
    "same_show": True,
    "takeovers": 0,
    "epoch": 1,
}


def box_file(folder: Path, **keys: object) -> Path:
    path = folder / "box.yaml"
    pair = {"role": "first", "peer": ["192.168.50.12"], "host": "0.0.0.0", "secret": "pair.key", **keys}
    path.write_text(yaml.safe_dump({"pair": pair, "runtime": "runtime"}))
    return path


def test_a_secret_is_drawn_once_and_read_by_the_stage(tmp_path: Path) -> None:
    secret = tmp_path / "pair.key"
    assert run_bunraku("pair", "secret", secret).returncode == 0
    drawn, mode = secret.read_text(), secret.stat().st_mode
    assert mode & 0o077 == 0
    assert run_bunraku("pair", "secret", secret).returncode == 1 and secret.read_text() == drawn
    config = load_box(box_file(tmp_path)).pair
    assert config is not None and settings_of(config).key.hex() == drawn.strip()
    secret.write_text("no secret")
    with pytest.raises(ConfigError, match="bunraku pair secret"):
        settings_of(config)


def test_a_box_without_a_pair_and_one_that_does_not_play_say_so(tmp_path: Path) -> None:
    alone = tmp_path / "alone.yaml"
    alone.write_text("runtime: runtime\n")
    done = run_bunraku("pair", "status", "--box", alone)
    assert done.returncode != 0 and "pair" in done.stderr + done.stdout
    (tmp_path / "pair.key").write_text("00" * 16)
    done = run_bunraku("pair", "status", "--box", box_file(tmp_path))
    assert done.returncode == 1 and "bunraku play" in done.stdout


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"host": "127.0.0.1"}, "0.0.0.0"),
        ({"peer": ["10.0.0.1"] * 2}, "twice"),
        ({"peer": []}, "peer"),
    ],
)
def test_a_pair_that_could_not_hear_is_refused(tmp_path: Path, keys: dict[str, object], words: str) -> None:
    (tmp_path / "pair.key").write_text("00" * 16)
    with pytest.raises(ConfigError, match=words):
        load_box(box_file(tmp_path, **keys))


IN_STEP = {"at": "10.0.0.2", "silent_s": 0.01, "in_step": True, "same_show": True}


@pytest.mark.parametrize(
    ("behind", "other", "words", "well"),
    [
        (None, {}, "leads. In step with it: 2 of 2.", True),
        (1, {}, "in step with 10.0.0.2, 1 ticks behind", True),
        (None, {"in_step": False, "silent_s": 12.4}, "1 of 2. 10.0.0.3 has been silent for 12 s.", False),
        (None, {"in_step": False, "silent_s": None}, "10.0.0.3 has not been heard.", False),
        (None, {"in_step": False, "same_show": False}, "another show, release or secret", False),
        (None, {"in_step": False}, "not in step yet", False),
    ],
)
def test_boxes_in_step_are_told_in_words(
    behind: int | None, other: dict[str, object], words: str, well: bool
) -> None:
    boxes = [IN_STEP] if behind is not None else [IN_STEP, IN_STEP | {"at": "10.0.0.3"} | other]
    reported = {"behind": behind, "resyncs": 0, "boxes": boxes}
    assert words in sentence(reported) and is_well(reported) is well


def test_a_box_that_lost_its_leader_says_for_how_long() -> None:
    lost = IN_STEP | {"in_step": False, "silent_s": 7.0}
    words = sentence({"behind": 0, "resyncs": 0, "boxes": [lost]})
    assert words == "This box dances by itself. 10.0.0.2 has been silent for 7 s."


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "could take over at any moment"),
        ({"peer": False}, "nobody would take over"),
        ({"ready": False}, "not ready"),
        ({"same_show": False}, "another show"),
        ({"box": "second", "role": "follows"}, "second box of the pair, and it follows"),
    ],
)
def test_a_pair_is_told_in_words(said: dict[str, object], words: str) -> None:
    assert words in sentence(TOLD | said)
