"""int8 ships only where it stays near fp32."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.data.dataset import load_dataset
from appliance.studio.evaluation.coders import OnnxCoder
from appliance.studio.export import gate
from appliance.studio.export.export import export
from tests.studio.test_autoencoder import some_windows
from tests.studio.test_export import NAMES
from tests.studio.tiny import untrained


def judged(autoencoder: Autoencoder, folder: Path) -> gate.Verdict:
    for precision in ("fp32", "int8"):
        path = folder / f"{precision}.onnx"
        export(autoencoder, NAMES, path, int8=precision == "int8", architecture="mlp")
    coders = [OnnxCoder(folder / f"{precision}.onnx") for precision in ("fp32", "int8")]
    return gate.judge(*coders, some_windows(8).numpy())


def test_a_network_that_quantizes_badly_ships_as_fp32(tmp_path: Path) -> None:
    """One large weight in each row leaves no levels for the others."""
    autoencoder = untrained()
    with torch.no_grad():
        last = autoencoder.network.decoder.stack[-1]
        last.weight[:] *= 4
        last.weight[:, 0] = 60.0
        last.bias -= 60.0 * autoencoder.network.decoder.stack[:-1](torch.zeros(1, 16))[0, 0]
    verdict = judged(autoencoder, tmp_path)
    assert verdict.mean["1"] > 0.25
    assert not verdict.passed and verdict.precision == "fp32"
    assert (
        "fp32 ships" in verdict.sentence()
        and f"{verdict.mean['1']:.2f} degrees after 1" in verdict.sentence()
    )


def test_a_network_that_quantizes_well_ships_as_int8(tmp_path: Path) -> None:
    verdict = judged(untrained(), tmp_path)
    assert verdict.passed and verdict.precision == "int8"
    assert 0 < verdict.mean["1"] <= verdict.largest["1"]


def test_all_limits_count() -> None:
    sound = {"1": 0.25, "10": 1.5, "10/9": 1.5}
    assert gate.Verdict(sound, sound).passed
    for passes, degrees in (("1", 0.26), ("10", 1.51), ("10/9", 1.51), ("1", float("nan"))):
        assert not gate.Verdict({**sound, passes: degrees}, sound).passed


def test_the_gate_looks_at_the_answer_to_hands_too(tmp_path: Path) -> None:
    """int8 weights that spoil only what the network makes of held joints do not ship."""

    class Deaf(OnnxCoder):
        def iterate(self, windows, coding_iterations, interaction_iterations=0, *held):  # type: ignore[no-untyped-def]
            return super().iterate(windows, coding_iterations)

    path, autoencoder = tmp_path / "fp32.onnx", untrained("coupled")
    with torch.no_grad():
        autoencoder.network.hands.last.weight *= 300
        autoencoder.network.decoder.stack[-1].weight *= 100
    export(autoencoder, NAMES, path, int8=False, architecture="coupled")
    verdict = gate.judge(OnnxCoder(path), Deaf(path), some_windows(8).numpy())
    assert verdict.mean["10"] == 0.0
    assert verdict.mean["10/9"] > 1.5 and not verdict.passed


def test_the_sample_is_spread_over_all_takes(recordings: Path) -> None:
    found = load_dataset(recordings)
    windows = gate.sample_windows(found.training, found.moving, count=10)
    assert windows.shape == (10, 8, 17, 4)
    first, last = found.training[0].recording, found.training[-1].recording
    np.testing.assert_allclose(windows[0], first.poses[:8, found.moving], atol=1e-6)
    np.testing.assert_allclose(windows[-1], last.poses[-8:, found.moving], atol=1e-6)
