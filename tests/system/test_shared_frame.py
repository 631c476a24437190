"""The real box shares its frames: other processes see them, and see when the stage hangs or dies."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.outputs.frame_reader import FrameReader
from hw_sim.osc_receiver import OscReceiver
from hw_sim.peers import HOST, free_ports
from hw_sim.posistagenet import PsnReceiver
from tests.bundles import FIGURE
from tests.system.box import PLAY, playing
from tests.system.processes import PATIENCE_S, run, wait_until

pytestmark = pytest.mark.realtime

# Mounts a runtime folder with room for a few pages, in its own mount namespace, and becomes the box.
IN_A_FULL_FOLDER = """
mkdir -m 700 "$1/runtime" && mount -t tmpfs -o size=16k,mode=700 none "$1/runtime" && shift && exec "$@"
"""


def test_readers_get_frames_facts_and_health(show: Path, tmp_path: Path) -> None:
    reader = FrameReader(tmp_path / "runtime")
    assert reader.state(time.monotonic()) == "absent"
    with playing(show, tmp_path, "--alone", settings={"limits": {"late_ms": 20}}) as box:
        wait_until(lambda: reader.state(time.monotonic()) == "fresh")
        facts = reader.facts
        assert facts is not None and facts.pid == box.process.pid and facts.skeleton.names == FIGURE.names
        assert facts.show_directory == show and facts.box_file == tmp_path / "box.yaml"
        assert [tuple(hand) for hand in facts.led.hands] == [("lShldr", "left-wrist", "orientation")]

        sent = {frame[0]: frame for frame in box.frames(100)}
        seen = reader.frames(50, time.monotonic())
        while max(sent) < seen[-1].tick:
            sent |= {frame[0]: frame for frame in box.frames(1)}
        common = [frame for frame in seen if frame.tick in sent]
        assert len(common) > 20
        for frame in common:
            _, second, _, _, rest = sent[frame.tick]
            assert frame.frame_time == pytest.approx(second + rest, abs=1e-6)
        assert [frame.tick for frame in seen] == sorted({frame.tick for frame in seen})
        assert all(0.0 < frame.left - frame.frame_time < PATIENCE_S for frame in seen)

        health = wait_until(lambda: (reader.health() or {}).get("ticks", 0) > 100 and reader.health())
        assert health["state"] == "dancing" and health["puppets"][0]["phrase"] == "main"
        assert health["rate_hz"] > 0 and health["tick_p50_ms"] > 0
        assert health["sensors"][0][:3] == ["left-wrist", f"{box.key.device_id:08x}", "absent"]
        assert [one["dropped"] for one in health["receivers"]] == [0]
        assert box.end() == 0
    wait_until(lambda: reader.state(time.monotonic()) == "absent")


def test_readers_tell_a_hung_stage_from_a_dead_one_and_find_the_next(show: Path, tmp_path: Path) -> None:
    reader = FrameReader(tmp_path / "runtime")
    with playing(show, tmp_path, "--alone") as box:
        wait_until(lambda: reader.state(time.monotonic()) == "fresh")
        box.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: reader.state(time.monotonic()) == "stale")
        assert reader.is_alive(time.monotonic())
        box.process.send_signal(signal.SIGCONT)
        wait_until(lambda: reader.state(time.monotonic()) == "fresh")
        assert reader.generation == 1

        box.end(signal.SIGKILL)
        wait_until(lambda: not reader.is_alive(time.monotonic()))
        assert reader.state(time.monotonic()) == "stale"
        last = reader.newest(time.monotonic())
        assert last is not None

        box.kill_and_restart()
        wait_until(lambda: reader.state(time.monotonic()) == "fresh")
        assert reader.generation == 2
        assert box.end() == 0


def test_a_second_stage_in_the_same_folder_is_refused_and_the_first_dances_on(
    show: Path, tmp_path: Path
) -> None:
    with playing(show, tmp_path, "--alone") as box:
        box.frames(1)
        (tmp_path / "second.yaml").write_text(
            yaml.safe_dump({"runtime": "runtime", "control": None, "sensors": {"udp": None}})
        )
        second = run([*PLAY, "--alone", "--show", show, "--box", tmp_path / "second.yaml"])
        assert second.returncode == 2, second.stderr
        assert "Another stage runs in" in second.stderr and "`runtime:` in the box file" in second.stderr
        before = box.frames(1)[0][0]
        assert box.frames(20)[-1][0] > before
        assert box.end() == 0


def test_without_room_for_the_frames_the_dance_goes_on_and_says_so(show: Path, tmp_path: Path) -> None:
    namespace = ["unshare", "--mount", "--map-root-user"]
    if run([*namespace, "mount", "-t", "tmpfs", "none", "/mnt"]).returncode:
        pytest.skip("this machine does not allow mount namespaces")
    command = [*namespace, "sh", "-c", IN_A_FULL_FOLDER, "sh", str(tmp_path), *PLAY]
    with playing(show, tmp_path, "--alone", command=command) as box:
        frames = box.frames(60)
        assert [frame[3] for frame in frames].count(0) > 0
        box.await_output("the frames cannot be shared (No space left on device). The dance goes on")
        assert box.end() == 0


def test_positions_reach_a_media_server(show: Path, tmp_path: Path) -> None:
    (port,) = free_ports(1)
    joints = ["lShldr", FIGURE.names[0]]
    with PsnReceiver(HOST, port=port) as server, OscReceiver(HOST) as osc:
        outputs = {
            "osc": [{"port": osc.port}],
            "posistagenet": [{"port": port, "joints": joints, "system_name": "Evening"}],
        }
        (tmp_path / "box.yaml").write_text(
            yaml.safe_dump(
                {"outputs": outputs, "control": None, "sensors": {"udp": None}, "runtime": "runtime"}
            )
        )
        ran = run([*PLAY, "--alone", "--show", show, "--box", tmp_path / "box.yaml", "--seconds", "2"])
        assert ran.returncode == 0, ran.stderr
        assert f"236.10.10.10:{port} (posistagenet)" in ran.stdout
        packets = server.poll(1.0)
    assert server.malformed == 0
    names = [one for one in packets if not one.is_data]
    data = [one for one in packets if one.is_data]
    assert {tuple(one.names.values()) for one in names} == {tuple(joints)}
    assert {one.system for one in names} == {"Evening"} and len(names) in (1, 2, 3)  # it may be held up
    numbers = [one.frame for one in data]
    assert len(data) > 10 and numbers == [number % 256 for number in range(len(data))]
    assert f"Danced {len(data)} ticks" in ran.stdout
    hips = np.array([one.trackers[1].position for one in data])
    assert np.isfinite(hips).all() and np.ptp(hips, axis=0).max() > 0.0


def test_a_tracker_that_is_not_in_the_skeleton_is_refused_with_its_line(show: Path, tmp_path: Path) -> None:
    path = tmp_path / "box.yaml"
    tracked = {"outputs": {"posistagenet": [{"joints": ["lShouldr"]}]}}
    path.write_text(
        yaml.safe_dump({"runtime": "runtime", "sensors": {"udp": None}}) + yaml.safe_dump(tracked)
    )
    ran = run([*PLAY, "--show", show, "--box", path])
    assert ran.returncode == 2
    assert f"{path}:7: The show's skeleton has no joint 'lShouldr'. Did you mean 'lShldr'?" in ran.stderr
