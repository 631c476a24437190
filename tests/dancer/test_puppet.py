"""The puppet's session: what goes in and comes out, and what a damaged network file does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from appliance.dancer.motion_source import Playback
from appliance.dancer.puppet import Puppet, PuppetError, PuppetNetwork
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.recording import Recording
from tests.dancer.conftest import dance, random_quaternions

ALWAYS = ("window", "mask", "targets", "weights", "coding_iterations", "interaction_iterations")


@pytest.fixture(scope="module")
def phrase(tiny_show: Path) -> Recording:
    return read_bvh(tiny_show / "phrase.bvh")


@pytest.fixture
def puppet(tiny_show: Path, phrase: Recording) -> Puppet:
    return PuppetNetwork(tiny_show / "puppet.onnx", phrase.skeleton).puppets[0]


def free(puppet: Puppet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask, targets and weights of no hand at all."""
    count = len(puppet.joints)
    targets = np.tile(quaternion.IDENTITY, (len(puppet.window), count, 1))
    return np.zeros(count, bool), targets, np.zeros(count, np.float32)


def holding(puppet: Puppet, joint: str, target: np.ndarray, weight: float = 1.0) -> tuple[np.ndarray, ...]:
    mask, targets, weights = free(puppet)
    place = puppet.joints.index(joint)
    mask[place], targets[:, place], weights[place] = True, target, weight
    return mask, targets, weights


def altered(source: Path, folder: Path, change: Callable[[onnx.ModelProto], object]) -> Path:
    """A copy of a network file with something changed in it."""
    model = onnx.load(source)
    change(model)
    onnx.save(model, str(folder / "altered.onnx"))
    return folder / "altered.onnx"


def fill_weights_with(value: float) -> Callable[[onnx.ModelProto], None]:
    """Damage that leaves a readable file: the largest weight matrix becomes one value."""

    def change(model: onnx.ModelProto) -> None:
        largest = max(model.graph.initializer, key=lambda tensor: int(np.prod(tensor.dims)))
        weights = np.full_like(numpy_helper.to_array(largest), value)
        largest.CopyFrom(numpy_helper.from_array(weights, largest.name))

    return change


def test_windows_of_all_joints_go_to_the_moving_ones_and_back(puppet: Puppet, phrase: Recording) -> None:
    window = Playback(phrase).window()
    moving = puppet.select(window)
    assert moving.shape == (8, len(puppet.joints), 4)
    for place, name in enumerate(puppet.joints):
        assert np.array_equal(moving[:, place], window[:, phrase.skeleton.index(name)])
    whole = window[0].copy()
    changed = random_quaternions(np.random.default_rng(0), len(puppet.joints))
    puppet.scatter(changed, whole)
    for joint, name in enumerate(phrase.skeleton.names):
        expected = changed[puppet.joints.index(name)] if name in puppet.joints else window[0, joint]
        assert np.array_equal(whole[joint], expected)


@pytest.mark.parametrize("times", [1, 3, 10])
def test_a_dance_gives_unit_quaternions_without_sign_jumps(
    puppet: Puppet, phrase: Recording, times: int
) -> None:
    poses = dance(puppet, puppet.select(Playback(phrase).window()).copy(), *free(puppet), times, times)
    assert poses.shape == (8, len(puppet.joints), 4)
    assert poses.dtype == np.float32
    assert np.linalg.norm(poses, axis=-1) == pytest.approx(1.0, abs=1e-4)
    assert np.sum(poses[1:] * poses[:-1], axis=-1).min() >= 0.0
    assert not puppet.is_broken


def test_iteration_counts_are_live(puppet: Puppet, phrase: Recording) -> None:
    window = puppet.select(Playback(phrase).window()).copy()
    once, twice, again = (dance(puppet, window, *free(puppet), times, 0) for times in (1, 2, 1))
    assert quaternion.angle_between(once, twice).max() > 0.01
    assert np.array_equal(once, again)


@pytest.mark.parametrize("weight", [1.0, 0.5])
def test_the_held_orientation_shows_when_the_last_pass_is_held(
    puppet: Puppet, phrase: Recording, weight: float
) -> None:
    window = puppet.select(Playback(phrase).window()).copy()
    target = random_quaternions(np.random.default_rng(3))
    hands = holding(puppet, "lShldr", target, weight)
    place = puppet.joints.index("lShldr")
    shown = dance(puppet, window, *hands, 3, 3)[:, place]
    if weight == 1.0:
        assert quaternion.angle_between(shown, target).max() < 0.01
    free_last = dance(puppet, window, *hands, 3, 2)[:, place]
    assert quaternion.angle_between(free_last, target).min() > 0.05
    assert quaternion.angle_between(shown, target).max() < quaternion.angle_between(free_last, target).max()


def test_each_pose_of_the_window_is_held_at_its_own_target(puppet: Puppet, phrase: Recording) -> None:
    window = puppet.select(Playback(phrase).window()).copy()
    mask, targets, weights = holding(puppet, "lShldr", quaternion.IDENTITY)
    place = puppet.joints.index("lShldr")
    targets[:, place] = random_quaternions(np.random.default_rng(5), 8)
    shown = dance(puppet, window, mask, targets, weights, 3, 3)[:, place]
    assert quaternion.angle_between(shown, targets[:, place]).max() < 0.01


def test_the_mask_and_the_weight_both_release_a_joint(puppet: Puppet, phrase: Recording) -> None:
    window = puppet.select(Playback(phrase).window()).copy()
    untouched = dance(puppet, window, *free(puppet), 3, 2)
    mask, targets, weights = holding(puppet, "head", random_quaternions(np.random.default_rng(4)))
    assert (
        quaternion.angle_between(dance(puppet, window, mask, targets, weights, 3, 2), untouched).max() > 1e-3
    )
    for released in ((~mask & False, targets, weights), (mask, targets, weights * 0)):
        assert np.allclose(dance(puppet, window, *released, 3, 2), untouched, atol=1e-5)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_network_that_gives_no_numbers_is_noticed(
    tiny_show: Path, phrase: Recording, tmp_path: Path, value: float
) -> None:
    path = altered(tiny_show / "puppet.onnx", tmp_path, fill_weights_with(value))
    (broken,) = PuppetNetwork(path, phrase.skeleton).puppets
    window = broken.select(Playback(phrase).window())
    dance(broken, window, *free(broken), 10, 9)
    assert broken.is_broken


def test_a_puppet_without_poses_is_noticed_and_breaks_no_other(tiny_show: Path, phrase: Recording) -> None:
    first, second = PuppetNetwork(tiny_show / "puppet.onnx", phrase.skeleton, 2).puppets
    window = first.select(Playback(phrase).window()).copy()
    second.window[:] = window
    second.hold(*free(second), 2, 0)
    dance(first, np.full_like(window, np.nan), *free(first), 2, 0)
    assert (first.is_broken, second.is_broken) == (True, False)
    dance(first, window, *free(first), 2, 0)
    assert not first.is_broken and np.array_equal(first.poses, second.poses)


def test_each_of_four_dances_as_it_would_alone(tiny_show: Path, phrase: Recording, puppet: Puppet) -> None:
    four = PuppetNetwork(tiny_show / "puppet.onnx", phrase.skeleton, 4).puppets
    motion, rng = Playback(phrase), np.random.default_rng(7)
    alone = []
    for number, (one, joint, times) in enumerate(
        zip(four, ("lShldr", "head", "chest", "lShldr"), ((3, 2), (10, 9), (1, 0), (2, 2)), strict=True)
    ):
        window = one.select(motion.window()).copy()
        hands = holding(one, joint, random_quaternions(rng), 0.25 * (number + 1))
        one.hold(*hands, *times)
        alone.append(dance(puppet, window, *hands, *times))
        for _ in range(10):
            motion.advance()
    four[0].network.dance()
    for one, expected in zip(four, alone, strict=True):
        np.testing.assert_allclose(one.poses, expected, atol=1e-5)
    assert quaternion.angle_between(four[0].poses, four[3].poses).max() > 0.1
    before = four[0].network.poses.copy()
    four[0].network.warm_up()
    four[2].hold(*free(four[2]), 1, 0)  # all iterations are given anew for each dance
    assert not np.array_equal(four[0].network.poses, before)


def test_facts_come_from_the_file(puppet: Puppet) -> None:
    network = puppet.network
    assert (network.window, network.latent, len(network.joints)) == (8, 16, 17)
    assert network.rest.shape == (17, 4)
    assert np.linalg.norm(network.rest, axis=-1) == pytest.approx(1.0, abs=1e-4)
    assert (network.architecture, network.precision) == ("mlp", "fp32")


def test_a_missing_file_is_refused(tmp_path: Path, phrase: Recording) -> None:
    with pytest.raises(PuppetError, match="no such network file"):
        PuppetNetwork(tmp_path / "none.onnx", phrase.skeleton)


@pytest.mark.parametrize("content", [b"", b"this is no network", bytes(range(256)) * 100])
def test_a_file_that_is_no_network_is_refused(tmp_path: Path, phrase: Recording, content: bytes) -> None:
    (tmp_path / "puppet.onnx").write_bytes(content)
    with pytest.raises(PuppetError, match=r"puppet\.onnx: .*(cannot read|this network takes)"):
        PuppetNetwork(tmp_path / "puppet.onnx", phrase.skeleton)


def test_a_truncated_file_is_refused(tiny_show: Path, tmp_path: Path, phrase: Recording) -> None:
    whole = (tiny_show / "puppet.onnx").read_bytes()
    (tmp_path / "puppet.onnx").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(PuppetError, match="copy the bundle again"):
        PuppetNetwork(tmp_path / "puppet.onnx", phrase.skeleton)


def test_a_network_with_other_inputs_is_refused(tiny_show: Path, tmp_path: Path, phrase: Recording) -> None:
    def rename(model: onnx.ModelProto) -> None:
        for node in [*model.graph.input, *model.graph.node]:
            if isinstance(node, onnx.ValueInfoProto):
                node.name = "pose_window" if node.name == "window" else node.name
            else:
                node.input[:] = ["pose_window" if name == "window" else name for name in node.input]

    with pytest.raises(PuppetError, match=r"takes .*pose_window.*bunraku export"):
        PuppetNetwork(altered(tiny_show / "puppet.onnx", tmp_path, rename), phrase.skeleton)


def test_a_network_of_an_older_release_is_refused_with_the_cure(
    tiny_show: Path, tmp_path: Path, phrase: Recording
) -> None:
    """It took one puppet, and neither liveliness nor noise."""

    def take_one_puppet(model: onnx.ModelProto) -> None:
        kept = [port for port in model.graph.input if port.name in ALWAYS]
        for port in kept:
            del port.type.tensor_type.shape.dim[0]
            widen = onnx.helper.make_node("Unsqueeze", [port.name, "first_axis"], [f"{port.name}_of_one"])
            for node in model.graph.node:
                node.input[:] = [f"{name}_of_one" if name == port.name else name for name in node.input]
            model.graph.node.insert(0, widen)
        model.graph.initializer.append(numpy_helper.from_array(np.array([0]), "first_axis"))
        others = [port for port in model.graph.input if port.name not in ALWAYS]
        for port in others:
            model.graph.input.remove(port)

    with pytest.raises(PuppetError, match=r"'window' has the shape \[8, 17, 4\].*again with this release"):
        PuppetNetwork(altered(tiny_show / "puppet.onnx", tmp_path, take_one_puppet), phrase.skeleton)


@pytest.mark.parametrize("key", ["bunraku.joints", "bunraku.window", "bunraku.rest"])
def test_a_network_that_does_not_say_what_it_moves_is_refused(
    tiny_show: Path, tmp_path: Path, phrase: Recording, key: str
) -> None:
    def forget(model: onnx.ModelProto) -> None:
        kept = [fact for fact in model.metadata_props if fact.key != key]
        del model.metadata_props[:]
        model.metadata_props.extend(kept)

    with pytest.raises(PuppetError, match="does not say what it moves"):
        PuppetNetwork(altered(tiny_show / "puppet.onnx", tmp_path, forget), phrase.skeleton)


def test_a_network_of_another_skeleton_is_refused_with_the_joint(tiny_show: Path, swaying: Recording) -> None:
    with pytest.raises(PuppetError, match=r"'abdomen'.*trained on"):
        PuppetNetwork(tiny_show / "puppet.onnx", swaying.skeleton)
