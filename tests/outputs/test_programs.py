"""The AI-Toolbox programs as receivers: their published parsing rules, restated, on real UDP sockets.

Each receiver below does with the lists what its program does, and nothing of the box's encoder.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.receivers import OscOutputs
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh
from appliance.pose.skeleton import Skeleton
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.osc import PROGRAMS, OscConfig
from hw_sim.osc_receiver import OscReceiver
from tests.bundles import write_show

LOOPBACK = "127.0.0.1"
Lists = Mapping[str, np.ndarray]


def sent(skeleton: Skeleton, frame: JointFrame, **config: object) -> Lists:
    """What a receiver of this configuration gets of one frame, by address."""
    with OscReceiver(LOOPBACK) as receiver:
        values = {**config, "port": receiver.port}
        outputs = OscOutputs([OscConfig.model_validate(values)], skeleton)
        with closing(outputs):
            outputs.send_frame(frame)
            lists: dict[str, np.ndarray] = {}
            while not lists or len(lists) < len(values.get("messages", ())):  # type: ignore[arg-type]
                found = receiver.poll(60.0)
                assert found, "no datagram came"
                lists |= {address: np.array(numbers, float) for _, address, numbers in found}
            lists |= {address: np.array(numbers, float) for _, address, numbers in receiver.poll(0.2)}
    return lists


def with_ends(skeleton: Skeleton) -> Skeleton:
    return Skeleton(
        skeleton.names,
        skeleton.parents,
        skeleton.offsets,
        ((4, (0.0, 0.2, 0.0)), (9, (0.05, 0.0, 0.0)), (17, (0.0, 0.0, 0.15))),
    )


def program(name: str) -> dict[str, object]:
    return {"program": name, **{key: value for key, value in PROGRAMS[name].items() if key == "messages"}}


def test_mocap_analysis_gets_positions_in_centimetres(skeleton: Skeleton, frame: JointFrame) -> None:
    """MocapAnalysisPython: pattern /mocap/*/joint/pos_world, reshaped to (joints, 3), scaled by 0.01."""
    lists = sent(skeleton, frame, **program("mocap-analysis"))
    pattern = re.compile("^" + re.escape("/mocap/*/joint/pos_world").replace("\\*", ".*") + "$")
    (address,) = [address for address in lists if pattern.match(address)]
    np.testing.assert_allclose(
        lists[address].reshape(len(skeleton), 3) * 0.01, frame.puppets[0].positions, atol=1e-5
    )


def test_the_classifier_gets_local_positions_and_rotations(skeleton: Skeleton, frame: JointFrame) -> None:
    """MocapClassifier_Interactive: waits for both lists; (joints, 3) and (joints, 4)."""
    lists = sent(skeleton, frame, **program("classifier"))
    offsets = lists["/mocap/0/joint/pos_local"].reshape(-1, 3) / 100
    np.testing.assert_allclose(offsets[1:], skeleton.offsets[1:], atol=1e-5)
    np.testing.assert_allclose(offsets[0], frame.puppets[0].positions[0], atol=1e-5)
    np.testing.assert_allclose(
        lists["/mocap/0/joint/rot_local"].reshape(-1, 4), frame.puppets[0].pose, atol=1e-6
    )


def test_the_clustering_gets_its_three_lists(skeleton: Skeleton, frame: JointFrame) -> None:
    lists = sent(skeleton, frame, **program("clustering"))
    assert {address.rpartition("/")[2] for address in lists} == {"rot_local", "rot_world", "pos_world"}


def test_vae_rnn_counts_end_sites_as_joints(skeleton: Skeleton, frame: JointFrame) -> None:
    """Its BVH loader makes a joint of each End Site, behind its parent, with no rotation of its own."""
    ended = with_ends(skeleton)
    (rotations,) = sent(ended, frame, **program("vae-rnn")).values()
    rows = rotations.reshape(-1, 4)
    assert len(rows) == len(skeleton) + 3
    np.testing.assert_array_equal(rows[[5, 11, 20]], np.tile(quaternion.IDENTITY, (3, 1)))
    np.testing.assert_allclose(np.delete(rows, [5, 11, 20], axis=0), frame.puppets[0].pose, atol=1e-6)


def test_ends_lie_where_the_bones_end(skeleton: Skeleton, frame: JointFrame) -> None:
    ended = with_ends(skeleton)
    lists = sent(ended, frame, ends=True, messages=["pos_world", "rot_world"])
    rows = lists["/mocap/0/joint/pos_world"].reshape(-1, 3)
    for row, (joint, offset) in zip((5, 11, 20), ended.ends, strict=True):
        reach = quaternion.rotate(frame.puppets[0].world[joint], np.array(offset))
        np.testing.assert_allclose(rows[row], frame.puppets[0].positions[joint] + reach, atol=1e-5)
        turned = lists["/mocap/0/joint/rot_world"].reshape(-1, 4)[row]
        np.testing.assert_allclose(turned, frame.puppets[0].world[joint], atol=1e-6)


@pytest.mark.parametrize("name", ["ray-marching", "supercollider"])
def test_programs_with_z_up_read_the_height_as_z(skeleton: Skeleton, frame: JointFrame, name: str) -> None:
    lists = sent(skeleton, frame, **program(name))
    (positions,) = [numbers.reshape(-1, 3) for at, numbers in lists.items() if at.endswith("pos_world")]
    scale = 100.0 if name == "ray-marching" else 1.0
    np.testing.assert_allclose(positions[:, 2] / scale, frame.puppets[0].positions[:, 1], atol=1e-5)
    prefix = "/mocap/joint" if name == "supercollider" else "/mocap/0/joint"
    assert all(address.startswith(f"{prefix}/") for address in lists)


@pytest.mark.parametrize("axes", [("z", "x", "y"), ("x", "-z", "y"), ("-x", "y", "z"), ("y", "x", "z")])
def test_rotations_turn_in_the_receivers_axes_as_positions_do(
    skeleton: Skeleton, frame: JointFrame, axes: Sequence[str]
) -> None:
    """Forward kinematics of the received offsets and rotations gives the received positions, mirrored too."""
    lists = sent(skeleton, frame, axes=list(axes), messages=["pos_local", "rot_local", "pos_world"])
    offsets = lists["/mocap/0/joint/pos_local"].reshape(-1, 3)
    moved = Skeleton(skeleton.names, skeleton.parents, np.vstack([np.zeros((1, 3)), offsets[1:]]))
    positions, _ = moved.forward_kinematics(lists["/mocap/0/joint/rot_local"].reshape(-1, 4), offsets[0])
    np.testing.assert_allclose(positions, lists["/mocap/0/joint/pos_world"].reshape(-1, 3), atol=1e-4)


def test_a_receiver_may_choose_joints_and_their_order(skeleton: Skeleton, frame: JointFrame) -> None:
    lists = sent(skeleton, frame, joints=["head", "hip"], messages=["pos_world"], prefix="/mocap/1/joint")
    rows = lists["/mocap/1/joint/pos_world"].reshape(-1, 3)
    np.testing.assert_allclose(rows, frame.puppets[0].positions[[4, 0]], atol=1e-6)


def test_euler_angles_turn_about_x_then_y_then_z(skeleton: Skeleton, frame: JointFrame) -> None:
    (degrees,) = sent(skeleton, frame, rotations="euler", messages=["rot_local"]).values()
    about = [
        quaternion.from_axis_angle(np.eye(3)[axis], np.radians(degrees.reshape(-1, 3)[:, axis]))
        for axis in range(3)
    ]
    turned = quaternion.multiply(about[2], quaternion.multiply(about[1], about[0]))
    assert np.degrees(quaternion.angle_between(turned, frame.puppets[0].pose)).max() < 0.1


@pytest.mark.parametrize(
    ("name", "port"),
    [("mocap-analysis", 9007), ("classifier", 9007), ("vae-rnn", 9007), ("ray-marching", 9004)],
)
def test_a_program_is_sent_to_the_port_in_its_source(name: str, port: int) -> None:
    assert OscConfig.model_validate({"program": name}).port == port


def test_a_key_beside_the_program_counts_more(tmp_path: Path) -> None:
    box = tmp_path / "box.yaml"
    box.write_text("outputs: {osc: [{program: classifier, port: 9100, scale: 1}]}")
    (receiver,) = load_box(box).outputs.osc
    assert (receiver.port, receiver.scale, receiver.messages) == (9100, 1.0, ["pos_local", "rot_local"])


@pytest.mark.parametrize(
    ("receiver", "message"),
    [
        ("{dialect: vmc, scale: 100}", "'scale' belongs to the dialect ai-toolbox"),
        ("{dialect: joint, program: classifier}", "'program' belongs to the dialect ai-toolbox"),
        ("{axes: [x, x, y]}", "Each of x, y and z is needed once"),
        ("{messages: [pos_world, pos_world]}", "is listed twice"),
        ("{prefix: mocap}", "prefix"),
        ("{program: clasifier}", "classifier"),
    ],
)
def test_what_does_not_go_together_is_refused_with_its_line(
    tmp_path: Path, receiver: str, message: str
) -> None:
    box = tmp_path / "box.yaml"
    box.write_text(f"outputs:\n  osc:\n    - {receiver}\n")
    with pytest.raises(ConfigError, match=message) as refused:
        load_box(box)
    assert f"{box}:3" in str(refused.value)


def test_joints_that_the_show_does_not_have_are_refused(tmp_path: Path) -> None:
    from appliance.show.osc import osc_misfits

    names = read_bvh(write_show(tmp_path / "show") / "skeleton.bvh").skeleton.names
    box = tmp_path / "box.yaml"
    box.write_text("outputs:\n  osc:\n    - {joints: [Hipps]}\n")
    loaded = load_box(box)
    (problem,) = osc_misfits(loaded.outputs.osc, names, 1, loaded.file)
    assert "no joint 'Hipps'" in str(problem) and f"{box}:3" in str(problem)
