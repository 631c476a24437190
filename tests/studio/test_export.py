"""The network file computes what was trained, for every architecture, precision and choice of joints."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from onnx import numpy_helper

from appliance.pose import quaternion
from appliance.show.bundle import default_show_path
from appliance.show.network import resting_feed
from appliance.studio import train_command
from appliance.studio.autoencoder.autoencoder import Autoencoder
from appliance.studio.autoencoder.coupled import Coupled
from appliance.studio.autoencoder.held_joints import HeldJoints, HeldPlaces
from appliance.studio.autoencoder.models import PUPPETS
from appliance.studio.data.dataset import load_dataset
from appliance.studio.data.sources import given
from appliance.studio.evaluation.coders import OnnxCoder, load_checkpoint
from appliance.studio.export import gate
from appliance.studio.export.export import export
from appliance.studio.export.exported import read_exported
from appliance.studio.going_on import doubt, takes_known_to
from appliance.studio.model_uses import REMOVED
from appliance.studio.studio_error import StudioError
from tests.studio.conftest import Said, bunraku
from tests.studio.test_autoencoder import bones_of_tiny, some_windows
from tests.studio.tiny import moving, skeleton, untrained

NAMES = [skeleton().names[j] for j in moving()]
TIMES = (10, 3, 1, 4), (9, 2, 0, 6)  # coding and interaction iterations of four rows


@pytest.fixture(scope="module", params=sorted(PUPPETS))
def network(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def exported(network: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp(network)
    for precision in ("fp32", "int8"):
        path = folder / f"{precision}.onnx"
        export(untrained(network), NAMES, path, int8=precision == "int8", architecture=network)
    return {precision: folder / f"{precision}.onnx" for precision in ("fp32", "int8")}


@pytest.mark.parametrize(("coding", "interaction"), [(10, 0), (10, 9), (10, 10), (1, 1), (1, 0), (3, 10)])
def test_onnx_is_pytorch(network: str, exported: dict[str, Path], coding: int, interaction: int) -> None:
    autoencoder, coder = untrained(network), OnnxCoder(exported["fp32"])
    rng = np.random.default_rng(coding + interaction)
    mask = np.zeros(len(NAMES), dtype=bool)
    mask[rng.choice(len(NAMES), 4, replace=False)] = True
    targets = quaternion.normalize(rng.normal(size=(8, len(NAMES), 4)).astype(np.float32))
    weights = rng.uniform(size=len(NAMES)).astype(np.float32)
    for window in some_windows(4):
        hold = HeldJoints(mask, targets[None], weights)
        with torch.no_grad():
            hold_tensors = HeldJoints(*map(torch.from_numpy, hold))
            trained, latents = autoencoder.iterate(window[None], coding, interaction, hold_tensors)
        played, played_latents = coder.iterate(window[None].numpy(), coding, interaction, hold)
        same = quaternion.aligned(played, trained.numpy())
        np.testing.assert_allclose(same, trained.numpy(), atol=1e-4)
        np.testing.assert_allclose(played_latents, latents.numpy(), atol=1e-3)


def pass_of(model: onnx.ModelProto) -> onnx.GraphProto:
    """The nodes of one pass."""
    (passes,) = (node for node in model.graph.node if node.op_type == "Scan")
    return next(attribute.g for attribute in passes.attribute if attribute.name == "body")


def rows(coder: OnnxCoder, each: list[int] | slice = slice(None)) -> dict[str, np.ndarray]:
    """What four puppets give their network, or some of them: windows, hands and iterations of their own."""
    rng, count = np.random.default_rng(11), len(NAMES)
    feed = resting_feed(coder.rest, 16, 4)
    feed["window"][:] = some_windows(4).numpy()
    feed["targets"][:] = quaternion.normalize(rng.normal(size=(4, 8, count, 4)))
    feed["mask"][:] = rng.uniform(size=(4, count)) < 0.2
    feed["weights"][:] = rng.uniform(size=(4, count))
    feed["coding_iterations"][:], feed["interaction_iterations"][:] = TIMES
    return {name: values[each] for name, values in feed.items()}


def run(path: Path, feed: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    poses, latents = session.run(["poses", "latent"], feed)
    return poses, latents


def test_each_row_has_iterations_and_hands_of_its_own(network: str, exported: dict[str, Path]) -> None:
    autoencoder, feed = untrained(network), rows(OnnxCoder(exported["fp32"]))
    poses, latents = run(exported["fp32"], feed)
    for row, times in enumerate(zip(*TIMES, strict=True)):
        own = (torch.from_numpy(feed[name][row]) for name in ("mask", "targets", "weights"))
        with torch.no_grad():
            trained, coded = autoencoder.iterate(
                torch.from_numpy(feed["window"][row, None]), *times, HeldJoints(*own)
            )
        same = quaternion.aligned(poses[row], trained[0].numpy())
        np.testing.assert_allclose(same, trained[0].numpy(), atol=1e-4)
        np.testing.assert_allclose(latents[row], coded[0].numpy(), atol=1e-3)


def test_a_row_is_what_it_would_be_alone(exported: dict[str, Path]) -> None:
    coder = OnnxCoder(exported["fp32"])
    together, latents = run(exported["fp32"], rows(coder))
    for row in range(4):
        alone, latent = run(exported["fp32"], rows(coder, [row]))
        np.testing.assert_allclose(together[row], alone[0], atol=5e-5)
        np.testing.assert_allclose(latents[row], latent[0], atol=5e-5)


def placed(feed: dict[str, np.ndarray], row: int) -> dict[str, np.ndarray]:
    """The same, and a hand holds two joints of one row at places."""
    rng = np.random.default_rng(5)
    places, weights = np.zeros_like(feed["places"]), np.zeros_like(feed["place_weights"])
    places[row] = rng.normal(size=places[row].shape)
    weights[row, [4, 7]] = 1.0, 0.6
    return {**feed, "places": places, "place_weights": weights}


def test_joints_at_places_are_pytorchs_and_other_rows_dance_on(tmp_path: Path) -> None:
    autoencoder, path = untrained("coupled"), tmp_path / "coupled.onnx"
    assert isinstance(autoencoder.network, Coupled)
    autoencoder.network.places.set_bones(bones_of_tiny())
    export(autoencoder, NAMES, path, int8=False, architecture="coupled")
    free = rows(OnnxCoder(path))
    without, _ = run(path, free)
    moved = run(path, {**free, "places": free["places"] + 1.0})
    np.testing.assert_array_equal(moved[0], without)
    read = read_exported(path).autoencoder
    for row in (0, 1):
        feed = placed(free, row)
        poses, latents = run(path, feed)
        others = [other for other in range(4) if other != row]
        np.testing.assert_allclose(poses[others], without[others], atol=1e-5)
        own = HeldJoints(*(torch.from_numpy(feed[name][row]) for name in ("mask", "targets", "weights")))
        places = HeldPlaces(*(torch.from_numpy(feed[name][row]) for name in ("places", "place_weights")))
        times = (TIMES[0][row], TIMES[1][row])
        for network in (autoencoder, read):
            with torch.no_grad():
                window = torch.from_numpy(feed["window"][row, None])
                made, coded = network.iterate(window, *times, own, placed=places)
            same = quaternion.aligned(poses[row], made[0].numpy())
            np.testing.assert_allclose(same, made[0].numpy(), atol=1e-4)
            np.testing.assert_allclose(latents[row], coded[0].numpy(), atol=1e-3)
        assert np.abs(latents[row] - run(path, free)[1][row]).max() > 1e-3


def test_int8_rows_share_a_range_and_are_the_same_each_time(exported: dict[str, Path]) -> None:
    coder = OnnxCoder(exported["int8"])
    together, again = (run(exported["int8"], rows(coder))[0] for _ in range(2))
    np.testing.assert_array_equal(together, again)
    alone = np.concatenate([run(exported["int8"], rows(coder, [row]))[0] for row in range(4)])
    assert np.degrees(quaternion.angle_between(together, alone)).mean() < 1.0


def test_poses_are_unit_and_without_jumps_of_sign(exported: dict[str, Path]) -> None:
    for path in exported.values():
        (poses,), _ = OnnxCoder(path).iterate(some_windows(3)[1:2].numpy(), 10)
        np.testing.assert_allclose(np.linalg.norm(poses, axis=-1), 1.0, atol=1e-5)
        assert ((poses[1:] * poses[:-1]).sum(-1) > 0).all()


def test_int8_weights_are_u8_around_128(network: str, exported: dict[str, Path]) -> None:
    """Full-range s8 saturates in the AVX2 kernels: 9 degrees of error after ten iterations."""
    model = onnx.load(exported["int8"])
    constants = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    weights = {name: value for name, value in constants.items() if name.endswith(".q")}
    assert weights
    for name, levels in weights.items():
        zero, scale = constants[name.replace(".q", ".zero")], constants[name.replace(".q", ".scale")]
        assert levels.dtype == zero.dtype == np.uint8, name
        assert (zero == 128).all() and zero.size == levels.shape[-1] == scale.size, name
        assert levels.min() >= 1, name
    kinds = [node.op_type for node in pass_of(model).node]
    assert "DynamicQuantizeMatMul" in kinds and "LSTM" not in kinds
    # In float stay the layer that sees the pose, where int8 loses most, and the mlp's two small ones around
    # the latent, where it gains nothing.
    assert kinds.count("Gemm") == {"coupled": 3, "mlp": 3}.get(network, 0)


def test_int8_stays_near_fp32(exported: dict[str, Path]) -> None:
    coders = {precision: OnnxCoder(path) for precision, path in exported.items()}
    windows = some_windows(4).numpy()
    one, other = (coders[precision].iterate(windows, 1)[0] for precision in ("fp32", "int8"))
    apart = np.degrees(quaternion.angle_between(one, other))
    assert 0 < apart.mean() < 1.0


def test_the_file_says_what_it_is(network: str, exported: dict[str, Path]) -> None:
    for precision, path in exported.items():
        facts = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
        assert facts["bunraku.joints"].split(",") == NAMES
        assert (facts["bunraku.window"], facts["bunraku.latent"]) == ("8", "16")
        assert (facts["bunraku.architecture"], facts["bunraku.precision"]) == (network, precision)
        assert np.array(json.loads(facts["bunraku.rest"])).shape == (17, 4)


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
    network = shutil.copy(show / "puppet.onnx", tmp_path)
    train = ("train", "--recordings", recordings, "--from", network, "--threads", 1)
    result = bunraku(*train, "--out", tmp_path / "next", "--steps", 2)
    assert result.exit_code == 0, result.output
    assert "It is not known which takes puppet.onnx learned from" in result.stderr
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


def test_a_network_that_goes_on_is_not_measured_on_what_it_knows(
    trained: tuple[Path, Said], recordings: Path, tmp_path: Path
) -> None:
    show, known = trained[0], frozenset({"sway_0", "sway_1"})
    assert takes_known_to(show / "checkpoint.pt") == takes_known_to(show / "puppet.onnx") == known
    shutil.copy(show / "report.json", tmp_path)
    assert takes_known_to(tmp_path) == known
    assert takes_known_to(tmp_path / "elsewhere" / "puppet.onnx") is None
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name in ("sway_0", "sway_1"):
        shutil.copy(recordings / f"{name}.bvh", folder)
    dataset = given(folder).for_network(known).load(lambda files: files)
    assert "show learned from sway_1: the figures flatter" in doubt(tmp_path / "show", known, dataset)
    shutil.copy(recordings / "sway_2.bvh", folder / "a_new_one.bvh")
    source = given(folder).for_network(known)
    dataset = source.load(lambda files: files)
    assert [take.name for take in dataset.held_out] == ["a_new_one"] and doubt(show, known, dataset) == ""
    chained = source.learned_by(dataset, {"before"}).catalogue
    assert set(chained.learned) == {"before", *known} and chained.held_out == ("a_new_one",)
    assert given(folder, held_out=["sway_0"]).for_network(known).catalogue.held_out == ("sway_0",)


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
