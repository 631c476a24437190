"""What was masked is told in sentences and shown in a picture, so that people can say that it is no error."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import torch

from appliance.pictures.filmstrip import VERMILION
from appliance.studio.data.dataset import load_dataset
from appliance.studio.evaluation.findings import findings
from appliance.studio.evaluation.masked import draw_masked, masked_stretches
from tests.studio.conftest import bunraku
from tests.studio.test_catalogue import upside_down
from tests.studio.test_commands import said


def test_errors_that_touch_are_one_stretch_the_longest_first(tmp_path: Path) -> None:
    found = load_dataset(upside_down(tmp_path / "dancer"))
    takes = [*found.training, *found.held_out]
    first, second = masked_stretches(takes)
    assert (first.take.name, second.take.name) == ("sway_0", "sway_1")
    assert abs(first.start_s - 4) < 0.05 and abs(first.end_s - 6) < 0.05
    assert first.worst.joint == "head" and len(first.errors) == 3
    assert (
        first.sentence().startswith("sway_0, 3.9")
        and "head stands as it does at no other time" in first.sentence()
    )


def test_the_findings_say_how_much_is_masked_where_and_how_to_overrule_it(tmp_path: Path) -> None:
    message = " ".join(findings(load_dataset(upside_down(tmp_path / "dancer"))))
    assert (
        "frames (8." in message
        and "in 2 recordings: sway_0 (10" in message
        and ": head), sway_1 (" in message
    )
    assert "pictures/masked.png" in message and "--keep 'sway_0'" in message


def test_the_picture_marks_the_joint(tmp_path: Path) -> None:
    found = load_dataset(upside_down(tmp_path / "dancer"))
    picture = draw_masked(tmp_path / "masked.png", found.training)
    pixels = matplotlib.image.imread(picture)[..., :3]
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    assert VERMILION.argmax() == 0
    assert ((red > 0.4) & (red > 2.5 * green) & (red > 2.5 * blue)).sum() > 1000


def test_training_draws_what_it_masked_and_remembers_what_it_must_keep(tmp_path: Path) -> None:
    folder, out = upside_down(tmp_path / "dancer"), tmp_path / "show"
    options = ["--steps", 2, "--width", 32, "--latent", 8, "--threads", 1, "--device", "cpu"]
    result = bunraku(
        "train", "--model", "pose", "--recordings", folder, "--out", out, "--keep", "sway_0", *options
    )
    assert result.exit_code == 0, said(result)
    assert "in 1 recording: sway_1" in said(result)
    assert (out / "pictures" / "masked.png").read_bytes().startswith(b"\x89PNG")
    kept = torch.load(out / "checkpoint.pt", weights_only=True)["origin"]["catalogue"]["keep"]
    assert list(kept) == ["sway_0"]
