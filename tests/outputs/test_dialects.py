"""Each OSC dialect, read back by python-osc."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_packet import OscPacket

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.ai_toolbox import AiToolbox
from appliance.outputs.osc.dialects import DIALECTS, Addressed
from appliance.outputs.osc.frame_message import FrameMessage
from appliance.outputs.osc.joint import Joint
from appliance.outputs.osc.template import MAX_DATAGRAM, address_part, bundles, message
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from tests.outputs.conftest import fill
from tests.outputs.small_stage import encoded, one_puppet

ETHERNET_PAYLOAD = 1500 - 20 - 8  # bytes, less the headers of IPv4 and UDP


def read(datagrams: Sequence[memoryview]) -> list[tuple[str, list[object]]]:
    """What python-osc finds in the datagrams."""
    return [
        (timed.message.address, list(timed.message.params))
        for datagram in datagrams
        for timed in OscPacket(bytes(datagram)).messages
    ]


def test_ai_toolbox_sends_flat_lists_in_their_order(skeleton: Skeleton, frame: JointFrame) -> None:
    datagrams = encoded(AiToolbox(skeleton), frame)
    assert [len(OscPacket(bytes(datagram)).messages) for datagram in datagrams] == [1, 1, 1]
    messages = dict(read(datagrams))
    assert list(messages) == [
        "/mocap/0/joint/rot_local",
        "/mocap/0/joint/pos_world",
        "/mocap/0/joint/rot_world",
    ]
    np.testing.assert_array_equal(messages["/mocap/0/joint/rot_local"], frame.puppets[0].pose.ravel())
    np.testing.assert_array_equal(messages["/mocap/0/joint/pos_world"], frame.puppets[0].positions.ravel())
    np.testing.assert_array_equal(messages["/mocap/0/joint/rot_world"], frame.puppets[0].world.ravel())


def test_joint_sends_a_rotation_and_a_position_for_each_joint(skeleton: Skeleton, frame: JointFrame) -> None:
    messages = read(encoded(Joint(skeleton), frame))
    assert len(messages) == 2 * len(skeleton)
    by_address = dict(messages)
    for index, name in enumerate(skeleton.names):
        np.testing.assert_array_equal(by_address[f"/dancer/{name}/rot"], frame.puppets[0].pose[index])
        np.testing.assert_array_equal(by_address[f"/dancer/{name}/pos"], frame.puppets[0].positions[index])


def test_joint_names_with_reserved_signs_stay_one_part_of_the_address() -> None:
    skeleton = Skeleton(("mixamorig:Hips", "left arm/1*", "Fuß"), (-1, 0, 1), np.zeros((3, 3)))
    addresses = [address for address, _ in read(encoded(Joint(skeleton), one_puppet(3)))]
    assert addresses[::2] == ["/dancer/mixamorig:Hips/rot", "/dancer/left_arm_1_/rot", "/dancer/Fu_/rot"]
    assert address_part("lShldr") == "lShldr"


def test_a_frame_message_carries_tick_time_sequence_and_lateness() -> None:
    frame = one_puppet(1, tick=1 << 30, frame_time=123456.75, late=True, sensor_sequence=1 << 30)
    encoder = FrameMessage()
    assert read(encoder.encode(frame)) == [("/bunraku/frame", [1 << 30, 123456, 1 << 30, 1, 0.75])]
    frame.late, frame.sensor_sequence, frame.tick = False, -1, (1 << 31) + 5
    assert read(encoder.encode(frame)) == [("/bunraku/frame", [5, 123456, -1, 0, 0.75])]
    frame.sensor_sequence = (1 << 32) - 1
    assert read(encoder.encode(frame)) == [("/bunraku/frame", [5, 123456, (1 << 31) - 1, 0, 0.75])]


@pytest.mark.parametrize("dialect", sorted(DIALECTS))
def test_the_same_buffers_carry_the_next_frame(dialect: str, skeleton: Skeleton, frame: JointFrame) -> None:
    encoder = DIALECTS[dialect](skeleton, OscConfig(), Addressed())
    first = encoded(encoder, frame)
    second = encoded(encoder, fill(frame, skeleton, seed=2))
    assert all(a is b for a, b in zip(first, second, strict=True))
    fresh = DIALECTS[dialect](skeleton, OscConfig(), Addressed())
    encoded(fresh, fill(one_puppet(len(skeleton)), skeleton, seed=1))  # the same first frame time
    assert [bytes(d) for d in second] == [bytes(d) for d in encoded(fresh, frame)]


@pytest.mark.parametrize("dialect", ["joint", "vmc"])
@given(count=st.integers(1, 120), longest=st.integers(1, 60))
def test_bundles_fit_an_ethernet_frame_and_lose_nothing(dialect: str, count: int, longest: int) -> None:
    names = tuple(f"{'n' * (index % longest)}{index}" for index in range(count))
    parents = tuple(range(-1, count - 1))
    encoder = DIALECTS[dialect](Skeleton(names, parents, np.zeros((count, 3))), OscConfig(), Addressed())
    datagrams = encoded(encoder, one_puppet(count))
    assert max(map(len, datagrams)) < ETHERNET_PAYLOAD
    assert len(read(datagrams)) == (2 * count if dialect == "joint" else 3 + 1)


@given(st.lists(st.integers(0, 280), min_size=1, max_size=30))
def test_bundles_are_as_few_as_they_can_be_in_order(sizes: list[int]) -> None:
    messages = [message(f"/m{index}", floats=size) for index, size in enumerate(sizes)]
    datagrams = bundles(messages).datagrams
    assert max(map(len, datagrams)) <= MAX_DATAGRAM
    assert [address for address, _ in read(datagrams)] == [f"/m{index}" for index in range(len(sizes))]
    for earlier, later in itertools.pairwise(datagrams):
        first_of_later = 4 + int.from_bytes(later[16:20], "big")
        assert len(earlier) + first_of_later > MAX_DATAGRAM


@pytest.mark.parametrize("dialect", sorted(DIALECTS))
def test_the_documentation_names_every_address(dialect: str, skeleton: Skeleton, frame: JointFrame) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "osc.md").read_text(encoding="utf-8")
    names = {f"/{name}/" for name in skeleton.names}
    for address, _ in read(encoded(DIALECTS[dialect](skeleton, OscConfig(), Addressed()), frame)):
        spoken = next((address.replace(name, "/<joint>/") for name in names if name in address), address)
        assert f"`{spoken}`" in page
