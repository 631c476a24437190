"""A network read back from its exported file, and a training that goes on from a show."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import numpy_helper

from appliance.pose import quaternion
from appliance.show.bundle import default_show_path
from appliance.studio import train_command
from appliance.studio.autoencoder.held_joints import HeldJoints
from appliance.studio.evaluation.coders import OnnxCoder, load_checkpoint
from appliance.studio.export.export import export
from appliance.studio.export.exported import read_exported
from appliance.studio.model_uses import REMOVED
from appliance.studio.studio_error import StudioError
from tests.studio.conftest import Said, bunraku
from tests.studio.test_export import NAMES
from tests.studio.tiny import untrained


def constants(path: Path) -> dict[str, np.ndarray]:
    return {each.name: numpy_helper.to_array(each) for each in onnx.load(path).graph.initializer}


@pytest.mark.parametrize("network", ["coupled", "mlp"])
def test_what_is_read_back_computes_what_the_file_computes(tmp_path: Path, network: str) -> None:
    file, count = tmp_path / "puppet.onnx", len(NAMES)
    export(untrained(network), NAMES, file, int8=False, architecture=network)
    read, played = read_exported(file), OnnxCoder(file)
    assert read.joints == tuple(NAMES) and read.facts["architecture"] == network
    windows, targets = torch.nn.functional.normalize(torch.randn(2, 4, 8, count, 4), dim=-1)
    hold = HeldJoints(np.arange(count) == 2, targets.numpy(), np.full(count, 0.7, dtype=np.float32))
    for iterations in ((1, 0), (10, 9)):
        one, _ = read.iterate(windows.numpy(), *iterations, hold)
        other, _ = played.iterate(windows.numpy(), *iterations, hold)
        assert np.abs(quaternion.aligned(one, other) - other).max() < 1e-4


def test_the_default_show_read_and_exported_again_has_the_same_levels(tmp_path: Path) -> None:
    shipped = default_show_path() / "puppet.onnx"
    read, again = read_exported(shipped), tmp_path / "again.onnx"
    export(read.autoencoder, list(read.joints), again, int8=True, architecture=read.facts["architecture"])
    ours, theirs = constants(again), constants(shipped)
    assert ours.keys() == theirs.keys()
    assert sum(name.endswith(".q") for name in ours) == 3
    for name, values in theirs.items():
        if values.dtype == np.uint8:
            assert np.array_equal(ours[name], values), name
        else:
            np.testing.assert_allclose(ours[name], values, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("network", REMOVED)
def test_networks_of_an_earlier_version_are_refused_with_the_version_that_reads_them(
    network: str, tmp_path: Path
) -> None:
    torch.save({"settings": {"seed": 1, "network": network}}, tmp_path / "checkpoint.pt")
    with pytest.raises(StudioError, match=rf"'{network}'\. Only Bunraku 0\.1\.0 can read it"):
        load_checkpoint(tmp_path / "checkpoint.pt")
    export(untrained("mlp"), NAMES, tmp_path / "puppet.onnx", int8=False, architecture=network)
    with pytest.raises(StudioError, match=rf"'{network}'\. Only Bunraku 0\.1\.0 can read it"):
        read_exported(tmp_path / "puppet.onnx")


def test_files_that_give_no_network_are_refused(tmp_path: Path) -> None:
    (tmp_path / "other.onnx").write_bytes(b"no network")
    with pytest.raises(StudioError, match=r"not a puppet that bunraku exported"):
        read_exported(tmp_path / "other.onnx")
    export(untrained("lstm"), NAMES, tmp_path / "lstm.onnx", int8=False, architecture="lstm")
    with pytest.raises(StudioError, match=r"lstm.*Give its checkpoint\.pt"):
        read_exported(tmp_path / "lstm.onnx")


def test_a_training_goes_on_from_a_show(
    trained: tuple[Path, Said], recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        train_command, "release", lambda *_: {"puppetry": {}}
    )  # as after any training, and slow
    show, _ = trained
    train = ("train", "--recordings", recordings, "--from", show / "puppet.onnx", "--threads", 1)
    result = bunraku(*train, "--out", tmp_path / "next", "--steps", 2)
    assert result.exit_code == 0, result.output
    before, after = (json.loads((each / "training.json").read_text()) for each in (show, tmp_path / "next"))
    assert after["settings"]["width"] == 48 and after["settings"]["learning_rate"] == 2e-4
    assert after["settings"]["alive_from"] == 0 < before["settings"]["alive_from"]
    errors = [reported["history"][-1]["held_out_degrees"] for reported in (before, after)]
    assert errors[1] < 1.1 * errors[0], "it began anew"
    for message, options in (
        ("--width comes with", ("new", "--width", 16)),
        ("Omit one of them", ("new", "--model", "pose")),
        ("Give one", ("next", "--resume")),
    ):
        refused = bunraku(*train, "--out", tmp_path / options[0], *options[1:])
        assert refused.exit_code == 2 and message in refused.stderr
