"""Several phrases in one show: each ready at the start, and no seam where one turns into another."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from appliance.dancer import phrase_cache as prepared
from appliance.dancer.grounding import Grounding, survey
from appliance.dancer.loop import yaws
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase import PhraseError
from appliance.dancer.phrase_cache import FOLDER, SUFFIX, PhraseCache, prepare
from appliance.pose import quaternion
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.recording import Recording
from appliance.pose.skeleton import Skeleton
from tests.bundles import FIGURE, swaying_phrase, write_show
from tests.dancer.conftest import NAMES, OFFSETS, PARENTS
from tests.dancer.test_motion_source import fastest_move, fastest_step, played

SEEN_AFTER = 8  # ticks: a change enters at the window's far end, in the advance after it was asked for


def played_names(playback: Playback, ticks: int) -> list[str]:
    names = []
    for _ in range(ticks):
        names.append(playback.phrase)
        playback.advance()
    return names


@pytest.fixture
def playback(swaying: Recording, walking: Recording, open_ended: Recording) -> Playback:
    playback = Playback(swaying, crossfade_s=0.4)
    playback.add("walk", walking)
    playback.add("open", open_ended)
    return playback


def test_the_show_starts_with_main_and_knows_its_phrases(playback: Playback) -> None:
    assert playback.phrases == ("main", "walk", "open")
    assert playback.phrase == "main"


def test_another_phrase_begins_at_its_start_and_then_plays_for_ever(
    playback: Playback, walking: Recording
) -> None:
    played(playback, 33)
    playback.play("walk")
    assert played_names(playback, SEEN_AFTER + 2).index("walk") == SEEN_AFTER
    assert playback.position_s == pytest.approx(2 / 50, abs=1e-6)
    played(playback, 20)  # the crossfade of 0.4 s is over
    poses, _ = played(playback, 100)
    assert quaternion.angle_between(poses[:, 1:], walking.poses[22:122, 1:]).max() < 1e-3
    assert set(played_names(playback, 400)) == {"walk"}


def test_position_and_heading_are_carried_on(playback: Playback, walking: Recording) -> None:
    before_poses, before_roots = played(playback, 70)
    playback.play("walk", 1.0)
    to_poses, to_roots = played(playback, 150)
    playback.play("open", 0.3)
    poses, roots = played(playback, 100)
    all_roots = np.concatenate([before_roots, to_roots, roots])
    assert fastest_move(all_roots) < 2 * fastest_move(walking.roots)
    heading = np.unwrap(yaws(np.concatenate([before_poses, to_poses, poses])[:, 0].astype(np.float64)))
    assert np.abs(np.diff(heading)).max() < 0.02


def test_a_fade_takes_as_long_as_it_is_told(swaying: Recording) -> None:
    """Between two poses that stand still the turn is the fade itself."""
    bent = np.tile(quaternion.IDENTITY.astype(np.float64), (60, len(swaying.skeleton), 1))
    still = replace(swaying, poses=bent.copy(), roots=swaying.roots[:60] * 0)
    bent[:, 1] = quaternion.from_axis_angle([0.0, 0.0, 1.0], 1.0)
    playback = Playback(still, crossfade_s=0.5)
    playback.add("bent", replace(still, poses=bent))
    for name, fade_s in (("bent", 3.0), ("main", None), ("bent", 0.0)):
        playback.play(name, fade_s)
        poses, _ = played(playback, 200)
        moving = np.flatnonzero(quaternion.angle_between(poses[1:, 1], poses[:-1, 1]) > 1e-5)
        expected = 50 * (0.5 if fade_s is None else fade_s)
        assert len(moving) == pytest.approx(expected + 1, abs=3)


def test_a_phrase_that_plays_already_goes_on(playback: Playback) -> None:
    played(playback, 50)
    playback.play("main")
    playback.advance()
    assert not playback.jumped
    assert playback.position_s == pytest.approx(51 / 50)


def test_jumps_and_excerpts_are_in_the_phrase_that_plays_and_end_with_it(playback: Playback) -> None:
    playback.play("walk", 0.0)
    played(playback, 20)
    playback.jump(3.0)
    played(playback, SEEN_AFTER)
    assert (playback.phrase, playback.position_s) == ("walk", pytest.approx(3.0))
    playback.excerpt(1.0, 2.0)
    played(playback, 150)
    assert 1.0 <= playback.position_s < 2.0
    playback.play("walk")  # the same phrase, but not the part of it: all of it again
    played(playback, 150)
    assert playback.position_s > 2.0
    playback.excerpt(1.0, 2.0)
    playback.play("main")
    playback.play("walk")
    played(playback, 150)
    assert playback.position_s > 2.0


def test_backwards_a_phrase_begins_at_its_end(swaying: Recording, open_ended: Recording) -> None:
    playback = Playback(swaying, rate=-1.0, crossfade_s=0.2)
    playback.add("open", open_ended)
    playback.play("open")
    played(playback, SEEN_AFTER)
    assert playback.position_s == pytest.approx((len(open_ended) - 1) / 50)
    played(playback, 60)
    assert playback.position_s == pytest.approx((len(open_ended) - 61) / 50)


def test_the_next_change_hurries_a_long_fade_without_a_jump(playback: Playback, swaying: Recording) -> None:
    playback.play("open", 20.0)
    played(playback, 300)
    playback.play("walk", 0.5)
    names, poses = [], []
    for _ in range(120):
        names.append(playback.phrase)
        poses.append(playback.window()[0].copy())
        playback.advance()
    assert names.index("walk") < SEEN_AFTER + 30  # not the 14 s that were left of the fade
    assert fastest_step(np.array(poses)) < 4 * fastest_step(swaying.poses)


def test_a_show_may_begin_with_another_phrase(playback: Playback, walking: Recording) -> None:
    playback.start_with("walk")
    assert playback.phrase == "walk"
    poses, roots = played(playback, 100)
    assert quaternion.angle_between(poses, walking.poses[:100]).max() < 1e-3
    assert np.abs(roots - walking.roots[:100]).max() < 1e-5


def test_an_unknown_phrase_is_refused_with_the_nearest_name(playback: Playback) -> None:
    with pytest.raises(ValueError, match=r"no phrase 'wlak'.*mean 'walk'"):
        playback.play("wlak")
    assert playback.phrase == "main"


def test_a_phrase_that_does_not_fit_is_refused(playback: Playback, swaying: Recording) -> None:
    with pytest.raises(PhraseError, match=r"7 poses.*needs 8"):
        playback.add("short", swaying.excerpt(0.0, 0.14))
    other = Skeleton(("Hips", *NAMES[1:]), PARENTS, OFFSETS)
    with pytest.raises(PhraseError, match="'other' has other joints"):
        playback.add("other", replace(swaying, skeleton=other))
    assert playback.phrases == ("main", "walk", "open")


def test_a_switch_allocates_nothing_of_size(playback: Playback, walking: Recording) -> None:
    """The loop of a phrase is some hundred kilobytes; a playhead is one pose."""
    played(playback, 20)
    tracemalloc.start()
    for name in ("walk", "open", "main"):
        playback.play(name, 0.1)
        played_names(playback, 30)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < walking.poses.astype(np.float32).nbytes / 2


def test_each_phrase_brings_its_floor_and_nobody_pops(swaying: Recording) -> None:
    """The second phrase was captured 4 cm too high, on tiptoe: its soles' heights are others."""
    tiptoe = swaying.poses.copy()
    for foot in ("lFoot", "rFoot"):
        tiptoe[:, swaying.skeleton.index(foot)] = quaternion.from_axis_angle([1.0, 0.0, 0.0], 0.5)
    high = replace(swaying, poses=tiptoe, roots=swaying.roots + np.array([0.0, 0.04, 0.0]))
    floor, high_floor = survey(swaying), survey(high)
    assert np.abs(floor.rest_heights - high_floor.rest_heights).max() > 0.03
    playback = Playback(swaying, floor=floor)
    playback.add("high", high, high_floor)
    grounding = Grounding(swaying.skeleton, floor)
    clearances, heights = [], []
    for tick in range(300):
        if tick == 50:
            playback.play("high", 1.0)
        figure = grounding.ground_pose(
            playback.window()[0], playback.roots()[0], playback.lift, playback.rest_heights
        )
        assert playback.rest_heights is not None
        clearances.append((figure.soles[:, 1] - playback.rest_heights).min())
        heights.append(grounding.root[1])
        playback.advance()
    assert np.abs(clearances).max() < 0.01
    assert np.abs(np.diff(heights)).max() < 0.003  # 4 cm at once would be 0.04
    assert heights[-1] == pytest.approx(heights[0] + 0.04, abs=0.01)
    assert playback.rest_heights == pytest.approx(high_floor.rest_heights, abs=1e-6)


@settings(max_examples=40, deadline=None)
@given(
    changes=st.lists(
        st.tuples(
            st.integers(1, 60),
            st.sampled_from(("main", "walk", "open")),
            st.sampled_from((None, 0.3, 1.0, 4.0)),
            st.sampled_from((None, 0.5, 3.0)),
        ),
        max_size=8,
    ),
    rate=st.sampled_from((1.0, 0.6, -1.0, 0.0)),
)
def test_whatever_is_called_when_nothing_jumps_and_no_sign_flips(
    phrases: tuple[Recording, Recording, Recording],
    changes: list[tuple[int, str, float | None, float | None]],
    rate: float,
) -> None:
    swaying, walking, open_ended = phrases
    playback = Playback(swaying, crossfade_s=0.5, rate=rate)
    playback.add("walk", walking)
    playback.add("open", open_ended)
    parts = []
    for ticks, name, fade_s, to_s in changes:
        playback.play(name, fade_s)
        if to_s is not None:
            playback.jump(to_s)
        parts.append(played(playback, ticks))
    parts.append(played(playback, 150))
    poses, roots = (np.concatenate(part) for part in zip(*parts, strict=True))
    assert np.sum(poses[1:] * poses[:-1], axis=-1).min() > 0.9
    assert np.abs(np.linalg.norm(poses, axis=-1) - 1).max() < 1e-5
    # Two poses are at most 1.7 rad apart here; a fade of 0.3 s goes 1.5 times as fast in its middle.
    assert fastest_step(poses) < 1.5 * 1.7 / 15 + fastest_step(open_ended.poses) + 0.05
    assert fastest_move(roots) < 0.1  # a long crossfade that another one hurries: 0.0802 was seen


@pytest.fixture(scope="session")
def phrases(
    swaying: Recording, walking: Recording, open_ended: Recording
) -> tuple[Recording, Recording, Recording]:
    return swaying, walking, open_ended


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_show(tmp_path / "show")


def cached_in(folder: Path) -> list[Path]:
    return sorted(folder.glob(f"*{SUFFIX}")) if folder.exists() else []


def test_what_was_kept_dances_the_same_to_the_bit(bundle: Path, tmp_path: Path) -> None:
    path = bundle / "phrase.bvh"
    write_bvh(path, swaying_phrase(4.0).resampled(60.0))
    preparations = PhraseCache(bundle, tmp_path / "memory")
    made = [PhraseCache(bundle, None), preparations, preparations]
    windows = []
    for one in made:
        found = one.phrase(path, FIGURE, grounded=True)
        assert found is not None
        motion = Playback(found[0], floor=found[1])
        for _ in range(77):
            motion.advance()
        windows.append((motion.window().tobytes(), motion.roots().tobytes(), motion.lift, motion.position_s))
    assert windows[0] == windows[1] == windows[2]
    assert len(cached_in(tmp_path / "memory")) == 1


def test_the_floor_is_the_one_that_a_survey_finds(bundle: Path, tmp_path: Path) -> None:
    path = bundle / "phrase.bvh"
    floor = survey(read_bvh(path).resampled(50.0))
    for _ in range(2):
        found = PhraseCache(bundle, tmp_path / "memory").phrase(path, FIGURE, grounded=True)
        assert found is not None and found[1] is not None
        np.testing.assert_array_equal(found[1].rest_heights, floor.rest_heights)
        np.testing.assert_array_equal(found[1].lifts, floor.lifts)
        ungrounded = PhraseCache(bundle, tmp_path / "memory").phrase(path, FIGURE, grounded=False)
        assert ungrounded is not None and ungrounded[1] is None


def test_another_phrase_under_the_same_name_is_another_one(bundle: Path, tmp_path: Path) -> None:
    path, memory = bundle / "phrase.bvh", tmp_path / "memory"
    lengths = []
    for seconds in (3.0, 4.0):
        write_bvh(path, swaying_phrase(seconds))
        preparations = PhraseCache(bundle, memory)
        found = preparations.phrase(path, FIGURE, grounded=True)
        assert found is not None
        lengths.append(len(found[0]))
        preparations.forget_others()
        assert len(cached_in(memory)) == 1  # memory holds one show's
    assert lengths == [150, 200]


def test_another_skeleton_is_refused_as_before(bundle: Path, tmp_path: Path) -> None:
    other = Skeleton((*FIGURE.names[:-1], "rHand"), FIGURE.parents, FIGURE.offsets, FIGURE.ends)
    for skeleton, fits in ((other, False), (FIGURE, True), (other, False)):  # also where one was kept
        found = PhraseCache(bundle, tmp_path / "m").phrase(bundle / "phrase.bvh", skeleton, grounded=False)
        assert (found is not None) is fits


def test_whatever_is_damaged_is_read_anew(bundle: Path, tmp_path: Path) -> None:
    path, memory = bundle / "phrase.bvh", tmp_path / "memory"
    first = PhraseCache(bundle, memory).phrase(path, FIGURE, grounded=True)
    assert first is not None
    [kept] = cached_in(memory)
    whole = kept.read_bytes()
    damaged = [whole[:size] for size in (0, 1, 20, 40, len(whole) // 2, len(whole) - 1)]
    flipped = range(0, len(whole), max(1, len(whole) // 60))
    damaged += [whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :] for at in flipped]
    for content in damaged:
        kept.write_bytes(content)
        found = PhraseCache(bundle, memory).phrase(path, FIGURE, grounded=True)
        assert found is not None
        np.testing.assert_array_equal(np.float32(found[0].poses), np.float32(first[0].poses))
        assert kept.read_bytes() == whole  # and what was kept is mended


def test_memory_without_room_costs_nothing_but_time(bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "memory").write_bytes(b"")
    assert PhraseCache(bundle, tmp_path / "memory").phrase(bundle / "phrase.bvh", FIGURE, True) is not None


def test_a_phrase_that_is_too_long_for_memory_is_not_kept(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepared, "LARGEST", 1000)
    assert PhraseCache(bundle, tmp_path / "memory").phrase(bundle / "phrase.bvh", FIGURE, True) is not None
    assert cached_in(tmp_path / "memory") == []


def test_a_bundle_can_be_prepared_beforehand(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare([bundle / "phrase.bvh"], bundle, FIGURE, grounded=True)
    assert len(cached_in(bundle / FOLDER)) == 1
    monkeypatch.setattr(prepared, "read_bvh", lambda path: pytest.fail("it was read once more"))
    assert PhraseCache(bundle, tmp_path / "memory").phrase(bundle / "phrase.bvh", FIGURE, True) is not None


def test_impossible_steps_of_the_root_are_left_out_before_the_floor_is_looked_for(
    bundle: Path, tmp_path: Path
) -> None:
    path, sound = bundle / "phrase.bvh", read_bvh(bundle / "phrase.bvh")
    jumping = swaying_phrase()
    jumping.roots[60:] += [0.0, 40.0, -40.0]
    write_bvh(path, jumping)
    for _ in range(2):  # read, and kept
        found = PhraseCache(bundle, tmp_path / "memory").phrase(path, FIGURE, grounded=True)
        assert found is not None and found[1] is not None
        np.testing.assert_allclose(found[0].roots, sound.roots, atol=1e-4)
        assert found[1].lifts.max() < 0.01
