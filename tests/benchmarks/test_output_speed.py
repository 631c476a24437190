"""What follows the puppet: the figure's kinematics, packing it, and sending it to everybody in one tick."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
import pypsn
import pytest
from pythonosc.osc_message_builder import OscMessageBuilder
from sacn.messages.data_packet import DataPacket

from appliance.dancer.forward_kinematics import Figure
from appliance.levers.show_state import ShowState
from appliance.levers.table import LIGHTS
from appliance.lights.patch import Patch
from appliance.lights.rig import Rig
from appliance.outputs.dmx.art_net import ArtDmx
from appliance.outputs.dmx.open_wire import open_universes
from appliance.outputs.dmx.sacn_packet import DataPackets
from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame, PuppetFrame
from appliance.outputs.osc.dialects import DIALECTS, Addressed
from appliance.outputs.outputs import Outputs
from appliance.outputs.posistagenet import PosiStageNet
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose import quaternion
from appliance.pose.skeleton import Skeleton
from appliance.show.box import OutputsConfig
from appliance.show.bundle import default_show_path
from appliance.show.lights import LightsConfig
from appliance.show.osc import OscConfig
from appliance.show.posistagenet import PosiStageNetConfig
from appliance.show.show import load_show
from hw_sim.dmx.artnet import ArtNetReceiver
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import HOST
from hw_sim.posistagenet import PsnReceiver
from tests.outputs.dmx.conftest import config, universe
from tests.outputs.small_stage import encoded, facts_of, one_puppet
from tests.studio.tiny import skeleton, swaying

FIGURE_GROUP = "forward kinematics of one pose"
OSC_GROUP = "one frame packed into OSC, dialect ai-toolbox"
DIALECTS_GROUP = "one frame packed into OSC, the other dialects"
PSN_GROUP = "one frame packed into PosiStageNet, the default show's figure"
SHARED_GROUP = "shared frame, the default show's figure"
OUTPUTS_GROUP = "all outputs of one tick, the default show's figure"


@pytest.fixture
def frame() -> JointFrame:
    """A pose of the tiny figure."""
    made = one_puppet(len(skeleton()))
    dance = swaying(1.0)
    made.puppets[0].pose[:] = dance.poses[7]
    positions, world = skeleton().forward_kinematics(made.puppets[0].pose, dance.roots[7].astype(np.float32))
    made.puppets[0].positions[:], made.puppets[0].world[:] = positions, world
    return made


def message(address: str, floats: list[float]) -> bytes:
    builder = OscMessageBuilder(address)
    for number in floats:
        builder.add_arg(number, "f")
    return bytes(builder.build().dgram)


def pack_with_python_osc(frame: JointFrame) -> list[bytes]:
    """The same three messages as the ai-toolbox dialect."""
    return [
        message("/mocap/0/joint/rot_local", frame.puppets[0].pose.ravel().tolist()),
        message("/mocap/0/joint/pos_world", frame.puppets[0].positions.ravel().tolist()),
        message("/mocap/0/joint/rot_world", frame.puppets[0].world.ravel().tolist()),
    ]


def test_python_osc(measured: Callable[..., Any], frame: JointFrame) -> None:
    benchmark = measured("python-osc", OSC_GROUP, reference=True)
    packed = benchmark(pack_with_python_osc, frame)
    ours = encoded(DIALECTS["ai-toolbox"](skeleton(), OscConfig(), Addressed()), frame)
    assert packed == [bytes(datagram) for datagram in ours]


def test_ai_toolbox(measured: Callable[..., Any], frame: JointFrame) -> None:
    encoder = DIALECTS["ai-toolbox"](skeleton(), OscConfig(), Addressed())
    assert len(measured("ours", OSC_GROUP)(encoder.encode, frame, frame.puppets[0])) == 3


@pytest.mark.parametrize("dialect", sorted(DIALECTS.keys() - {"ai-toolbox"}))
def test_dialect(measured: Callable[..., Any], frame: JointFrame, dialect: str) -> None:
    encoder = DIALECTS[dialect](skeleton(), OscConfig(), Addressed())
    assert measured(dialect, DIALECTS_GROUP)(encoder.encode, frame, frame.puppets[0])


def one_joint_after_another(bones: Skeleton, pose: Any, root: Any) -> list[Any]:
    """Forward kinematics as textbooks write it."""
    world: list[Any] = []
    positions: list[Any] = []
    for joint, parent in enumerate(bones.parents):
        if parent < 0:
            world.append(pose[joint])
            positions.append(root)
            continue
        world.append(quaternion.multiply(world[parent], pose[joint]))
        positions.append(positions[parent] + quaternion.rotate(world[parent], bones.offsets[joint]))
    return positions


def test_forward_kinematics_joint_by_joint(measured: Callable[..., Any], frame: JointFrame) -> None:
    benchmark = measured("joint by joint", FIGURE_GROUP, reference=True)
    positions = benchmark(
        one_joint_after_another, skeleton(), frame.puppets[0].pose, frame.puppets[0].positions[0]
    )
    np.testing.assert_allclose(positions, frame.puppets[0].positions, atol=1e-5)


def test_forward_kinematics_of_many_poses(measured: Callable[..., Any], frame: JointFrame) -> None:
    benchmark = measured("skeleton, any shape", FIGURE_GROUP)
    positions, _ = benchmark(
        skeleton().forward_kinematics, frame.puppets[0].pose, frame.puppets[0].positions[0]
    )
    np.testing.assert_allclose(positions, frame.puppets[0].positions, atol=1e-5)


def test_forward_kinematics_in_the_tick(measured: Callable[..., Any], frame: JointFrame) -> None:
    figure = Figure(skeleton())
    measured("figure, in the tick", FIGURE_GROUP)(
        figure.set_pose, frame.puppets[0].pose, frame.puppets[0].positions[0]
    )
    np.testing.assert_allclose(figure.positions, frame.puppets[0].positions, atol=1e-5)


def chunk(number: int, data: bytes, parent: bool = False) -> bytes:
    return struct.pack("<I", number | len(data) << 16 | parent << 31) + data


def pack_one_by_one(positions: list[Any]) -> bytes:
    """The same data packet, built up from its chunks as the description of the protocol lists them."""
    trackers = b"".join(
        chunk(number, chunk(0, struct.pack("<fff", *position)) + chunk(3, struct.pack("<f", 1.0)), True)
        for number, position in enumerate(positions)
    )
    header = chunk(0, struct.pack("<QBBBB", 0, 2, 0, 1, 1))
    return chunk(0x6755, header + chunk(1, trackers, True), True)


@pytest.fixture(scope="module")
def dancer() -> Skeleton:
    return load_show(default_show_path()).skeleton


@pytest.fixture
def full_frame(dancer: Skeleton) -> JointFrame:
    made = one_puppet(len(dancer))
    made.puppets[0].positions[:], made.puppets[0].world[:] = dancer.forward_kinematics(
        made.puppets[0].pose, np.zeros(3, np.float32)
    )
    return made


def test_posistagenet_chunk_by_chunk(
    measured: Callable[..., Any], dancer: Skeleton, full_frame: JointFrame
) -> None:
    benchmark = measured("struct, chunk by chunk", PSN_GROUP, reference=True)
    packed = benchmark(lambda: pack_one_by_one(full_frame.puppets[0].positions.tolist()))
    psn = PosiStageNet(PosiStageNetConfig(), dancer)
    psn.encode(full_frame)
    assert packed == bytes(psn.encode(full_frame)[0])
    assert len(pypsn.parse_psn_packet(packed).trackers) == len(dancer)


@pytest.mark.parametrize("speed", [False, True], ids=["positions", "positions and speeds"])
def test_posistagenet(
    measured: Callable[..., Any],
    dancer: Skeleton,
    full_frame: JointFrame,
    speed: bool,
    request: pytest.FixtureRequest,
) -> None:
    psn = PosiStageNet(PosiStageNetConfig(speed=speed), dancer)
    psn.encode(full_frame)
    label = f"ours, {request.node.callspec.id}"
    assert measured(label, PSN_GROUP)(psn.encode, full_frame)


def test_shared_frame_written(
    measured: Callable[..., Any], dancer: Skeleton, full_frame: JointFrame, tmp_path: Path
) -> None:
    writer = FrameWriter(tmp_path, facts_of(dancer))
    measured("write, in the tick", SHARED_GROUP)(writer.write, full_frame)
    assert FrameReader(tmp_path).newest(0.0) is not None


def test_shared_frame_read(
    measured: Callable[..., Any], dancer: Skeleton, full_frame: JointFrame, tmp_path: Path
) -> None:
    writer = FrameWriter(tmp_path, facts_of(dancer))
    writer.write(full_frame)
    reader = FrameReader(tmp_path)
    seen = measured("read the newest, in the reader", SHARED_GROUP)(reader.newest, 0.0)
    np.testing.assert_array_equal(seen.puppets[0].positions, full_frame.puppets[0].positions)


@pytest.fixture
def everybody(dancer: Skeleton, tmp_path: Path) -> Iterator[Outputs]:
    """Three OSC receivers with a dialect each, a multicast receiver, the shared frame: all really there."""
    with (
        OscReceiver(HOST) as one,
        OscReceiver(HOST) as two,
        OscReceiver(HOST) as three,
        PsnReceiver(HOST, port=0) as followspot,
    ):
        receivers = zip((one, two, three), ("ai-toolbox", "joint", "vmc"), strict=True)
        osc = [{"port": peer.port, "dialect": dialect, "frame_message": True} for peer, dialect in receivers]
        psn = {"port": followspot.port, "joints": list(dancer.names[:8]), "speed": True}
        outputs = Outputs(OutputsConfig.model_validate({"osc": osc, "posistagenet": [psn]}), dancer)
        outputs.share(FrameWriter(tmp_path, facts_of(dancer)))
        yield outputs
        outputs.close()


def test_all_outputs_of_one_tick(
    measured: Callable[..., Any], everybody: Outputs, full_frame: JointFrame
) -> None:
    """Three receivers by OSC, 8 trackers by PosiStageNet, the shared frame: 0.3 ms is the limit."""
    measured("OSC to three, PosiStageNet, shared frame", OUTPUTS_GROUP)(everybody.publish_frame, full_frame)
    assert all(receiver.sent and not receiver.dropped for receiver in everybody.receivers)


SACN_GROUP = "one universe packed into sACN"
ART_NET_GROUP = "one universe packed into Art-Net"
SENT_GROUP = "two universes to two sockets"
CID = UUID("00112233-4455-6677-8899-aabbccddeeff")


def test_sacn_library(measured: Callable[..., Any]) -> None:
    packet = DataPacket(tuple(CID.bytes), "A box", 7, tuple(universe()))

    def pack() -> bytes:
        packet.dmxData = tuple(universe_now)
        packet.sequence_increase()
        return bytes(packet.getBytes())

    universe_now = universe(1)
    theirs = measured("the sacn library", SACN_GROUP, reference=True)(pack)
    ours = bytearray(DataPackets(CID, "A box", 7, 512).pack(universe_now))
    ours[111] = theirs[111]  # the sequence: the benchmark has packed many
    assert theirs == bytes(ours)


def test_sacn(measured: Callable[..., Any]) -> None:
    packets, data = DataPackets(CID, "A box", 7, 512), universe(1)
    assert len(measured("ours", SACN_GROUP)(packets.pack, data)) == 638


def pack_as_textbooks_do(port_address: int, sequence: int, levels: bytes) -> bytes:
    """ArtDmx field by field, each level checked, as packers in plain Python write it."""
    packet = b"Art-Net\0" + struct.pack("<H", 0x5000) + struct.pack(">H", 14)
    packet += (
        struct.pack("BB", sequence, 0) + struct.pack("<H", port_address) + struct.pack(">H", len(levels))
    )
    for level in levels:
        packet += struct.pack("B", min(max(int(level), 0), 255))
    return packet


def test_art_net_in_plain_python(measured: Callable[..., Any]) -> None:
    benchmark = measured("plain Python, level by level", ART_NET_GROUP, reference=True)
    theirs = benchmark(pack_as_textbooks_do, 7, 1, universe(1))
    assert theirs == bytes(ArtDmx(7, 512).pack(universe(1)))


def test_art_net(measured: Callable[..., Any]) -> None:
    packets, data = ArtDmx(7, 512), universe(1)
    assert len(measured("ours", ART_NET_GROUP)(packets.pack, data)) == 530


@pytest.fixture
def nodes() -> Iterator[tuple[ArtNetReceiver, ArtNetReceiver]]:
    with ArtNetReceiver() as one, ArtNetReceiver() as other:
        yield one, other


def test_two_universes_sent(
    measured: Callable[..., Any], nodes: tuple[ArtNetReceiver, ArtNetReceiver]
) -> None:
    wires = [config("artnet", universe=number, port=node.port) for number, node in enumerate(nodes)]
    universes = open_universes(wires)
    levels = bytearray(universe(1))
    clock = iter(range(1 << 40))

    def send() -> None:
        now = float(next(clock))  # a second apart: each of them leaves
        levels[0] ^= 1
        for one in universes:
            one.offer(levels, now)

    measured("Art-Net over loopback", SENT_GROUP)(send)
    assert all(one.wire.dropped == 0 and one.wire.sent > 0 for one in universes)
    assert all(node.poll(1.0) for node in nodes)


GROUP = "lights, one pass: 48 moving heads, 60 LED PARs and 14 RGB lamps on two universes"
RULES = [
    {"reads": "place", "joint": "lHand", "drives": "aim"},
    {"reads": "speed", "joint": "lHand", "drives": "dimmer", "attack_s": 0.1, "release_s": 1.0},
    {"reads": "speed", "drives": "dimmer", "mix": "highest"},
    {"reads": "height", "joint": "head", "drives": "colour", "colours": [[1, 0, 0], [0, 0, 1]]},
    {"reads": "turn", "drives": "zoom"},
]


def full_universe(universe: int) -> list[dict[str, Any]]:
    """24 heads of 12 channels, 30 lamps of 6, 7 of 3: 489 of 512."""
    kinds = [("moving-wash", None, 12, 24), ("led-par", "RGBW", 6, 30), ("rgb", None, 3, 7)]
    fixtures: list[dict[str, Any]] = []
    address = 1
    for profile, mode, width, count in kinds:
        for number in range(count):
            place = [number / 4 - 3, 4, universe]
            one = {"name": f"{profile} {universe} {number}", "profile": profile, "universe": universe}
            fixtures.append({**one, "mode": mode, "address": address, "place": place})
            address += width
    return fixtures


@pytest.mark.parametrize("fading", [False, True], ids=["one mapping", "fading into another"])
def test_pass(measured: Callable[..., Any], fading: bool, request: pytest.FixtureRequest) -> None:
    skeleton = load_show(default_show_path()).skeleton
    values = {
        "fixtures": [*full_universe(1), *full_universe(2)],
        "mappings": [{"name": name, "rules": RULES} for name in ("one", "other")],
    }
    config = LightsConfig.model_validate(values)
    rig = Rig(config, Patch(config.fixtures, None), skeleton)
    rig.safety = 0.0
    show_state = ShowState().to(LIGHTS, "one").to(LIGHTS, "other", 0.0, 1e9) if fading else ShowState()
    frames = itertools.cycle(range(200))
    dance = [_frame(skeleton, number) for number in range(200)]
    clock = itertools.count()

    def one_pass() -> dict[int, bytes]:
        return rig.render(dance[next(frames)], 1, show_state, next(clock) * 0.025)

    levels = measured(request.node.callspec.id, GROUP)(one_pass)
    assert set(levels) == {1, 2}


def _frame(skeleton: Skeleton, number: int) -> JointFrame:
    """A figure that wanders."""
    pose = np.tile(np.array([1, 0, 0, 0], np.float32), (len(skeleton), 1))
    root = np.array([np.sin(number / 30), 0.9, np.cos(number / 30)], np.float32)
    positions, world = skeleton.forward_kinematics(pose, root)
    seconds = number * 0.02
    holds = np.zeros(len(positions), np.float32)
    puppet = PuppetFrame(root, pose, pose, world, positions, holds)
    return JointFrame((puppet,), number, seconds, left=seconds)
