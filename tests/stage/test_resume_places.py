"""Which place a stage goes on from: memory or disk, after a crash or a power cut, and when from none."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from appliance.box.checkpoint import FILE, Checkpoint, CheckpointReader, boot_id, packed
from appliance.box.clock import TICK_S, Slot
from appliance.box.orders import Order
from appliance.box.record import SlotFile
from appliance.levers.show_state import ShowState
from appliance.levers.table import CUE, ITERATIONS, PHRASE
from appliance.show.box import BoxConfig
from appliance.show.show import Show
from appliance.stage.fallback import PLACE_DROPPED
from appliance.stage.reconcile import Reconciler
from appliance.stage.resume import TRIES, Resumption
from appliance.stage.run import Stage
from appliance.stage.watch import Watch
from tests.logged import said
from tests.stage.places import PLACE, declare, put
from tests.stage.shows import NOW
from tests.stage.test_fallbacks import FITS
from tests.standing import moved


def test_after_a_power_cut_all_that_is_declared_is_new(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    """Its generations count from the machine's start."""
    put(runtime, moved(PLACE, boot="another", applied=10**15, cue="storm"))
    declare(runtime, ShowState(show="A test").to(ITERATIONS, (6, 5), NOW))
    dance = dance_of()
    with closing(Resumption("A test", runtime, None, "always")) as resuming:
        assert "After a power cut" in resuming.go_on(dance, NOW)
    assert dance.pending(NOW) == [Order("iterations", (6.0, 5.0, 0.0))]
    assert dance.cue == "storm"


@pytest.mark.parametrize(("boot", "rate"), [("another", 1.0), (boot_id(), 0.0)])
def test_after_a_power_cut_a_show_that_stood_dances(
    dance_of: Callable[[], Reconciler], runtime: Path, tmp_path: Path, boot: str, rate: float
) -> None:
    """The dark show state has gone with the memory: in full light the phrase does not stand still."""
    with closing(SlotFile(tmp_path / "state" / FILE)) as file:
        file.write(packed(moved(PLACE, rate=0.0, boot=boot)))
    dance = dance_of()
    with closing(Resumption("A test", runtime, tmp_path / "state", "always")) as resuming:
        assert "goes on at 2.0 s" in resuming.go_on(dance, NOW)
    assert dance.parts.led.motion.rate == rate


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (moved(PLACE, show="Another show"), "Before, the show was 'Another show'"),
        (moved(PLACE, phrase="run"), "no phrase 'run'"),
        (moved(PLACE, excerpt=(70.0, 90.0)), "Choose a longer part"),
        (moved(PLACE, rate=90.0), "The rate is 90"),
    ],
)
def test_a_place_that_this_show_does_not_have_is_no_place(
    dance_of: Callable[[], Reconciler], runtime: Path, place: Checkpoint, reason: str
) -> None:
    dance = dance_of()
    put(runtime, place)
    resuming = Resumption("A test", runtime, None, "always")
    message = resuming.go_on(dance, NOW)
    resuming.close()
    assert "begins at the beginning" in message and reason in message
    assert not resuming.went_on
    assert (dance.parts.led.motion.phrase, dance.parts.led.motion.position_s) == ("main", 0.0)
    for _ in range(20):
        dance.parts.led.motion.advance()
    assert (dance.parts.led.motion.phrase, dance.parts.led.motion.rate) == ("main", 1.0)
    assert dance.parts.led.motion.going_on[1] == pytest.approx(20 * TICK_S, abs=2e-3)


def test_a_second_beyond_the_phrase_is_its_last_one(
    dance_of: Callable[[], Reconciler], runtime: Path
) -> None:
    dance = dance_of()
    put(runtime, moved(PLACE, position_s=99.0))
    resuming = Resumption("A test", runtime, None, "always")
    assert "goes on" in resuming.go_on(dance, NOW)
    resuming.close()
    assert dance.parts.led.motion.position_s == pytest.approx(5.0, abs=0.1)


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
        put(runtime, moved(PLACE, boot=here, ended=in_memory == "ended"))
    if on_disk:
        boot = here if on_disk == "here" else "another"
        file = SlotFile(tmp_path / "state" / FILE)
        file.write(packed(moved(PLACE, position_s=3.0, boot=boot, ended=on_disk == "ended")))
        file.close()
    dance = dance_of()
    resuming = Resumption("A test", runtime, tmp_path / "state", wanted)  # type: ignore[arg-type]
    message = resuming.go_on(dance, NOW)
    resuming.close()
    assert (resuming.power_cuts, resuming.restarts) == (power_cuts, restarts)
    assert resuming.went_on == (at_s is not None)
    assert dance.parts.led.motion.position_s == pytest.approx(at_s or 0.0, abs=1e-3)
    assert ("After a power cut" in message) == bool(power_cuts)


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
        message = resuming.go_on(dance, NOW)
        resuming.write_start(dance)  # and no note: it died in its first tick
        resuming.close()
        begun.append(dance.parts.led.motion.position_s)
    assert begun == pytest.approx([2.0] * TRIES + [0.0], abs=1e-3)
    assert f"{TRIES} starts" in message and "begins at the beginning" in message
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
        dance.parts.led.motion.advance()
        resuming.write_checkpoint(dance, 0)
        resuming.close()
    assert dance.parts.led.motion.position_s == pytest.approx(2.0 + 2 * TRIES * TICK_S, abs=0.01)


def test_without_room_for_it_the_dance_goes_on(dance_of: Callable[[], Reconciler], runtime: Path) -> None:
    (runtime / FILE).mkdir()
    resuming, dance = Resumption("A test", runtime, None, "always"), dance_of()
    assert resuming.go_on(dance, NOW) == ""
    assert "cannot be kept" in resuming.complaint and "`runtime:`" in resuming.complaint
    resuming.write_start(dance)
    resuming.write_checkpoint(dance, 0)
    resuming.write_end()
    resuming.close()


@pytest.mark.parametrize(
    "place",
    [
        moved(PLACE, standing=(1e30, 0.0, 0.0)),
        moved(PLACE, strayed=(0.0, -1e200)),
        moved(PLACE, standing=(0.0, 0.0, math.inf)),
        moved(PLACE, liveliness=(0.5, 10**400, 0)),
    ],
)
def test_a_place_where_no_stage_stands_is_dropped_and_told(
    dance_of: Callable[[], Reconciler], runtime: Path, tmp_path: Path, place: Checkpoint
) -> None:
    """Three restarts died of it in their first tick."""
    put(runtime, place)
    dance = dance_of()
    with closing(Resumption("A test", runtime, tmp_path / "state", "always")) as resuming:
        assert "dropped, and the show begins at the beginning" in resuming.go_on(dance, NOW)
        assert (resuming.dropped, resuming.went_on) == (True, False)
        watch = Watch(dance.parts, FITS)
        watch.note_start(NOW, resuming, "", True)
    assert [one.name for one in watch.fallbacks.happened(NOW) if one.active] == [PLACE_DROPPED.name]


def test_a_place_in_memory_that_is_dropped_leaves_the_one_on_the_disk(
    dance_of: Callable[[], Reconciler], runtime: Path, tmp_path: Path
) -> None:
    put(runtime, moved(PLACE, standing=(0.0, -1e9, 0.0)))
    with closing(SlotFile(tmp_path / "state" / FILE)) as file:
        file.write(packed(PLACE))
        file.write(packed(moved(PLACE, standing=(1e9, 0.0, 0.0))))
    with closing(Resumption("A test", runtime, tmp_path / "state", "always")) as resuming:
        assert "goes on at 2.0 s" in resuming.go_on(dance_of(), NOW)
        assert resuming.dropped


@pytest.fixture
def show(walking_show: Show) -> Show:
    return walking_show


def test_the_whole_stage_goes_on_where_it_was(show: Show, box: BoxConfig) -> None:
    stage = Stage(show, box)
    with closing(stage), pytest.raises(ZeroDivisionError):
        stage.dance(None, lambda: stage.parts.led.motion.position_s > 0.3 and bool(1 / 0))  # late ticks stand
    was_at_s = stage.parts.led.motion.position_s
    again = Stage(show, box)
    with closing(again):
        assert again.parts.led.motion.position_s == pytest.approx(was_at_s, abs=1e-3)
        assert any("After a restart of the stage the show goes on at" in message for message in said)
        # The figure stands where it stood: no step through the room.
        np.testing.assert_allclose(
            again.tick.frame.puppets[0].root, stage.tick.frame.puppets[0].root, atol=0.02
        )
        again.dance(0.1, lambda: False)
    fresh = Stage(show, box)  # that one ended as it should
    with closing(fresh):
        assert fresh.parts.led.motion.position_s == 0.0
        assert not fresh.resuming.went_on


def test_a_place_goes_before_what_was_declared_before_it(show: Show, box: BoxConfig, runtime: Path) -> None:
    """The cue was called, and another part of the phrase after it."""
    declared = ShowState(show="A test").to(CUE, "storm", NOW).to(PHRASE, "walk", NOW)
    declare(runtime, declared)
    place = moved(PLACE, excerpt=(1.0, 3.0), cue="storm", applied=declared.generation, boot=boot_id())
    put(runtime, place)
    with closing(Stage(show, box)) as stage:
        assert (stage.reconciler.cue, stage.parts.led.motion.phrase) == ("storm", "walk")
        assert stage.parts.led.motion.position_s == pytest.approx(2.0, abs=1e-3)
        stage.dance(0.1, lambda: False)
        assert stage.parts.led.motion.excerpt_s == (1.0, 3.0)


def test_slots_are_not_needed_to_know_the_place(runtime: Path, show: Show, box: BoxConfig) -> None:
    """A late tick does not dance: the phrase stands, and so does its place."""
    stage = Stage(show, box)
    with closing(stage):
        for number in range(3):
            slot = Slot(number, 10.0 + number * TICK_S, 10.019 + number * TICK_S)
            stage.tick.run(slot)
            stage._note(slot)
        with closing(CheckpointReader(runtime)) as reader:
            place = reader.read()
    assert place is not None and (place.tick, place.puppets[0].position_s) == (2, 0.0)
