"""Errors are measured where the dance is sound, by joint name, in degrees and centimetres."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.pose.reading_options import ReadingOptions
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from appliance.studio.evaluation import evaluation
from appliance.studio.evaluation.coders import Poses, open_coder
from appliance.studio.evaluation.evaluation import Evaluation, evaluate, load_takes
from appliance.studio.evaluation.pictures import dressed, new_figure
from appliance.studio.evaluation.report_picture import (
    ALIVE,
    COLOURS,
    WIDTH_INCHES,
    alive,
    draw_alive,
    draw_joints,
)
from appliance.studio.studio_error import StudioError
from tests.pose.conventions import skeleton_of
from tests.studio.test_export import NAMES
from tests.studio.tiny import moving, skeleton, swaying


class Turning:
    """A coder that turns one joint by so many degrees in each iteration and leaves the others alone."""

    batch = 64

    def __init__(self, joint: str, degrees: float) -> None:
        self.joints, self.facts = tuple(NAMES), {"file": "turning"}
        self.rest = np.tile(quaternion.IDENTITY, (len(NAMES), 1))
        self._joint, self._degrees = NAMES.index(joint), degrees

    def iterate(self, windows: Poses, coding_iterations: int) -> tuple[Poses, Poses]:
        turn = quaternion.from_axis_angle([0.0, 0.0, 1.0], np.radians(self._degrees * coding_iterations))
        made = windows.copy()
        made[:, :, self._joint] = quaternion.multiply(made[:, :, self._joint], turn)
        return made, np.tile(np.array([1.0, -1.0, 3.0], dtype=np.float32), (len(windows), 1))


def reordered(recording: Recording) -> Recording:
    """The same dance with its joints in another order and a hat on the head."""
    old = recording.skeleton
    children = {j: [c for c, p in enumerate(old.parents) if p == j] for j in range(len(old))}
    order: list[int] = []

    def visit(joint: int) -> None:
        order.append(joint)
        for child in reversed(children[joint]):
            visit(child)

    visit(0)
    assert order != list(range(len(old)))
    names = (*(old.names[j] for j in order), "hat")
    parents = (
        *(order.index(old.parents[j]) if old.parents[j] >= 0 else -1 for j in order),
        names.index("head"),
    )
    offsets = np.vstack([old.offsets[order], [[0.0, 0.2, 0.0]]])
    hat = np.tile(np.array([1.0, 0, 0, 0]), (len(recording), 1, 1))
    poses = np.concatenate([recording.poses[:, order], hat], axis=1)
    return Recording(Skeleton(names, parents, offsets), poses, recording.roots, recording.fps)


def measured(folder: Path, recording: Recording, coder: Turning, all_frames: bool = False) -> Evaluation:
    write_bvh(folder / "dance.bvh", recording)
    return evaluate(coder, load_takes([folder / "dance.bvh"], coder, ReadingOptions(all_frames=all_frames)))


def test_one_turned_joint_is_the_whole_error(tmp_path: Path) -> None:
    figures = measured(tmp_path, swaying(2.0), Turning("lForeArm", 3.0)).as_json()
    for k in (1, 2, 5, 10):
        assert figures["degrees"][str(k)]["max"] == pytest.approx(3.0 * k, abs=0.01)
        assert figures["degrees"][str(k)]["mean"] == pytest.approx(3.0 * k / 17, abs=0.01)
        assert figures["by_joint_degrees"][str(k)]["lForeArm"] == pytest.approx(3.0 * k, abs=0.01)
    # The hand hangs 23 cm below the elbow that turns; nothing else leaves its place.
    for k in (1, 10):
        chord = 100 * 0.23 * 2 * np.sin(np.radians(3.0 * k) / 2)
        assert figures["centimetres"][str(k)]["max"] == pytest.approx(chord, abs=0.01)
        assert figures["centimetres"][str(k)]["mean"] == pytest.approx(chord / 17, abs=0.01)
    assert figures["latent"]["mean"] == pytest.approx(1.0, abs=1e-3)
    assert figures["latent"]["std"] == pytest.approx(np.std([1.0, -1.0, 3.0]), abs=1e-3)
    assert figures["latent"]["mean_of_each_size"] == pytest.approx(5 / 3, abs=1e-3)
    assert figures["windows"] == 100 - 7


def test_another_order_of_joints_and_more_of_them_change_nothing(tmp_path: Path) -> None:
    coder = Turning("abdomen", 2.0)
    one = measured(tmp_path, swaying(2.0), coder).as_json()
    other = measured(tmp_path, reordered(swaying(2.0)), coder).as_json()
    assert one == other


def test_a_glitch_is_not_counted_unless_asked_for(tmp_path: Path) -> None:
    dance = swaying(2.0)
    turn = quaternion.from_axis_angle([0.0, 1.0, 0.0], np.radians(80.0))
    dance.poses[50, 3] = quaternion.multiply(turn, dance.poses[50, 3])
    masked = measured(tmp_path, dance, Turning("head", 1.0))
    assert 2 <= masked.masked_frames <= 5
    assert len(masked.latents) == 93 - 7 - masked.masked_frames
    everything = measured(tmp_path, dance, Turning("head", 1.0), all_frames=True)
    assert everything.masked_frames == 0 and len(everything.latents) == 93


def test_the_true_rate_is_taken_at_its_word(tmp_path: Path) -> None:
    coder = Turning("head", 1.0)
    write_bvh(tmp_path / "dance.bvh", swaying(2.0))
    half = load_takes([tmp_path / "dance.bvh"], coder, ReadingOptions(true_fps={"*": 25.0}))
    assert half[0].recording.seconds == pytest.approx(4.0, abs=0.1)
    (tmp_path / "catalogue.yaml").write_text("true_fps: {'*': 100}\n")
    known = load_takes([tmp_path / "dance.bvh"], coder)
    assert known[0].recording.seconds == pytest.approx(1.0, abs=0.1)


def test_a_missing_joint_is_named(tmp_path: Path) -> None:
    dance = swaying(2.0)
    names = tuple("abdomen1" if name == "abdomen" else name for name in dance.skeleton.names)
    other = replace(dance, skeleton=replace(dance.skeleton, names=names))
    with pytest.raises(StudioError, match=r"no joint 'abdomen'.*'abdomen1'"):
        measured(tmp_path, other, Turning("head", 1.0))


def test_a_recording_shorter_than_a_window_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudioError, match="No window of 8 sound poses"):
        measured(tmp_path, swaying(0.1), Turning("head", 1.0))


def test_a_slow_network_is_measured_on_fewer_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    coder = Turning("head", 1.0)
    write_bvh(tmp_path / "dance.bvh", swaying(2.0))
    takes = load_takes([tmp_path / "dance.bvh"], coder)
    assert evaluation.fitting_hop(coder, takes) == 1
    monkeypatch.setattr(evaluation, "PATIENCE_S", 0.0)
    hop = evaluation.fitting_hop(coder, takes)
    assert hop == 8
    assert len(evaluate(coder, takes, hop).latents) == 12


def test_show_file_and_network_file_are_the_same_coder(tiny_show: Path) -> None:
    folder, file = open_coder(tiny_show), open_coder(tiny_show / "puppet.onnx")
    window = swaying(1.0).poses[None, :8, moving()].astype(np.float32)
    np.testing.assert_array_equal(folder.iterate(window, 3)[0], file.iterate(window, 3)[0])
    assert folder.facts == {"file": "puppet.onnx", "architecture": "mlp", "precision": "fp32"}


def test_what_is_no_network_is_refused(tmp_path: Path) -> None:
    for name in ("puppet.onnx", "checkpoint.pt"):
        (tmp_path / name).write_bytes(b"nothing of the kind")
        with pytest.raises(StudioError, match=f"{name} is not a"):
            open_coder(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        open_coder(tmp_path / "nowhere")


USUAL = tuple(skeleton().names[joint] for joint in moving())


@pytest.mark.parametrize(
    "names",
    [USUAL, skeleton_of("OptiTrack").names, tuple(f"mixamorig:LeftHandPinky{n}" for n in range(100))],
    ids=["17 short ones", "51 with a prefix", "100 long ones"],
)
def test_names_of_joints_do_not_run_into_each_other(names: tuple[str, ...]) -> None:
    figure = new_figure(WIDTH_INCHES, 5)
    axes = dressed(figure.add_subplot())
    draw_joints(axes, {"by_joint_degrees": {k: dict.fromkeys(names, 1.0) for k in ("1", "10")}})
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    labels = axes.get_xticklabels()
    assert [label.get_text() for label in labels] == list(names)
    boxes = [label.get_window_extent() for label in labels]
    apart = np.diff([label.get_transform().transform(label.get_position())[0] for label in labels])
    if slope := labels[0].get_rotation():
        letters_px = labels[0].get_fontsize() * figure.dpi / 72
        assert apart.min() * np.sin(np.radians(slope)) > letters_px
    else:
        assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
    assert min(box.x0 for box in boxes) > 0 and min(box.y0 for box in boxes) > 0


def test_the_held_dance_has_a_bar_beside_each_baseline() -> None:
    rows = [{kind: dict.fromkeys(ALIVE, value) for kind in COLOURS} for value in (0.5, 0.9)]
    rows[1]["network"]["critic"] = None
    report = {"puppetry": {"lShldr": {"baselines": rows[0]}, "head": {"baselines": rows[1]}, "free": {}}}
    compared = alive(report)
    assert list(compared) == list(COLOURS)
    assert compared["network"]["critic"] == 0.5 and compared["network"]["energy_legs"] == pytest.approx(0.7)
    axes = dressed(new_figure(WIDTH_INCHES, 4).add_subplot())
    draw_alive(axes, compared)
    assert len(axes.patches) == len(COLOURS) * len(ALIVE)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == list(COLOURS)


@pytest.mark.parametrize("puppetry", [{}, {"puppetry": {"free": {"10": {}}, "lShldr": {"10_9": {}}}}])
def test_a_report_without_comparison_has_no_such_bars(puppetry: dict[str, object]) -> None:
    assert alive(puppetry) == {}
