"""All outputs behind one call: each gets the frame, and one that is missing costs the others nothing."""

from __future__ import annotations

import gc
import time
from pathlib import Path

import numpy as np
import pytest

from appliance.outputs.frame_reader import FrameReader
from appliance.outputs.joint_frame import JointFrame
from appliance.outputs.outputs import Outputs
from appliance.outputs.shared_frame import FrameWriter
from appliance.pose.skeleton import Skeleton
from appliance.show.box import OutputsConfig
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import free_ports
from hw_sim.posistagenet import PsnReceiver
from tests.outputs.conftest import fill
from tests.outputs.small_stage import facts_of

LOOPBACK = "127.0.0.1"


def configured(osc: int, psn: int) -> OutputsConfig:
    return OutputsConfig.model_validate(
        {
            "osc": [{"port": osc}],
            "posistagenet": [{"port": psn}, {"host": LOOPBACK, "port": osc, "every": 50}],
        }
    )


def test_everybody_gets_the_frame(tmp_path: Path, skeleton: Skeleton, frame: JointFrame) -> None:
    (port,) = free_ports(1)
    with OscReceiver(LOOPBACK) as osc, PsnReceiver(LOOPBACK, port=port) as psn:
        outputs = Outputs(configured(osc.port, port), skeleton)
        outputs.share(FrameWriter(tmp_path, facts_of(skeleton)))
        outputs.publish_frame(frame)
        outputs.publish_health({"state": "dancing"})
        reader = FrameReader(tmp_path)
        seen = reader.newest(frame.frame_time)
        assert seen is not None
        np.testing.assert_array_equal(seen.puppets[0].positions, frame.puppets[0].positions)
        assert reader.health() == {"state": "dancing"}
        assert [one.is_data for one in psn.poll(5.0)] == [False, True]
        assert osc.poll(5.0)[0][1] == "/mocap/0/joint/rot_local"
        assert [receiver.sent for receiver in outputs.receivers] == [3, 2, 2]
        assert [receiver.dropped for receiver in outputs.receivers] == [0, 0, 0]
        outputs.close()
        assert reader.state(frame.frame_time + 1.0) == "absent"


def test_without_a_shared_frame_the_others_go_on(skeleton: Skeleton, frame: JointFrame) -> None:
    (port,) = free_ports(1)
    with OscReceiver(LOOPBACK) as osc:
        outputs = Outputs(configured(osc.port, port), skeleton)
        outputs.publish_frame(frame)
        outputs.publish_health({"state": "dancing"})
        assert len(osc.poll(5.0)) == 3
        outputs.close()


def test_a_box_that_is_stopped_between_its_last_look_and_a_frame_sends_none(
    skeleton: Skeleton, frame: JointFrame
) -> None:
    """Both boxes of a pair would be heard: it may lead no longer when it goes on."""
    with OscReceiver(LOOPBACK) as osc:
        outputs = Outputs(configured(osc.port, osc.port), skeleton)
        outputs.speaks_until = lambda: time.monotonic() + 60.0
        outputs.publish_frame(frame)
        assert osc.poll(5.0)
        outputs.speaks_until = time.monotonic  # over by the time at which datagrams would leave
        before = [one.sent for one in outputs.receivers]
        outputs.publish_frame(frame)
        assert [one.sent for one in outputs.receivers] == before and all(before)
        outputs.close()


def test_receivers_that_are_not_there_are_named_and_counted(skeleton: Skeleton, frame: JointFrame) -> None:
    port, nobody = free_ports(2)
    settings = {"osc": [{"port": nobody}], "posistagenet": [{"port": port, "interface": "192.0.2.1"}]}
    outputs = Outputs(OutputsConfig.model_validate(settings), skeleton)
    for tick in range(20):
        outputs.publish_frame(fill(frame, skeleton, tick))
    assert [receiver.name for receiver in outputs.receivers] == [
        f"127.0.0.1:{nobody} (ai-toolbox)",
        f"236.10.10.10:{port} (posistagenet)",
    ]
    assert all(receiver.dropped and receiver.last_error for receiver in outputs.receivers)
    outputs.close()


@pytest.mark.parametrize("receivers", [True, False], ids=["heard", "unheard"])
def test_sending_leaves_nothing_for_the_collector(
    tmp_path: Path, skeleton: Skeleton, frame: JointFrame, receivers: bool
) -> None:
    (port, nobody) = free_ports(2)
    with OscReceiver(LOOPBACK) as osc:
        outputs = Outputs(configured(osc.port if receivers else nobody, port), skeleton)
        outputs.share(FrameWriter(tmp_path, facts_of(skeleton)))
        for tick in range(200):
            outputs.publish_frame(fill(frame, skeleton, tick))
        gc.collect()
        gc.disable()
        try:
            before = gc.get_count()[0]
            for _ in range(300):
                frame.frame_time += 0.02
                outputs.publish_frame(frame)
            left = gc.get_count()[0] - before
        finally:
            gc.enable()
        outputs.close()
    assert left < 20
