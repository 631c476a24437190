"""Networks that never end or take all memory: check and play refuse them, name the file, and can be ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from appliance.cli.check import check_show, pack
from appliance.show.bundle import write_checksums
from appliance.stage.stage_error import StageError
from appliance.start import INTERRUPTED
from tests.bundles import write_show
from tests.command import Command
from tests.system.processes import children, wait_until

PATIENCE_S = 120.0


def spoilt(show: Path, nodes: list[onnx.NodeProto], constants: list[onnx.TensorProto]) -> Path:
    """The show with a network that does this before it hands its window on."""
    model = onnx.load(str(show / "puppet.onnx"))
    poses = next(node for node in model.graph.node if "poses" in node.output)
    poses.output[0] = "sound"
    model.graph.node.extend([*nodes, helper.make_node("Add", ["sound", "nothing"], ["poses"])])
    model.graph.initializer.extend(constants)
    onnx.save(model, str(show / "puppet.onnx"))
    write_checksums(show)
    return show


def endless(show: Path, from_iterations: int) -> Path:
    """A show with a network that never ends from this many coding iterations on."""
    body = helper.make_graph(
        [
            helper.make_node("Identity", ["so_far"], ["as_it_was"]),
            helper.make_node("ReduceMax", ["coding_iterations"], ["most"], keepdims=0),
            helper.make_node("GreaterOrEqual", ["most", "many"], ["again"]),
        ],
        "body",
        [
            helper.make_tensor_value_info("turn", TensorProto.INT64, []),
            helper.make_tensor_value_info("before", TensorProto.BOOL, []),
            helper.make_tensor_value_info("so_far", TensorProto.FLOAT, [1]),
        ],
        [
            helper.make_tensor_value_info("again", TensorProto.BOOL, []),
            helper.make_tensor_value_info("as_it_was", TensorProto.FLOAT, [1]),
        ],
    )
    constants = [
        helper.make_tensor("many", TensorProto.INT64, [], [from_iterations]),
        helper.make_tensor("zero", TensorProto.FLOAT, [1], [0.0]),
        helper.make_tensor("yes", TensorProto.BOOL, [], [True]),
    ]
    return spoilt(show, [helper.make_node("Loop", ["", "yes", "zero"], ["nothing"], body=body)], constants)


def greedy(show: Path) -> Path:
    """A show with a network that needs a terabyte."""
    constants = [
        helper.make_tensor("shape", TensorProto.INT64, [2], np.array([1 << 19, 1 << 19])),
        helper.make_tensor("last", TensorProto.INT64, [1], np.array([-1])),
    ]
    nodes = [
        helper.make_node("Cast", ["coding_iterations"], ["numbers"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMax", ["numbers"], ["number"], keepdims=0),
        helper.make_node("Expand", ["number", "shape"], ["enormous"]),
        helper.make_node("ReduceMin", ["enormous"], ["least"], keepdims=0),
        helper.make_node("Sub", ["least", "least"], ["nothing"]),
    ]
    return spoilt(show, nodes, constants)


def box(folder: Path) -> Path:
    path = folder / "box.yaml"
    path.write_text("control: null\nsensors: {udp: null}\noutputs: {osc: []}\n")
    return path


@pytest.mark.parametrize("from_iterations", [1, 3])
def test_check_gives_an_endless_network_up_and_names_it(tmp_path: Path, from_iterations: int) -> None:
    show = endless(write_show(tmp_path / "show"), from_iterations)
    with pytest.raises(StageError, match=r"puppet\.onnx: .*it never ends.*Export the show"):
        check_show(show, box(tmp_path), patience_s=3.0)


def test_a_network_that_needs_all_memory_is_refused(tmp_path: Path, bunraku: Command) -> None:
    show = greedy(write_show(tmp_path / "show"))
    with pytest.raises(StageError, match=r"puppet\.onnx"):
        check_show(show, box(tmp_path))
    with pytest.raises(StageError, match=r"puppet\.onnx"):
        pack(show)
    refusal = bunraku("play", "--show", show, "--box", box(tmp_path), "--seconds", "1", status=2)
    assert "puppet.onnx" in refusal.err


def test_play_refuses_an_endless_network(tmp_path: Path) -> None:
    show = endless(write_show(tmp_path / "show"), 3)
    hurried = (
        "import sys; from appliance.cli import network_proof; from appliance.start import main;"
        "network_proof.ONE_RUN_S = 3.0; main(sys.argv[1:])"
    )
    done = subprocess.run(
        [sys.executable, "-c", hurried, "play", "--show", show, "--box", box(tmp_path)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert "puppet.onnx: this network was given up" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGTERM, -signal.SIGTERM), (signal.SIGINT, INTERRUPTED)]
)
def test_a_signal_ends_play_while_its_network_hangs(
    tmp_path: Path, number: signal.Signals, status: int
) -> None:
    """What it had started to prove the network ends too, though no process is left to stop it."""
    show = endless(write_show(tmp_path / "show"), 3)
    hearing = ("env", "--default-signal=INT")  # what runs in a shell's background ignores it
    command = [sys.executable, "-m", "appliance.start", "play", "--show", show, "--box", box(tmp_path)]
    with subprocess.Popen([*hearing, *command], stderr=subprocess.PIPE, text=True) as process:
        child = first_child(process.pid)
        wait_until(lambda: processor_s(child) > 0.2, "the network does not run")
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == status
        assert process.stderr is not None and "Traceback" not in process.stderr.read()
    wait_until(lambda: not Path(f"/proc/{child}").exists(), "it goes on for ever")


def first_child(pid: int) -> int:
    return wait_until(lambda: children(pid), "it starts no process")[0]


def processor_s(pid: int) -> float:
    user, system = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
