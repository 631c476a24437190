"""Material: variations, walks and paths as loops: the same from the same recipe, and without a seam."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.snapshot import packed, restore
from appliance.dancer.grounding import survey
from appliance.dancer.loop import Loop, Placement, yaws
from appliance.dancer.material.cyclic import Cycle, bridged, even_starts, hann_mean
from appliance.dancer.material.maker import Maker
from appliance.dancer.material.material_file import Material, read_material, recipe_text, write_material
from appliance.dancer.material.motion_network import MotionNetwork, MotionNetworkError
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase import Phrase
from appliance.dancer.playhead import TURN_HOME
from appliance.pose import quaternion
from tests.bundles import FIGURE, MOVING, swaying_phrase
from tests.sources import write_motion_network

VARY: dict[str, Any] = {"source": "vary", "phrase": "main", "sigma": 1.0, "seed": 1, "number": 1001}
WALK = {
    "source": "granular",
    "speed": 0.4,
    "spread": 1.0,
    "mix": 0.5,
    "offset": 0.0,
    "seed": 1,
    "number": 1002,
}
EXCERPTS = WALK | {"from": "main", "to": "main", "from_start_s": 0.4, "to_start_s": 1.6, "seconds": 1.2}
PATH = {"source": "path", "phrase": "main", "wobble": 0.5, "frequency": 0.5, "seed": 1, "number": 1003}


@pytest.fixture
def phrase() -> Loop:
    recording = swaying_phrase()
    return Phrase(0, "main", recording, survey(recording), 25, 8).cut(0.0, None)


@pytest.fixture
def maker(tmp_path: Path, phrase: Loop) -> Maker:
    write_motion_network(tmp_path / "sequence.onnx", 32)
    write_motion_network(tmp_path / "pose.onnx", 1)
    files = dict.fromkeys(("vary", "granular"), tmp_path / "sequence.onnx")
    return Maker(FIGURE, files | {"path": tmp_path / "pose.onnx"}, lambda name: phrase, grounded=True)


def steps(loop: Loop) -> np.ndarray[Any, Any]:
    """Degrees of each joint from frame to frame, the last step across the seam."""
    return np.degrees(quaternion.angle_between(loop.poses[1:], loop.poses[:-1]))


@pytest.mark.parametrize(
    "recipe",
    [
        VARY,
        WALK,
        WALK | {"from": "main", "to": "main", "offset": 0.5},
        EXCERPTS | {"offset": 0.5},
        PATH,
        PATH | {"points": [0.2, 0.8]},
        PATH | {"points": [0.1, 0.1, 0.9, 0.2, 0.5, 0.9]},
    ],
)
def test_made_motion_has_no_seam_and_is_the_same_each_time(maker: Maker, recipe: dict[str, Any]) -> None:
    loop, again = maker.make(recipe), maker.make(recipe)
    assert loop.poses.tobytes() == again.poses.tobytes() and loop.track.tobytes() == again.track.tobytes()
    moved = steps(loop)
    assert moved.max() < 12 and moved[-1].max() <= 1.5 * moved[:-1].max()
    assert np.allclose(np.linalg.norm(loop.poses, axis=-1), 1.0, atol=1e-5)
    assert (np.sum(loop.poses[1:] * loop.poses[:-1], axis=-1) > 0).all()  # no sign jumps
    assert loop.fade == 0 and loop.period == loop.length == len(loop.poses) - 1
    other = maker.make(recipe | {"seed": 2})
    assert other.poses.tobytes() != loop.poses.tobytes()


def test_a_variation_keeps_the_phrases_way_seconds_and_still_joints(maker: Maker, phrase: Loop) -> None:
    loop = maker.make(VARY)
    assert np.array_equal(loop.track[:, :3], phrase.track[phrase.fade : phrase.length + 1, :3])
    assert loop.start_s == pytest.approx(phrase.start_s + phrase.fade / 50) and loop.step == phrase.step
    still = [joint for joint, name in enumerate(FIGURE.names) if name not in MOVING]
    assert np.array_equal(loop.poses[:-1, still], Cycle.of(phrase).poses[:, still])
    own = maker.make(VARY | {"sigma": 0.0}).poses[:-1]
    assert np.degrees(quaternion.angle_between(own, Cycle.of(phrase).poses)).max() < 0.1, "the phrase itself"
    nearer = maker.make(VARY | {"sigma": 0.1})
    plain = maker.make(VARY | {"sigma": 0.0})
    far = quaternion.angle_between(loop.poses, plain.poses).mean()
    assert 0 < quaternion.angle_between(nearer.poses, plain.poses).mean() < far / 3


def test_excerpts_of_a_phrase_are_mixed_by_their_share(maker: Maker, phrase: Loop) -> None:
    one, half, other = (maker.make(EXCERPTS | {"mix": mix}) for mix in (0.0, 0.5, 1.0))
    assert one.start_s == pytest.approx(0.4, abs=0.6) and one.length <= 60
    apart = [float(quaternion.angle_between(loop.poses, half.poses).mean()) for loop in (one, other)]
    assert 0 < max(apart) < quaternion.angle_between(one.poses, other.poses).mean()
    late = maker.make(EXCERPTS | {"from_start_s": 3000.0, "seconds": 60.0})
    whole = maker.make(EXCERPTS | {"seconds": 0.0})
    assert late.length == pytest.approx(whole.length, abs=phrase.fade + 25), "as far as the phrase has them"


def test_a_phrase_that_walks_and_turns_goes_on_doing_so(maker: Maker, tmp_path: Path) -> None:
    """The cycle's second round stands where the first one ended, turned as it ended."""
    count, turn = 150, 0.8
    poses = np.tile(quaternion.IDENTITY, (count, len(FIGURE), 1)).astype(np.float32)
    poses[:, 0] = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), turn * np.arange(count) / count)
    track = np.zeros((count + 1, 14), np.float32)
    track[:, 2] = np.linspace(0, 3, count + 1)
    cycle = Cycle(poses, track, Placement(turn, 0.0, 3.0), 0.0)
    places = list(range(len(FIGURE)))
    starts = even_starts(count, 32)
    windows = cycle.windows(starts, 32, places)
    inside = np.degrees(quaternion.angle_between(windows[:, 1:], windows[:, :-1])).max()
    assert inside < 0.5
    assert np.degrees(quaternion.angle_between(cycle.blended([(windows, starts)], places), poses)).max() < 0.1
    loop = cycle.loop(poses, None, None, 1001)
    assert steps(loop).max() < 0.5


def test_windows_that_contradict_each_other_do_not_spin_a_joint() -> None:
    """Half a turn apart, a mean turns within one frame: the rotation is taken from the poses around."""
    count, starts = 80, even_starts(80, 16)
    windows = np.tile(quaternion.IDENTITY, (len(starts), 16, 1, 1)).astype(np.float32)
    windows[3] = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 3.1)
    windows[4] = -quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 3.0)
    made = hann_mean(windows, starts, count)
    whole = np.concatenate([made, made[:1]])
    assert np.degrees(quaternion.angle_between(whole[1:], whole[:-1])).max() < 45
    uncertain = np.zeros(count, bool)
    uncertain[[0, 1, 40, 79]] = True
    spun = np.tile(quaternion.IDENTITY, (count, 1)).astype(float)
    spun[uncertain] = [0.0, 1.0, 0.0, 0.0]
    assert quaternion.angle_between(bridged(spun, uncertain), quaternion.IDENTITY).max() < 1e-6


def test_a_material_file_is_read_as_it_was_written(maker: Maker, tmp_path: Path) -> None:
    material, path = Material(recipe_text(VARY), maker.make(VARY)), tmp_path / "1001.material"
    write_material(path, material, FIGURE.names)
    found = read_material(path, FIGURE.names)
    assert found.recipe == material.recipe and found.loop.step == material.loop.step
    assert found.loop.poses.tobytes() == material.loop.poses.tobytes()
    assert found.loop.track.tobytes() == material.loop.track.tobytes()
    with pytest.raises(ValueError, match="another figure"):
        read_material(path, FIGURE.names[::-1])
    whole = path.read_bytes()
    for damaged in (b"", whole[:40], whole[:-100], b"x" * 400):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match="no material of this show"):
            read_material(path, FIGURE.names)


@pytest.mark.parametrize("part", ["poses", "track"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e20])
def test_a_material_file_of_impossible_numbers_is_refused(
    maker: Maker, tmp_path: Path, part: str, wrong: float
) -> None:
    loop, path = maker.make(VARY), tmp_path / "1001.material"
    arrays = {"poses": loop.poses.copy(), "track": loop.track.copy()}
    arrays[part][7, 0] = wrong
    write_material(path, Material("{}", Loop.made(**arrays, step=loop.step, start_s=0.0)), FIGURE.names)
    with (
        np.errstate(all="ignore"),
        pytest.raises(ValueError, match=f"its {part if part == 'poses' else 'places'}"),
    ):
        read_material(path, FIGURE.names)


def test_a_network_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "none.onnx").write_bytes(b"none")
    with pytest.raises(MotionNetworkError, match="cannot be read"):
        MotionNetwork(tmp_path / "none.onnx", FIGURE.names)
    write_motion_network(tmp_path / "broken.onnx", 32, fails=True)
    with pytest.raises(MotionNetworkError, match="not numbers"):
        MotionNetwork(tmp_path / "broken.onnx", FIGURE.names).decode(np.zeros((1, 4), np.float32))


def test_playback_goes_over_to_what_was_made_in_step_and_back(maker: Maker, phrase: Loop) -> None:
    recording = swaying_phrase()
    motion = Playback(recording, floor=survey(recording))
    for _ in range(60):
        motion.advance()
    at_s = motion.position_s
    motion.enter(recipe_text(VARY), maker.make(VARY), 0.2)
    assert motion.base == "main" and motion.made is not None and motion.going_on[0] == "main"
    before, largest = motion.window()[0].copy(), 0.0
    for _ in range(25):
        motion.advance()
        now = motion.window()[0].copy()
        largest, before = max(largest, float(quaternion.angle_between(now, before).max())), now
    assert motion.phrase == "vary" and abs(motion.position_s - at_s - 0.5) < 0.03
    assert np.degrees(largest) < 25
    state = packed(motion)
    other = Playback(recording, floor=survey(recording))
    other.make_by(lambda text: maker.make(VARY))
    restore(other, state)
    for _ in range(100):
        motion.advance()
        other.advance()
        assert motion.window().tobytes() == other.window().tobytes()
    assert motion.play("main", 0.2)
    for _ in range(25):
        motion.advance()
    assert motion.phrase == "main" and motion.made is None
    with pytest.raises(ValueError, match="another floor"):
        motion.enter(recipe_text(VARY), Loop.made(phrase.poses, phrase.track[:, :5], Placement(), 0.0), 0.2)


@pytest.mark.parametrize("heading", [math.pi, -2.5, 1.0])
@pytest.mark.parametrize(
    "recipe", [WALK, EXCERPTS, PATH, PATH | {"points": [0.2, 0.8]}, {"source": "kept", "of": WALK}]
)
def test_what_takes_over_with_the_back_to_the_house_turns_to_it(
    maker: Maker, recipe: dict[str, Any], heading: float
) -> None:
    recording = swaying_phrase()
    motion = Playback(recording, floor=survey(recording))
    motion.start_at("main", motion.excerpt_s, 0.0, 1.0, (0.4, -0.3, heading))
    recipe = {"number": 1002, "name": "x", "seed": 1, **recipe}
    loop = maker.make(recipe)
    motion.enter(recipe_text(recipe), loop, 0.5)
    for _ in range(40):
        motion.advance()
    turned, stood = [], []
    for _ in range(600):
        x, z, facing = motion.standing
        turned.append(facing)
        stood.append((x, z))
        motion.advance()
    own = max(float(np.abs(np.diff(np.unwrap(yaws(loop.poses[:, 0].astype(float))))).max()), 1e-3)
    assert np.abs(np.diff(np.unwrap(turned))).max() < TURN_HOME + 1.5 * own
    end = np.exp(1j * np.array(turned[-250:])).mean()
    assert abs(np.angle(end)) < math.radians(15)
    assert np.ptp(stood, axis=0).max() < 0.3


def test_a_variation_keeps_the_heading_of_its_phrase(maker: Maker) -> None:
    recording = swaying_phrase()
    motion = Playback(recording, floor=survey(recording))
    motion.start_at("main", motion.excerpt_s, 0.0, 1.0, (0.0, 0.0, 2.0))
    motion.enter(recipe_text(VARY), maker.make(VARY | {"sigma": 0.0}), 0.5)
    for _ in range(500):
        motion.advance()
    assert motion.standing[2] == pytest.approx(2.0, abs=0.3)
