"""Phrases made ready: the same numbers as from the BVH file, or none, whatever happened to what was kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from appliance.dancer import phrase_cache as prepared
from appliance.dancer.grounding import survey
from appliance.dancer.motion_source import Playback
from appliance.dancer.phrase_cache import FOLDER, SUFFIX, PhraseCache, prepare
from appliance.pose.bvh import read_bvh, write_bvh
from appliance.pose.skeleton import Skeleton
from tests.bundles import FIGURE, swaying_phrase, write_show


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
