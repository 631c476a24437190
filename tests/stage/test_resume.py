"""A stage that starts anew goes on where the last one was: after a crash, after a power cut, in every cue."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.box.checkpoint import FILE, Checkpoint, CheckpointReader, CheckpointWriter, boot_id, packed
from appliance.box.clock import TICK_S, Slot
from appliance.box.record import SlotFile
from appliance.box.show_state import ShowState, ShowStateWriter
from appliance.dancer.motion_source import Playback
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.show.box import BoxConfig, OutputsConfig, RealtimeConfig, SensorsConfig
from appliance.show.show import Show, load_show
from appliance.show_control.orders import Order
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.resume import TRIES, Resumption
from appliance.stage.run import Stage
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import FIGURE, swaying_phrase, write_show

CUES = [{"name": "storm", "phrase": "walk", "iterations": [6, 5], "hands": ["Chest"], "fade_s": 0.2}]
HANDS: list[dict[str, object]] = [
    {"fixed": {"orientation": [0, 1, 0, 0]}, "joint": "lShldr"},
    {"osc": True, "joint": "Chest"},
]
BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
CHEST = FIGURE.index("Chest")


def walking() -> object:
    """Turns and walks away, so that place and heading on the stage grow with each loop."""
    phrase = swaying_phrase(5.0)
    time_s = np.arange(len(phrase)) / 50
    poses = phrase.poses.copy()
    poses[:, 0] = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.3 * time_s)
    return replace(phrase, poses=poses, roots=phrase.roots + np.outer(time_s, [0.4, 0.0, 0.1]))


@pytest.fixture
def show(tmp_path: Path) -> Show:
    folder = write_show(tmp_path / "show", HANDS)
    write_bvh(folder / "walk.bvh", walking())  # type: ignore[arg-type]
    values = yaml.safe_load((folder / "show.yaml").read_text())
    values |= {"motion": {"phrases": {"walk": "walk.bvh"}}, "cues": CUES}
    (folder / "show.yaml").write_text(yaml.safe_dump(values))
    return load_show(folder)


@pytest.fixture
def cast_of(show: Show) -> Iterator[Callable[[], StageParts]]:
    casts: list[StageParts] = []

    def made() -> StageParts:
        casts.append(assemble(show, BOX))
        return casts[-1]

    yield made
    for cast in casts:
        cast.close()


@pytest.fixture
def runtime(tmp_path: Path) -> Path:
    (tmp_path / "runtime").mkdir(mode=0o700)
    return tmp_path / "runtime"


def window_of(motion: Playback) -> tuple[np.ndarray, np.ndarray]:
    return motion.window().copy(), motion.roots().copy()


def goes_on(cast: StageParts, runtime: Path, cast_again: StageParts, iterations: Iterations) -> str:
    """Note the place of one cast, and take it up with another one; gives what was said."""
    noting = Resumption("A test", runtime, None, "always")
    noting.note(cast, iterations, 7)
    noting.close()
    again = Resumption("A test", runtime, None, "always")
    words = again.go_on(cast_again, Iterations(1, 0, 20))
    again.close()
    return words


@pytest.mark.parametrize("ticks", [0, 1, 30, 149, 151, 400, 1234])
@pytest.mark.parametrize("rate", [1.0, 0.7, -1.0])
def test_the_very_next_pose_comes_next_at_its_place_on_the_stage(
    cast_of: Callable[[], StageParts], runtime: Path, ticks: int, rate: float
) -> None:
    before, after = cast_of(), cast_of()
    obey(Order("phrase", (0.5,), "walk"), before, Iterations(3, 2, 10), 1.0)
    before.motion.rate = rate
    for _ in range(200 + ticks):
        before.motion.advance()
    words = goes_on(before, runtime, after, Iterations(3, 2, 10))
    assert "After a restart of the stage" in words and "the phrase 'walk'" in words
    for _ in range(60):
        poses, roots = window_of(before.motion)
        poses_after, roots_after = window_of(after.motion)
        assert quaternion.angle_between(poses[0], poses_after[0]).max() < 0.01
        np.testing.assert_allclose(roots_after[0], roots[0], atol=0.005)
        assert after.motion.position_s == pytest.approx(before.motion.position_s, abs=2e-3)
        before.motion.advance()
        after.motion.advance()


@pytest.mark.parametrize("ticks", [0, 1, 4, 8, 20])
def test_a_phrase_that_was_just_asked_for_is_the_one_that_comes_back(
    cast_of: Callable[[], StageParts], runtime: Path, ticks: int
) -> None:
    """Also while it has not reached the window's first pose, or is still fading in."""
    before, after = cast_of(), cast_of()
    for _ in range(50):
        before.motion.advance()
    obey(Order("phrase", (1.0,), "walk"), before, Iterations(3, 2, 10), 1.0)
    for _ in range(ticks):
        before.motion.advance()
    goes_on(before, runtime, after, Iterations(3, 2, 10))
    assert after.motion.phrase == "walk"
    assert after.motion.position_s == pytest.approx(max(0.0, (ticks - 8) * TICK_S), abs=0.03)


def test_excerpt_rate_iterations_hands_and_cue_come_back(
    cast_of: Callable[[], StageParts], runtime: Path
) -> None:
    before, after, iterations = cast_of(), cast_of(), Iterations(3, 2, 20)
    obey(Order("cue", text="storm"), before, iterations, 1.0)
    obey(Order("excerpt", (1.0, 3.0)), before, iterations, 1.0)
    obey(Order("rate", (0.5,)), before, iterations, 1.0)
    for _ in range(80):
        before.motion.advance()
        iterations.advance()
    noting = Resumption("A test", runtime, None, "always")
    noting.note(before, iterations, 80)
    noting.close()
    again, iterations_again = Resumption("A test", runtime, None, "always"), Iterations(3, 2, 20)
    words = again.go_on(after, iterations_again)
    again.close()
    assert "in the cue 'storm'" in words
    assert (after.cue, after.motion.rate, after.motion.excerpt_s) == ("storm", 0.5, (1.0, 3.0))
    assert (iterations_again.coding, iterations_again.interaction) == (6, 5)
    assert {one.joint: one.enabled for one in after.hands.puppeteers} == {"lShldr": False, "Chest": True}
    assert again.went_on and again.comes_back and (again.restarts, again.power_cuts) == (1, 0)


def test_a_show_that_stands_comes_back_standing(cast_of: Callable[[], StageParts], runtime: Path) -> None:
    before, after = cast_of(), cast_of()
    for tick in range(100):
        before.motion.rate = 0.0 if tick > 50 else 1.0
        before.motion.advance()
    goes_on(before, runtime, after, Iterations(3, 2, 10))
    assert after.motion.rate == 0.0
    for _ in range(20):
        after.motion.advance()
    assert after.motion.position_s == pytest.approx(before.motion.position_s, abs=2e-3)


@pytest.mark.parametrize(("boot", "rate"), [("another", 1.0), (boot_id(), 0.0)])
def test_after_a_power_cut_a_show_that_stood_dances(
    cast_of: Callable[[], StageParts], runtime: Path, tmp_path: Path, boot: str, rate: float
) -> None:
    """The dark show state has gone with the memory: in full light the phrase does not stand still."""
    with closing(SlotFile(tmp_path / "state" / FILE)) as file:
        file.write(packed(replace(PLACE, rate=0.0, boot=boot)))
    cast = cast_of()
    with closing(Resumption("A test", runtime, tmp_path / "state", "always")) as resuming:
        assert "goes on at 2.0 s" in resuming.go_on(cast, Iterations(1, 0, 20))
    assert cast.motion.rate == rate


def test_what_grounding_moved_the_figure_by_comes_back(
    cast_of: Callable[[], StageParts], runtime: Path
) -> None:
    before, after = cast_of(), cast_of()
    before.grounding.strayed = (0.2, -0.1)
    goes_on(before, runtime, after, Iterations(3, 2, 10))
    assert after.grounding.strayed == (0.2, -0.1)


PLACE = Checkpoint("A test", "walk", 2.0, (0.0, 5.0), coding=3, interaction=2, boot="another")


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (replace(PLACE, show="Another show"), "Before, the show was 'Another show'"),
        (replace(PLACE, phrase="run"), "no phrase 'run'"),
        (replace(PLACE, excerpt=(70.0, 90.0)), "Choose a longer part"),
        (replace(PLACE, rate=90.0), "The rate is 90"),
    ],
)
def test_a_place_that_this_show_does_not_have_is_no_place(
    cast_of: Callable[[], StageParts], runtime: Path, place: Checkpoint, reason: str
) -> None:
    cast = cast_of()
    put(runtime, place)
    resuming = Resumption("A test", runtime, None, "always")
    words = resuming.go_on(cast, Iterations(1, 0, 20))
    resuming.close()
    assert "begins at the beginning" in words and reason in words
    assert not resuming.went_on
    assert (cast.motion.phrase, cast.motion.position_s) == ("main", 0.0)
    for _ in range(20):
        cast.motion.advance()
    assert (cast.motion.phrase, cast.motion.rate) == ("main", 1.0)
    assert cast.motion.going_on[1] == pytest.approx(20 * TICK_S, abs=2e-3)


def test_a_second_beyond_the_phrase_is_its_last_one(cast_of: Callable[[], StageParts], runtime: Path) -> None:
    cast = cast_of()
    put(runtime, replace(PLACE, position_s=99.0))
    resuming = Resumption("A test", runtime, None, "always")
    assert "goes on" in resuming.go_on(cast, Iterations(1, 0, 20))
    resuming.close()
    assert cast.motion.position_s == pytest.approx(5.0, abs=0.1)


def put(runtime: Path, place: Checkpoint) -> None:
    with closing(CheckpointWriter(runtime)) as writer:
        writer.write(place)


def boot_of(runtime: Path) -> str:
    with closing(Resumption("x", runtime, None, "never")) as one:
        return one._boot


@pytest.mark.parametrize(
    ("wanted", "in_memory", "on_disk", "at_s", "power_cuts", "restarts"),
    [
        ("always", None, None, None, 0, 0),
        ("always", "here", None, 2.0, 0, 1),
        ("always", "here", "other", 2.0, 0, 1),  # memory is newer
        ("always", None, "other", 3.0, 1, 0),
        ("always", None, "here", 3.0, 0, 1),  # the runtime folder was emptied
        ("always", "ended", "other", None, 0, 0),  # whatever an older disk says
        ("always", None, "ended", None, 0, 0),
        ("after_crash", "here", "other", 2.0, 0, 1),
        ("after_crash", None, "other", None, 0, 0),
        ("after_crash", None, "here", 3.0, 0, 1),
        ("never", "here", "other", None, 0, 0),
    ],
)
def test_memory_is_asked_first_then_the_disk(
    cast_of: Callable[[], StageParts],
    runtime: Path,
    tmp_path: Path,
    wanted: str,
    in_memory: str | None,
    on_disk: str | None,
    at_s: float | None,
    power_cuts: int,
    restarts: int,
) -> None:
    here = boot_of(runtime)
    (runtime / FILE).unlink()
    if in_memory:
        put(runtime, replace(PLACE, boot=here, ended=in_memory == "ended"))
    if on_disk:
        boot = here if on_disk == "here" else "another"
        file = SlotFile(tmp_path / "state" / FILE)
        file.write(packed(replace(PLACE, position_s=3.0, boot=boot, ended=on_disk == "ended")))
        file.close()
    cast = cast_of()
    resuming = Resumption("A test", runtime, tmp_path / "state", wanted)  # type: ignore[arg-type]
    words = resuming.go_on(cast, Iterations(1, 0, 20))
    resuming.close()
    assert (resuming.power_cuts, resuming.restarts) == (power_cuts, restarts)
    assert resuming.went_on == (at_s is not None)
    assert cast.motion.position_s == pytest.approx(at_s or 0.0, abs=1e-3)
    assert ("After a power cut" in words) == bool(power_cuts)


def test_counts_go_on_until_the_show_is_ended(cast_of: Callable[[], StageParts], runtime: Path) -> None:
    for start in range(3):
        resuming, cast = Resumption("A test", runtime, None, "always"), cast_of()
        resuming.go_on(cast, Iterations(1, 0, 20))
        assert resuming.restarts == start
        resuming.note(cast, Iterations(1, 0, 20), 1)
        resuming.close()
    resuming = Resumption("A test", runtime, None, "always")
    resuming.note(cast_of(), Iterations(1, 0, 20), 2)
    resuming.end()
    resuming.close()
    resuming = Resumption("A test", runtime, None, "always")
    assert not resuming.comes_back and resuming.restarts == 0
    resuming.close()


def test_a_place_from_which_no_frame_ever_leaves_is_given_up(
    cast_of: Callable[[], StageParts], runtime: Path
) -> None:
    """A crash at the first tick would otherwise come back for ever."""
    put(runtime, PLACE)
    begun: list[float] = []
    for _ in range(TRIES + 1):
        cast = cast_of()
        resuming = Resumption("A test", runtime, None, "always")
        words = resuming.go_on(cast, Iterations(1, 0, 20))
        resuming.begin(cast, Iterations(1, 0, 20))  # and no note: it died in its first tick
        resuming.close()
        begun.append(cast.motion.position_s)
    assert begun == pytest.approx([2.0] * TRIES + [0.0], abs=1e-3)
    assert f"{TRIES} starts" in words and "begins at the beginning" in words
    with closing(CheckpointReader(runtime)) as reader:
        place = reader.read()
    assert place is not None and place.tries == 1


def test_one_frame_is_enough_to_come_back_as_often_as_it_takes(
    cast_of: Callable[[], StageParts], runtime: Path
) -> None:
    put(runtime, PLACE)
    for _ in range(2 * TRIES):
        resuming, cast = Resumption("A test", runtime, None, "always"), cast_of()
        assert "goes on" in resuming.go_on(cast, Iterations(1, 0, 20))
        resuming.begin(cast, Iterations(1, 0, 20))
        cast.motion.advance()
        resuming.note(cast, Iterations(1, 0, 20), 0)
        resuming.close()
    assert cast.motion.position_s == pytest.approx(2.0 + 2 * TRIES * TICK_S, abs=0.01)


def test_without_room_for_it_the_dance_goes_on(cast_of: Callable[[], StageParts], runtime: Path) -> None:
    (runtime / FILE).mkdir()
    resuming, cast = Resumption("A test", runtime, None, "always"), cast_of()
    assert resuming.go_on(cast, Iterations(1, 0, 20)) == ""
    assert "cannot be kept" in resuming.complaint and "`runtime:`" in resuming.complaint
    resuming.begin(cast, Iterations(1, 0, 20))
    resuming.note(cast, Iterations(1, 0, 20), 0)
    resuming.end()
    resuming.close()


@pytest.fixture
def box(runtime: Path) -> BoxConfig:
    return BOX.model_copy(update={"runtime": runtime, "realtime": RealtimeConfig(enabled=False)})


def test_the_whole_stage_goes_on_where_it_was(show: Show, box: BoxConfig) -> None:
    stage = Stage(show, box, lambda words: None)
    with closing(stage), pytest.raises(ZeroDivisionError):
        stage.dance(None, lambda: stage.cast.motion.position_s > 0.3 and bool(1 / 0))  # late ticks stand
    was_at_s = stage.cast.motion.position_s
    said: list[str] = []
    again = Stage(show, box, said.append)
    with closing(again):
        assert again.cast.motion.position_s == pytest.approx(was_at_s, abs=1e-3)
        assert any("After a restart of the stage the show goes on at" in words for words in said)
        # The figure stands where it stood: no step through the room.
        np.testing.assert_allclose(again.tick.frame.root, stage.tick.frame.root, atol=0.02)
        again.dance(0.1, lambda: False)
    fresh = Stage(show, box, said.append)  # that one ended as it should
    with closing(fresh):
        assert fresh.cast.motion.position_s == 0.0
        assert not fresh.resuming.went_on


def test_a_place_goes_before_the_house_s_cue(show: Show, box: BoxConfig, runtime: Path) -> None:
    """The cue was called, and another phrase after it: the phrase is the newer one."""
    with closing(ShowStateWriter(runtime)) as show_state:
        show_state.write(ShowState(cue="storm"))
    put(runtime, replace(PLACE, phrase="main", excerpt=(0.0, 3.0), cue="storm", boot=boot_of(runtime)))
    with closing(Stage(show, box, lambda words: None)) as stage:
        assert (stage.cast.cue, stage.cast.motion.phrase) == ("storm", "main")
        assert stage.cast.motion.position_s == pytest.approx(2.0, abs=1e-3)


def test_slots_are_not_needed_to_know_the_place(
    cast_of: Callable[[], StageParts], runtime: Path, show: Show, box: BoxConfig
) -> None:
    """A late tick does not dance: the phrase stands, and so does its place."""
    stage = Stage(show, box, lambda words: None)
    with closing(stage):
        for number in range(3):
            slot = Slot(number, 10.0 + number * TICK_S, 10.019 + number * TICK_S)
            stage.tick.run(slot)
            stage._note(slot)
        with closing(CheckpointReader(runtime)) as reader:
            place = reader.read()
    assert place is not None and (place.tick, place.position_s) == (2, 0.0)
