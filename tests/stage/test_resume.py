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
from appliance.box.show_state import ShowState, ShowStateReader, ShowStateWriter
from appliance.dancer.motion_source import Playback
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.show.box import BoxConfig, OutputsConfig, RealtimeConfig, SensorsConfig
from appliance.show.show import Show, load_show
from appliance.show_control.orders import Order
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.resume import TRIES, Resumption
from appliance.stage.run import Stage
from appliance.stage.stage_parts import assemble
from tests.bundles import FIGURE, swaying_phrase, write_show

CUES = [{"name": "storm", "phrase": "walk", "iterations": [6, 5], "hands": ["Chest"], "fade_s": 0.2}]
HANDS: list[dict[str, object]] = [
    {"fixed": {"orientation": [0, 1, 0, 0]}, "joint": "lShldr"},
    {"osc": True, "joint": "Chest"},
]
BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
CHEST = FIGURE.index("Chest")
NOW = 1000.0


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
def runtime(tmp_path: Path) -> Path:
    (tmp_path / "runtime").mkdir(mode=0o700)
    return tmp_path / "runtime"


@pytest.fixture
def dance_of(show: Show, runtime: Path) -> Iterator[Callable[[], Reconciler]]:
    """A dance from its beginning, as a stage of this folder makes it before it resumes."""
    made: list[Reconciler] = []

    def dance() -> Reconciler:
        reader = ShowStateReader(runtime)
        made.append(Reconciler("A test", assemble(show, BOX), Iterations(3, 2, 20), reader))
        return made[-1]

    yield dance
    for one in made:
        one.parts.close()


def window_of(motion: Playback) -> tuple[np.ndarray, np.ndarray]:
    return motion.window().copy(), motion.roots().copy()


def do(dance: Reconciler, *orders: Order) -> None:
    for order in orders:
        assert obey(order, dance.parts, dance.iterations)[0]


def goes_on(dance: Reconciler, runtime: Path, again: Reconciler) -> str:
    """Note where a dance is, and resume another one there; gives what was said."""
    with closing(Resumption("A test", runtime, None, "always")) as noting:
        noting.write_checkpoint(dance, 7)
    with closing(Resumption("A test", runtime, None, "always")) as resuming:
        return resuming.go_on(again, NOW)


@pytest.mark.parametrize("ticks", [0, 1, 30, 149, 151, 400, 1234])
@pytest.mark.parametrize("rate", [1.0, 0.7, -1.0])
def test_the_very_next_pose_comes_next_at_its_place_on_the_stage(
    dance_of: Callable[[], Reconciler], runtime: Path, ticks: int, rate: float
) -> None:
    before, after = dance_of(), dance_of()
    do(before, Order("phrase", (0.5,), "walk"))
    before.rate = before.parts.motion.rate = rate
    for _ in range(200 + ticks):
        before.parts.motion.advance()
    words = goes_on(before, runtime, after)
    assert "After a restart of the stage" in words and "the phrase 'walk'" in words
    for _ in range(60):
        poses, roots = window_of(before.parts.motion)
        poses_after, roots_after = window_of(after.parts.motion)
        assert quaternion.angle_between(poses[0], poses_after[0]).max() < 0.01
        np.testing.assert_allclose(roots_after[0], roots[0], atol=0.005)
        assert after.parts.motion.position_s == pytest.approx(before.parts.motion.position_s, abs=2e-3)
        before.parts.motion.advance()
        after.parts.motion.advance()


@pytest.mark.parametrize("ticks", [0, 1, 4, 8, 20])
def test_a_phrase_that_was_just_asked_for_is_the_one_that_comes_back(
    dance_of: Callable[[], Reconciler], runtime: Path, ticks: int
) -> None:
    """Also while it has not reached the window's first pose, or is still fading in."""
    before, after = dance_of(), dance_of()
    for _ in range(50):
        before.parts.motion.advance()
    do(before, Order("phrase", (1.0,), "walk"))
    for _ in range(ticks):
        before.parts.motion.advance()
    goes_on(before, runtime, after)
    assert after.parts.motion.phrase == "walk"
    assert after.parts.motion.position_s == pytest.approx(max(0.0, (ticks - 8) * TICK_S), abs=0.03)


def test_excerpt_rate_iterations_hands_and_cue_come_back(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    before, after = dance_of(), dance_of()
    do(before, Order("phrase", (0.2,), "walk"), Order("iterations", (6.0, 5.0, 0.2)), Order("rate", (0.5,)))
    do(before, Order("hand", (0.0,), "lShldr"))
    before.cue, before.rate, before.generation = "storm", 0.5, 77
    before.parts.motion.excerpt(1.0, 3.0)
    for _ in range(80):
        before.parts.motion.advance()
        before.iterations.advance()
    assert "in the cue 'storm'" in goes_on(before, runtime, after)
    assert (after.cue, after.rate, after.generation) == ("storm", 0.5, 77)
    assert (after.parts.motion.rate, after.parts.motion.excerpt_s) == (0.5, (1.0, 3.0))
    assert (after.iterations.coding, after.iterations.interaction) == (6, 5)
    assert {one.joint: one.enabled for one in after.parts.hands.puppeteers} == {
        "lShldr": False,
        "Chest": True,
    }


def declare(runtime: Path, show_state: ShowState) -> None:
    with closing(ShowStateWriter(runtime)) as writer:
        writer.write(show_state)


@pytest.mark.parametrize(("generation", "is_applied"), [(0, False), (1, True)])
def test_what_was_declared_while_the_stage_was_away_follows_and_what_it_followed_is_not_applied_again(
    dance_of: Callable[[], Reconciler], runtime: Path, generation: int, is_applied: bool
) -> None:
    before, after = dance_of(), dance_of()
    declared = ShowState(show="A test").with_dance(NOW, {"phrase": ("walk", (0.5,))})
    declare(runtime, declared)
    for _ in range(10):
        do(before, *before.pending(NOW))
        before.parts.motion.advance()
    before.parts.motion.excerpt(1.0, 3.0)
    if is_applied:
        declare(
            runtime,
            declared.with_dance(NOW, {"phrase": ("walk", (0.5,))}).with_dance(
                NOW, {"iterations": ("", (6.0, 5.0))}
            ),
        )
    goes_on(before, runtime, after)
    orders = [Order("phrase", (0.5,), "walk"), Order("iterations", (6.0, 5.0))]
    assert after.pending(NOW) == (orders if is_applied else [])


def test_after_a_power_cut_all_that_is_declared_is_new(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    """Its generations count from the machine's start."""
    put(runtime, replace(PLACE, boot="another", applied=10**15, cue="storm"))
    declare(runtime, ShowState(show="A test").with_dance(NOW, {"iterations": ("", (6.0, 5.0))}))
    dance = dance_of()
    with closing(Resumption("A test", runtime, None, "always")) as resuming:
        assert "After a power cut" in resuming.go_on(dance, NOW)
    assert dance.pending(NOW) == [Order("iterations", (6.0, 5.0))]
    assert dance.cue == "storm"


@pytest.mark.parametrize("by", ["stop", "player"])
def test_a_show_that_stands_comes_back_standing(
    dance_of: Callable[[], Reconciler], runtime: Path, by: str
) -> None:
    before, after = dance_of(), dance_of()
    for tick in range(100):
        if tick == 50:
            stopped = ShowState(show="A test", going=by != "stop")
            declare(runtime, stopped if by == "stop" else stopped.with_dance(NOW, {"rate": ("", (0.0,))}))
        do(before, *before.pending(NOW))
        before.parts.motion.advance()
    goes_on(before, runtime, after)
    assert after.parts.motion.rate == 0.0 and not after.pending(NOW)
    for _ in range(20):
        after.parts.motion.advance()
    assert after.parts.motion.position_s == pytest.approx(before.parts.motion.position_s, abs=2e-3)
    if by == "stop":
        declare(runtime, ShowState(show="A test"))
        assert after.pending(NOW) == [Order("rate", (1.0,))]


@pytest.mark.parametrize(("boot", "rate"), [("another", 1.0), (boot_id(), 0.0)])
def test_after_a_power_cut_a_show_that_stood_dances(
    dance_of: Callable[[], Reconciler], runtime: Path, tmp_path: Path, boot: str, rate: float
) -> None:
    """The dark show state has gone with the memory: in full light the phrase does not stand still."""
    with closing(SlotFile(tmp_path / "state" / FILE)) as file:
        file.write(packed(replace(PLACE, rate=0.0, boot=boot)))
    dance = dance_of()
    with closing(Resumption("A test", runtime, tmp_path / "state", "always")) as resuming:
        assert "goes on at 2.0 s" in resuming.go_on(dance, NOW)
    assert dance.parts.motion.rate == rate


def test_what_grounding_moved_the_figure_by_comes_back(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    before, after = dance_of(), dance_of()
    before.parts.first.grounding.strayed = (0.2, -0.1)
    goes_on(before, runtime, after)
    assert after.parts.first.grounding.strayed == (0.2, -0.1)


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
    dance_of: Callable[[], Reconciler], runtime: Path, place: Checkpoint, reason: str
) -> None:
    dance = dance_of()
    put(runtime, place)
    resuming = Resumption("A test", runtime, None, "always")
    words = resuming.go_on(dance, NOW)
    resuming.close()
    assert "begins at the beginning" in words and reason in words
    assert not resuming.went_on
    assert (dance.parts.motion.phrase, dance.parts.motion.position_s) == ("main", 0.0)
    for _ in range(20):
        dance.parts.motion.advance()
    assert (dance.parts.motion.phrase, dance.parts.motion.rate) == ("main", 1.0)
    assert dance.parts.motion.going_on[1] == pytest.approx(20 * TICK_S, abs=2e-3)


def test_a_second_beyond_the_phrase_is_its_last_one(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    dance = dance_of()
    put(runtime, replace(PLACE, position_s=99.0))
    resuming = Resumption("A test", runtime, None, "always")
    assert "goes on" in resuming.go_on(dance, NOW)
    resuming.close()
    assert dance.parts.motion.position_s == pytest.approx(5.0, abs=0.1)


def put(runtime: Path, place: Checkpoint) -> None:
    with closing(CheckpointWriter(runtime)) as writer:
        writer.write(place)


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
    dance_of: Callable[[], Reconciler],
    runtime: Path,
    tmp_path: Path,
    wanted: str,
    in_memory: str | None,
    on_disk: str | None,
    at_s: float | None,
    power_cuts: int,
    restarts: int,
) -> None:
    here = boot_id()
    if in_memory:
        put(runtime, replace(PLACE, boot=here, ended=in_memory == "ended"))
    if on_disk:
        boot = here if on_disk == "here" else "another"
        file = SlotFile(tmp_path / "state" / FILE)
        file.write(packed(replace(PLACE, position_s=3.0, boot=boot, ended=on_disk == "ended")))
        file.close()
    dance = dance_of()
    resuming = Resumption("A test", runtime, tmp_path / "state", wanted)  # type: ignore[arg-type]
    words = resuming.go_on(dance, NOW)
    resuming.close()
    assert (resuming.power_cuts, resuming.restarts) == (power_cuts, restarts)
    assert resuming.went_on == (at_s is not None)
    assert dance.parts.motion.position_s == pytest.approx(at_s or 0.0, abs=1e-3)
    assert ("After a power cut" in words) == bool(power_cuts)


def test_counts_go_on_until_the_show_is_ended(dance_of: Callable[[], Reconciler], runtime: Path) -> None:
    for start in range(3):
        resuming, dance = Resumption("A test", runtime, None, "always"), dance_of()
        resuming.go_on(dance, NOW)
        assert resuming.restarts == start
        resuming.write_checkpoint(dance, 1)
        resuming.close()
    resuming = Resumption("A test", runtime, None, "always")
    resuming.write_checkpoint(dance_of(), 2)
    resuming.write_end()
    resuming.close()
    resuming = Resumption("A test", runtime, None, "always")
    assert not resuming.comes_back and resuming.restarts == 0
    resuming.close()


def test_a_place_from_which_no_frame_ever_leaves_is_given_up(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    """A crash at the first tick would otherwise come back for ever."""
    put(runtime, PLACE)
    begun: list[float] = []
    for _ in range(TRIES + 1):
        dance = dance_of()
        resuming = Resumption("A test", runtime, None, "always")
        words = resuming.go_on(dance, NOW)
        resuming.write_start(dance)  # and no note: it died in its first tick
        resuming.close()
        begun.append(dance.parts.motion.position_s)
    assert begun == pytest.approx([2.0] * TRIES + [0.0], abs=1e-3)
    assert f"{TRIES} starts" in words and "begins at the beginning" in words
    with closing(CheckpointReader(runtime)) as reader:
        place = reader.read()
    assert place is not None and place.tries == 1


def test_one_frame_is_enough_to_come_back_as_often_as_it_takes(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    put(runtime, PLACE)
    for _ in range(2 * TRIES):
        resuming, dance = Resumption("A test", runtime, None, "always"), dance_of()
        assert "goes on" in resuming.go_on(dance, NOW)
        resuming.write_start(dance)
        dance.parts.motion.advance()
        resuming.write_checkpoint(dance, 0)
        resuming.close()
    assert dance.parts.motion.position_s == pytest.approx(2.0 + 2 * TRIES * TICK_S, abs=0.01)


def test_without_room_for_it_the_dance_goes_on(dance_of: Callable[[], Reconciler], runtime: Path) -> None:
    (runtime / FILE).mkdir()
    resuming, dance = Resumption("A test", runtime, None, "always"), dance_of()
    assert resuming.go_on(dance, NOW) == ""
    assert "cannot be kept" in resuming.complaint and "`runtime:`" in resuming.complaint
    resuming.write_start(dance)
    resuming.write_checkpoint(dance, 0)
    resuming.write_end()
    resuming.close()


@pytest.fixture
def box(runtime: Path) -> BoxConfig:
    return BOX.model_copy(update={"runtime": runtime, "realtime": RealtimeConfig(enabled=False)})


def test_the_whole_stage_goes_on_where_it_was(show: Show, box: BoxConfig) -> None:
    stage = Stage(show, box, lambda words: None)
    with closing(stage), pytest.raises(ZeroDivisionError):
        stage.dance(None, lambda: stage.parts.motion.position_s > 0.3 and bool(1 / 0))  # late ticks stand
    was_at_s = stage.parts.motion.position_s
    said: list[str] = []
    again = Stage(show, box, said.append)
    with closing(again):
        assert again.parts.motion.position_s == pytest.approx(was_at_s, abs=1e-3)
        assert any("After a restart of the stage the show goes on at" in words for words in said)
        # The figure stands where it stood: no step through the room.
        np.testing.assert_allclose(again.tick.frame.root, stage.tick.frame.root, atol=0.02)
        again.dance(0.1, lambda: False)
    fresh = Stage(show, box, said.append)  # that one ended as it should
    with closing(fresh):
        assert fresh.parts.motion.position_s == 0.0
        assert not fresh.resuming.went_on


def test_a_place_goes_before_what_was_declared_before_it(show: Show, box: BoxConfig, runtime: Path) -> None:
    """The cue was called, and another part of the phrase after it."""
    declared = ShowState(show="A test", cue="storm").with_dance(NOW, {"phrase": ("walk", (0.0,))})
    declare(runtime, declared)
    place = replace(PLACE, excerpt=(1.0, 3.0), cue="storm", applied=declared.generation, boot=boot_id())
    put(runtime, place)
    with closing(Stage(show, box, lambda words: None)) as stage:
        assert (stage.reconciler.cue, stage.parts.motion.phrase) == ("storm", "walk")
        assert stage.parts.motion.position_s == pytest.approx(2.0, abs=1e-3)
        stage.dance(0.1, lambda: False)
        assert stage.parts.motion.excerpt_s == (1.0, 3.0)


def test_slots_are_not_needed_to_know_the_place(runtime: Path, show: Show, box: BoxConfig) -> None:
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
