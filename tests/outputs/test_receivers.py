"""OSC receivers over real sockets: each gets its dialect, under each puppet's addresses."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np

from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.osc.vmc import Vmc
from appliance.outputs.receivers import OscOutputs
from appliance.pose.skeleton import Skeleton
from appliance.show.osc import OscConfig
from hw_sim.osc_receiver import OscReceiver
from tests.outputs.conftest import fill
from tests.outputs.osc_peers import LOOPBACK, take
from tests.outputs.small_stage import encoded, one_puppet, together


def test_each_receiver_gets_its_dialect_with_the_frame_message_first(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    with OscReceiver(LOOPBACK) as toolbox, OscReceiver(LOOPBACK) as channels, OscReceiver(LOOPBACK) as avatar:
        outputs = OscOutputs(
            [
                OscConfig(port=toolbox.port, dialect="ai-toolbox", frame_message=True),
                OscConfig(port=channels.port, dialect="joint", frame_message=False),
                OscConfig(port=avatar.port, dialect="vmc", frame_message=True),
            ],
            skeleton,
        )
        outputs.send_frame(frame)
        first = take(toolbox, 4)
        assert [address for _, address, _ in first] == [
            "/bunraku/frame",
            "/mocap/0/joint/rot_local",
            "/mocap/0/joint/pos_world",
            "/mocap/0/joint/rot_world",
        ]
        np.testing.assert_array_equal(np.array(first[1][2], np.float32), frame.puppets[0].pose.ravel())
        assert take(channels, 2 * len(skeleton))[0][1] == "/dancer/hip/rot"
        assert [address for _, address, _ in take(avatar, 4)][:2] == ["/bunraku/frame", "/VMC/Ext/OK"]
        assert [receiver.dropped for receiver in outputs.receivers] == [0, 0, 0]
        assert outputs.receivers[0].sent == 4
        outputs.close()


def test_two_receivers_of_one_dialect_get_the_same_bytes(skeleton: Skeleton, frame: JointFrame) -> None:
    with OscReceiver(LOOPBACK) as one, OscReceiver(LOOPBACK) as two:
        outputs = OscOutputs([OscConfig(port=one.port), OscConfig(port=two.port)], skeleton)
        outputs.send_frame(frame)
        assert [m[1:] for m in take(one, 3)] == [m[1:] for m in take(two, 3)]
        outputs.close()


def test_each_puppet_goes_out_under_its_own_addresses(skeleton: Skeleton) -> None:
    frames = [fill(one_puppet(len(skeleton)), skeleton, seed) for seed in (7, 8, 9)]
    wanted: list[dict[str, Any]] = [
        {"messages": ["rot_local"], "frame_message": True},
        {"messages": ["rot_local"], "prefix": "/mocap/joint"},  # it has room for one
        {"dialect": "features", "prefix": "/mocap/3/joint"},
        {"dialect": "joint"},
        {"dialect": "vmc"},
        {"messages": ["rot_local"], "puppet": 2},
    ]
    with ExitStack() as opened:
        peers = [opened.enter_context(OscReceiver(LOOPBACK)) for _ in wanted]
        configs = [OscConfig(port=peer.port, **one) for peer, one in zip(peers, wanted, strict=True)]
        outputs = OscOutputs(configs, skeleton, puppets=[()] * 3)
        outputs.send_frame(together(*frames))
        toolbox = take(peers[0], 4)
        assert [said[1] for said in toolbox[:1]] == ["/bunraku/frame"]
        for number, (said, frame) in enumerate(zip(toolbox[1:], frames, strict=True)):
            assert said[1] == f"/mocap/{number}/joint/rot_local"
            np.testing.assert_array_equal(np.array(said[2], np.float32), frame.puppets[0].pose.ravel())
        assert [said[1] for said in take(peers[1], 1)] == ["/mocap/joint/rot_local"]
        features = [said[1] for said in take(peers[2], 30)]
        assert features[::10] == [f"/mocap/{number}/joint/velocity" for number in (3, 4, 5)]
        joints = take(peers[3], 3 * 2 * len(skeleton))
        hips = {said[1]: said[2] for said in joints if said[1].endswith("/hip/rot")}
        for dancer, frame in zip(("", "/1", "/2"), frames, strict=True):
            said = hips[f"/dancer{dancer}/hip/rot"]
            np.testing.assert_array_equal(np.array(said, np.float32), frame.puppets[0].pose[0])
        last = take(peers[5], 1)
        assert last[0][1] == "/mocap/0/joint/rot_local"
        np.testing.assert_array_equal(np.array(last[0][2], np.float32), frames[2].puppets[0].pose.ravel())
        assert outputs.receivers[1].sent == 1 and outputs.receivers[4].sent == len(
            encoded(Vmc(skeleton), frames[0])
        )
        outputs.close()
