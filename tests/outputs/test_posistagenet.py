"""PosiStageNet out, read by a decoder written from the protocol's description and by pypsn."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pypsn
import pytest

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.posistagenet import PosiStageNet
from appliance.pose.skeleton import Skeleton
from appliance.show.box import load_box
from appliance.show.config_error import ConfigError
from appliance.show.posistagenet import PosiStageNetConfig, misfits
from appliance.show.yaml_file import YamlFile
from hw_sim.peers import free_ports
from hw_sim.posistagenet import MalformedPsnError, Packet, PsnReceiver, decode
from tests.outputs.conftest import fill
from tests.outputs.small_stage import one_puppet, together

LOOPBACK = "127.0.0.1"


def output(skeleton: Skeleton, **settings: Any) -> PosiStageNet:
    return PosiStageNet(PosiStageNetConfig.model_validate(settings), skeleton)


def encoded(psn: PosiStageNet, frame: JointFrame) -> tuple[list[Packet], list[Packet]]:
    """Information and data packets of a frame, decoded."""
    packets = [decode(bytes(packet)) for packet in psn.encode(frame)]
    return [one for one in packets if not one.is_data], [one for one in packets if one.is_data]


def positions(packets: Sequence[Packet]) -> dict[int, Any]:
    return {number: tracker.position for one in packets for number, tracker in one.trackers.items()}


def test_every_joint_is_a_tracker_with_its_position_and_name(skeleton: Skeleton, frame: JointFrame) -> None:
    info, data = encoded(output(skeleton), frame)
    assert [one.names for one in info] == [dict(enumerate(skeleton.names))]
    assert [one.system for one in info] == ["Bunraku"]
    found = positions(data)
    assert list(found) == list(range(len(skeleton)))
    np.testing.assert_array_equal(np.array(list(found.values()), np.float32), frame.puppets[0].positions)
    assert {tracker.status for one in data for tracker in one.trackers.values()} == {1.0}
    assert {tracker.speed for one in data for tracker in one.trackers.values()} == {None}


def test_chosen_joints_keep_their_order_and_get_their_numbers(skeleton: Skeleton, frame: JointFrame) -> None:
    names = ["head", "lHand", "hip"]
    info, data = encoded(output(skeleton, joints=names, first_tracker=100, system_name="Röhre"), frame)
    assert info[0].names == {100: "head", 101: "lHand", 102: "hip"}
    assert info[0].system == "Röhre"
    found = positions(data)
    for number, name in info[0].names.items():
        assert found[number] == tuple(frame.puppets[0].positions[skeleton.names.index(name)])


def test_axes_scale_and_offset_are_the_receivers(skeleton: Skeleton, frame: JointFrame) -> None:
    psn = output(skeleton, joints=["lHand"], axes=["x", "-z", "y"], scale=100.0, offset=[10, 20, 30])
    _, data = encoded(psn, frame)
    x, y, z = frame.puppets[0].positions[skeleton.names.index("lHand")]
    np.testing.assert_allclose(positions(data)[0], (100 * x + 10, -100 * z + 20, 100 * y + 30), rtol=1e-6)


def test_frame_ids_count_and_wrap_and_the_clock_starts_at_zero(skeleton: Skeleton, frame: JointFrame) -> None:
    psn = output(skeleton, joints=["hip"])
    data, info = [], []
    for tick in range(520):
        frame.frame_time = 5000.0 + 0.02 * tick
        names, numbers = encoded(psn, frame)
        info += names
        data += numbers
    assert [one.frame for one in data] == [tick % 256 for tick in range(520)]
    np.testing.assert_allclose([one.time_us for one in data], 20_000 * np.arange(520), atol=1)
    assert [one.frame for one in info] == list(range(11))
    np.testing.assert_allclose(np.diff([one.time_us for one in info]), 1e6, atol=20_001)
    assert {one.version for one in data + info} == {(2, 0)}


@pytest.mark.parametrize("speed", [False, True])
@pytest.mark.parametrize("joints", [1, 43, 52, 53, 200, 1000])
def test_a_frame_is_split_into_packets_that_fit_an_ethernet_frame(joints: int, speed: bool) -> None:
    many = Skeleton(
        tuple(f"joint number {n}" for n in range(joints)), tuple(range(-1, joints - 1)), np.zeros((joints, 3))
    )
    frame = one_puppet(joints)
    frame.puppets[0].positions[:] = np.random.default_rng(joints).normal(size=(joints, 3))
    psn = output(many, speed=speed)
    assert max(map(len, psn.encode(frame))) <= 1472
    frame.frame_time = 2.0
    info, data = encoded(psn, frame)
    for packets in (info, data):
        assert {one.packets for one in packets} == {len(packets)}
        assert len({one.frame for one in packets}) == 1
    np.testing.assert_array_equal(
        np.array(list(positions(data).values()), np.float32), frame.puppets[0].positions
    )
    assert {number: name for one in info for number, name in one.names.items()} == dict(enumerate(many.names))


def test_the_clock_of_a_box_that_follows_may_be_corrected_backwards(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    """Its leader's first datagram was on its way for long: time and names begin anew, nothing is raised."""
    psn = output(skeleton, joints=["hip"])
    frame.frame_time = 5003.0
    encoded(psn, frame)
    times, named = [], 0
    for tick in range(100):
        frame.frame_time = 5000.0 + 0.02 * tick
        info, data = encoded(psn, frame)
        times.append(data[0].time_us)
        named += len(info)
    assert (times[0], times[50], named) == (0, 1_000_000, 2)


def test_speeds_are_metres_a_second_and_a_late_frame_keeps_them(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    psn = output(skeleton, joints=["hip"], speed=True, axes=["-x", "y", "-z"])
    hip = skeleton.names.index("hip")
    speeds = []
    for tick, (x, late) in enumerate([(0.0, False), (0.1, False), (0.1, True), (0.3, False), (0.3, False)]):
        frame.puppets[0].positions[hip], frame.late, frame.frame_time = (
            (x, 1.0, -2 * x),
            late,
            50.0 + 0.02 * tick,
        )
        _, data = encoded(psn, frame)
        speeds.append(data[0].trackers[0].speed)
    expected = [(0, 0, 0), (-5, 0, 10), (-5, 0, 10), (-5, 0, 10), (0, 0, 0)]
    np.testing.assert_allclose(np.array(speeds), expected, atol=1e-4)


def test_pypsn_reads_the_same(skeleton: Skeleton, frame: JointFrame) -> None:
    psn = output(skeleton, speed=True, system_name="Stage left")
    psn.encode(frame)
    before = frame.puppets[0].positions.copy()
    fill(frame, skeleton, seed=51)
    trackers: dict[int, Any] = {}
    names: dict[int, str] = {}
    for datagram in psn.encode(frame):
        packet = pypsn.parse_psn_packet(bytes(datagram))
        assert (packet.info.version_high, packet.info.version_low) == (2, 0)
        assert packet.info.frame_id == 1
        assert packet.info.timestamp == 1_000_000
        if isinstance(packet, pypsn.psn_data_packet):
            trackers |= {tracker.id: tracker for tracker in packet.trackers}
        else:
            assert packet.name == b"Stage left"
            names |= {tracker.tracker_id: tracker.tracker_name.decode() for tracker in packet.trackers}
    assert names == dict(enumerate(skeleton.names))
    found = np.array([tuple(trackers[number].pos) for number in range(len(skeleton))], np.float32)
    np.testing.assert_array_equal(found, frame.puppets[0].positions)
    speeds = np.array([tuple(trackers[number].speed) for number in range(len(skeleton))])
    np.testing.assert_allclose(speeds, (frame.puppets[0].positions - before) / 1.0, atol=1e-5)
    assert {tracker.status for tracker in trackers.values()} == {1.0}


def test_a_multicast_receiver_on_this_machine_gets_every_frame(skeleton: Skeleton, frame: JointFrame) -> None:
    (port,) = free_ports(1)
    with PsnReceiver(LOOPBACK, port=port) as receiver:
        psn = output(skeleton, port=port)
        for tick in range(60):
            fill(frame, skeleton, tick)
            psn.send_frame(frame)
        came = receiver.poll(5.0)
        while sum(one.is_data for one in came) < 60:
            more = receiver.poll(5.0)
            assert more, f"only {len(came)} packets came"
            came += more
        assert (psn.dropped, psn.last_error, receiver.malformed) == (0, "", 0)
        assert psn.sent == len(came) == 62
        assert [one.is_data for one in came[:2]] == [False, True]
        assert psn.name == f"236.10.10.10:{port} (posistagenet)"
        psn.close()


def test_each_nth_frame_is_sent(skeleton: Skeleton, frame: JointFrame) -> None:
    (port,) = free_ports(1)
    with PsnReceiver(LOOPBACK, port=port) as receiver:
        psn = output(skeleton, port=port, joints=["hip"], every=3)
        for tick in range(10):
            frame.puppets[0].positions[0, 0], frame.frame_time = tick, 10.0 + 0.02 * tick
            psn.send_frame(frame)
        data = [one for one in receiver.poll(5.0) if one.is_data]
        assert [one.trackers[0].position[0] for one in data if one.trackers[0].position] == [0, 3, 6, 9]
        psn.close()


def test_an_interface_that_the_box_has_not_is_said_and_never_raises(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    psn = output(skeleton, interface="192.0.2.1")
    for tick in range(100):
        psn.send_frame(fill(frame, skeleton, tick))
    assert (psn.sent, psn.dropped) == (0, 102)
    assert "interface" in psn.last_error
    psn.close()


def test_one_receiver_can_be_sent_to_directly(skeleton: Skeleton, frame: JointFrame) -> None:
    with PsnReceiver(LOOPBACK, group=LOOPBACK, port=0) as receiver:
        psn = output(skeleton, host=LOOPBACK, port=receiver.port, joints=["hip"])
        psn.send_frame(frame)
        assert [one.is_data for one in receiver.poll(5.0)] == [False, True]
        psn.close()


def test_each_frame_is_in_the_same_buffers(skeleton: Skeleton, frame: JointFrame) -> None:
    psn = output(skeleton)
    frame.frame_time = 0.5
    first = psn.encode(frame)
    second = psn.encode(frame)
    assert all(one is two for one, two in zip(first[-len(second) :], second, strict=True))


def test_what_is_no_posistagenet_is_malformed(skeleton: Skeleton, frame: JointFrame) -> None:
    whole = bytes(output(skeleton).encode(frame)[-1])
    for cut in range(1, len(whole)):
        with pytest.raises(MalformedPsnError):
            decode(whole[:cut])
    for nonsense in (b"", b"\x55\x67", struct.pack("<HH", 0x6757, 0), whole + b"\0"):
        with pytest.raises(MalformedPsnError):
            decode(nonsense)


def box_file(folder: Path, text: str) -> Path:
    path = folder / "box.yaml"
    path.write_text(f"outputs:\n  posistagenet:\n{text}")
    return path


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("    - {hosts: 10.0.0.1}", 3, "Did you mean 'host'?"),
        ("    - joints:\n        - head\n        - head", 5, "The joint 'head' is listed twice."),
        ("    - axes: [x, z, z]", 3, "Each of x, y and z is needed once."),
        ("    - axes: [x, up, z]", 3, ""),
        ("    - {every: 0}", 3, ""),
        ("    - {interface: eth0}", 3, "'eth0' is not an IPv4 address in numbers."),
    ],
)
def test_what_is_wrong_in_the_box_file_has_its_line(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        load_box(box_file(tmp_path, text))
    assert refused.value.line == line
    assert message in str(refused.value)


def test_joints_that_the_show_has_not_are_named_with_line_and_nearest(
    tmp_path: Path, skeleton: Skeleton
) -> None:
    path = box_file(tmp_path, "    - joints: [head]\n    - joints:\n        - hip\n        - lhnd\n")
    box = load_box(path)
    (problem,) = misfits(box.outputs.posistagenet, skeleton.names, 1, box.file)
    assert str(problem) == f"{path}:6: The show's skeleton has no joint 'lhnd'. Did you mean 'lHand'?"


def test_trackers_beyond_the_last_number_are_refused(tmp_path: Path, skeleton: Skeleton) -> None:
    path = box_file(tmp_path, "    - first_tracker: 65530\n")
    box = load_box(path)
    (problem,) = misfits(box.outputs.posistagenet, skeleton.names, 1, box.file)
    assert problem.line == 3 and f"would end at {65529 + len(skeleton)}" in problem.message
    assert (
        misfits([PosiStageNetConfig(first_tracker=65530, joints=["hip"])], skeleton.names, 1, box.file) == []
    )


def test_the_trackers_of_a_second_puppet_follow_and_have_its_name(skeleton: Skeleton) -> None:
    frames = [fill(one_puppet(len(skeleton)), skeleton, seed) for seed in (3, 4)]
    settings = PosiStageNetConfig(joints=["head", "hip"], first_tracker=10, speed=True)
    psn = PosiStageNet(settings, skeleton, ("left", "right"))
    info, *data = (decode(bytes(one)) for one in psn.encode(together(*frames)))
    assert info.names == {10: "head", 11: "hip", 12: "right head", 13: "right hip"}
    found = positions(data)
    for number, (frame, joint) in enumerate([(f, j) for f in frames for j in ("head", "hip")], 10):
        assert found[number] == tuple(frame.puppets[0].positions[skeleton.names.index(joint)])
    (problem,) = misfits(
        [PosiStageNetConfig(first_tracker=65500)], skeleton.names, 2, YamlFile(Path("box.yaml"))
    )
    assert "would end at 65545" in problem.message
