"""What show control declares: the dance follows between two ticks, and applies each part once."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.box.checkpoint import CheckpointReader
from appliance.box.clock import Slot
from appliance.box.show_state import ShowState, ShowStateWriter
from appliance.dancer.puppeteers import Remote
from appliance.outputs.frame_reader import FrameReader
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.show.box import BoxConfig, OutputsConfig, RealtimeConfig, SensorsConfig
from appliance.show.show import Show, load_show
from appliance.show_control.command import Command
from appliance.show_control.orders import Order
from appliance.show_control.show_state_commands import DECLARATIONS
from appliance.stage.carry_out import obey
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.run import Stage
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from tests.bundles import FIGURE, swaying_phrase, write_show

Commanded = Callable[..., str]
CUES = [
    {"name": "start", "phrase": "main", "iterations": [4, 3], "hands": ["lShldr", "Chest"]},
    {"name": "storm", "phrase": "slow", "iterations": [12, 11], "hands": ["Chest"], "fade_s": 0.2},
    {"name": "alone", "hands": []},
    {"name": "lights only", "master": 0.5},
]
HANDS: list[dict[str, object]] = [
    {"fixed": {"orientation": [0, 1, 0, 0]}, "joint": "lShldr"},
    {"osc": True, "joint": "Chest"},
]


BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
NOW = 1000.0


class Declared:
    """The show state as a test declares it."""

    def __init__(self) -> None:
        self.now = ShowState(show="A test")

    def read(self) -> ShowState:
        return self.now


@pytest.fixture
def show(tmp_path: Path) -> Show:
    folder = write_show(tmp_path / "show", HANDS)
    write_bvh(folder / "slow.bvh", swaying_phrase(5.0).resampled(60.0))  # brought to 50 at the start
    values = yaml.safe_load((folder / "show.yaml").read_text())
    values |= {"motion": {"phrases": {"slow": "slow.bvh"}}, "cues": CUES}
    (folder / "show.yaml").write_text(yaml.safe_dump(values))
    return load_show(folder)


def follow(reconciler: Reconciler, now: float = NOW) -> str:
    """Let the dance follow what is declared; gives what it says about it."""
    orders = reconciler.pending(now)
    return " ".join(filter(None, (obey(one, reconciler.parts, reconciler.iterations)[1] for one in orders)))


@pytest.fixture
def parts(show: Show) -> Iterator[StageParts]:
    parts = assemble(show, BOX)
    yield parts
    parts.close()


@pytest.fixture
def iterations() -> Iterations:
    return Iterations(3, 2, most=8)


@pytest.fixture
def declared() -> Declared:
    return Declared()


@pytest.fixture
def reconciler(parts: StageParts, iterations: Iterations, declared: Declared) -> Reconciler:
    return Reconciler("A test", parts, iterations, declared)  # type: ignore[arg-type]


@pytest.fixture
def command(show: Show, iterations: Iterations, declared: Declared, reconciler: Reconciler) -> Commanded:
    """Lets show control declare what a command says, and the dance follow; gives what it says about it."""
    facts = facts_of(show, None, iterations, NOW)

    def command(address: str, *values: float, text: str = "") -> str:
        declared.now, _ = DECLARATIONS[address](declared.now, Command(address, values, text), facts, NOW)
        words = follow(reconciler)
        assert not reconciler.pending(NOW)
        return words

    return command


@pytest.fixture
def tick(parts: StageParts, iterations: Iterations) -> Tick:
    return Tick(parts, SensorFit(parts, SensorMemory(None, print), print), iterations, 1.0)


def test_springs_follow_what_is_declared_also_after_a_restart(tmp_path: Path, declared: Declared) -> None:
    cues = [{"name": "gale", "springs": "storm", "fade_s": 0}]
    show = load_show(write_show(tmp_path / "sprung", [{"springs": "stiff", "joint": "Hips"}], cues=cues))
    parts, again = assemble(show, BOX), assemble(show, BOX)
    facts = facts_of(show, None, Iterations(3, 2, most=8), NOW)
    reconciler = Reconciler("A test", parts, Iterations(3, 2, most=8), declared)  # type: ignore[arg-type]
    assert parts.first.springs is not None and again.first.springs is not None

    def say(address: str, *values: float, text: str = "") -> None:
        declared.now, _ = DECLARATIONS[address](declared.now, Command(address, values, text), facts, NOW)
        follow(reconciler)

    say("/springs/wind", 1.0, 2.0, 3.0)
    say("/cue", text="gale")
    assert parts.first.springs.setting == "storm"
    assert parts.first.springs.wind.tolist() == list(
        parts.first.springs.settings["storm"].wind
    )  # the older wind is over
    say("/springs", text="loose")
    say("/springs/wind", 3.0, 0.0, -1.0)
    say("/springs/gravity", 5.0)
    restarted = Reconciler("A test", again, Iterations(3, 2, most=8), declared)  # type: ignore[arg-type]
    restarted.generation = reconciler.generation  # as its checkpoint says
    follow(restarted)
    assert not restarted.pending(NOW)
    for springs in (parts.first.springs, again.first.springs):
        assert (springs.setting, springs.gravity, springs.wind.tolist()) == ("loose", 5.0, [3.0, 0.0, -1.0])
    with pytest.raises(ValueError, match="Did you mean 'loose'"):
        say("/springs", text="lose")
    parts.close()
    again.close()


@pytest.mark.parametrize("puppets", [1, 2])
def test_strings_drive_no_joint_in_panic_blackout_and_after_a_stop(
    tmp_path: Path, declared: Declared, puppets: int
) -> None:
    strung = [{"springs": "stiff", "joint": "Hips"}]
    settings, two = [{"name": "stiff", "feedback": 1}], [{"name": "left"}, {"name": "right", "hands": strung}]
    first = strung if puppets == 1 else []
    config = {"springs": settings, **({"puppets": two} if puppets == 2 else {})}
    parts = assemble(load_show(write_show(tmp_path / "strung", first, **config)), BOX)
    reconciler = Reconciler("A test", parts, Iterations(3, 2, most=8), declared)  # type: ignore[arg-type]
    (springs,) = parts.springs
    assert springs.feedback == 1.0
    for away, back in (("/panic", "/go"), ("/stop", "/go"), ("/blackout", "/blackout")):
        for address, values in ((away, (1.0,)), (back, () if back == "/go" else (0.0,))):
            declared.now, _ = DECLARATIONS[address](declared.now, Command(address, values), None, NOW)
            follow(reconciler)
            assert springs.feedback == 0.0
        gains = []
        for tick in range(60):
            springs.pull(NOW + 0.02 * tick)
            gains.append(springs.feedback)
        assert gains[-1] == 1.0 and max(np.diff(gains)) < 0.05  # and comes back evenly
    parts.close()


def test_springs_of_which_there_are_none_are_refused(command: Commanded, parts: StageParts) -> None:
    with pytest.raises(ValueError, match="No hand of this show is springs"):
        command("/springs/wind", 1.0, 0.0, 0.0)
    done, words = obey(Order("kick", (1.0, 0.0, 0.0)), parts, Iterations(3, 2, 8))
    assert not done and "No hand of this show is springs" in words


def danced(tick: Tick, ticks: int, begin: int = 0) -> np.ndarray:
    """Poses (ticks, J, 4) of so many frames."""
    poses = []
    for number in range(begin, begin + ticks):
        slot = Slot(number, 10 + 0.02 * number, 10 + 0.02 * number, 0)
        tick.run(slot)
        poses.append(tick.frame.pose.copy())
        tick.after(slot)
    return np.array(poses)


def reached(iterations: Iterations) -> tuple[int, int]:
    """How often the puppet goes over a window once the change is over."""
    for _ in range(50 * 60):
        iterations.advance()
    return iterations.coding, iterations.interaction


def enabled(parts: StageParts) -> dict[str, bool]:
    return {puppeteer.joint: puppeteer.enabled for puppeteer in parts.hands.puppeteers}


def test_a_cue_changes_phrase_iterations_and_hands(
    parts: StageParts, iterations: Iterations, reconciler: Reconciler, command: Commanded
) -> None:
    assert "with 8 and 7: at most 8 fit" in command("/cue", text="storm")  # the cue asks for 12 and 11
    assert reached(iterations) == (8, 7)
    assert enabled(parts) == {"lShldr": False, "Chest": True}
    assert reconciler.cue == "storm"
    for _ in range(20):
        parts.motion.advance()
    assert parts.motion.phrase == "slow"
    assert command("/cue", text="start") == ""
    assert reached(iterations) == (4, 3)
    assert enabled(parts) == {"lShldr": True, "Chest": True}


def test_what_a_cue_leaves_out_stays(
    parts: StageParts, iterations: Iterations, reconciler: Reconciler, command: Commanded
) -> None:
    command("/cue", text="storm")
    command("/cue", text="lights only")
    assert reached(iterations) == (8, 7)
    assert enabled(parts) == {"lShldr": False, "Chest": True}
    assert reconciler.cue == "lights only"
    command("/cue", text="alone")
    assert enabled(parts) == {"lShldr": False, "Chest": False}


def test_nothing_is_pending_before_anything_is_declared_and_of_another_show(
    reconciler: Reconciler, declared: Declared
) -> None:
    assert not reconciler.pending(NOW)
    declared.now = replace(declared.now.with_dance(NOW, {"phrase": ("slow", (0.0,))}), show="Another")
    assert not reconciler.pending(NOW) and reconciler.generation == 0


def test_of_what_several_commands_declared_meanwhile_the_newest_counts(
    reconciler: Reconciler, declared: Declared
) -> None:
    """After a stall, in the order in which they came."""
    for parts in (
        {"iterations": ("", (5.0, 4.0)), "rate": ("", (3.0,))},
        {"phrase": ("slow", (1.0,)), "hand Chest": ("Chest", (0.0,))},
        {"rate": ("", (2.0,))},
        {"iterations": ("", (6.0, 5.0, 0.5))},
    ):
        declared.now = declared.now.with_dance(NOW, parts)
    assert list(reconciler.pending(NOW)) == [
        Order("phrase", (1.0,), "slow"),
        Order("hand", (0.0,), "Chest"),
        Order("iterations", (6.0, 5.0, 0.5)),
        Order("rate", (2.0,)),
    ]
    assert reconciler.generation == declared.now.generation


def test_a_part_is_applied_once_so_that_what_came_after_it_stays(
    parts: StageParts, reconciler: Reconciler, command: Commanded
) -> None:
    command("/hold", 1.0, text="Chest")
    chest = parts.hands.puppeteers[1]
    assert isinstance(chest, Remote)
    chest.release()
    command("/hold", 0.0, text="lShldr")
    assert not chest.state()["told"]  # an order gave it back since


def test_a_phrase_that_the_show_lost_changes_nothing_and_is_told(
    parts: StageParts, reconciler: Reconciler, declared: Declared
) -> None:
    parts_declared = {"phrase": ("slwo", (0.0,)), "rate": ("", (0.5,))}
    declared.now = declared.now.with_dance(NOW, parts_declared)
    assert "Did you mean 'slow'?" in follow(reconciler)
    parts.motion.advance()
    assert (parts.motion.rate, parts.motion.jumped) == (0.5, False)
    assert not reconciler.pending(NOW)


def test_a_stopped_show_stands_once_it_is_dark_and_goes_on_at_its_rate(
    parts: StageParts, reconciler: Reconciler, declared: Declared, command: Commanded
) -> None:
    def rate_at(now: float) -> float:
        follow(reconciler, now)
        return parts.motion.rate

    command("/player/rate", 0.5)
    declared.now = declared.now.with_going(False, NOW, 2.0)
    assert [rate_at(NOW + t) for t in (0.0, 1.9, 2.0, 3.0)] == [0.5, 0.5, 0.0, 0.0]
    declared.now = declared.now.with_dance(
        NOW, {"rate": ("", (-1.0,))}
    )  # in the dark it stands, and goes on so
    assert rate_at(NOW + 4.0) == 0.0
    declared.now = declared.now.with_going(True, NOW + 5.0, 1.0)
    assert rate_at(NOW + 5.0) == -1.0
    declared.now = declared.now.with_dance(NOW, {"rate": ("", ())})
    assert rate_at(NOW + 6.0) == 1.0


def test_a_show_that_stands_by_itself_can_be_started(parts: StageParts, iterations: Iterations) -> None:
    parts.motion.rate = 0.0
    declared = Declared()
    reconciler = Reconciler("A test", parts, iterations, declared)  # type: ignore[arg-type]
    assert not reconciler.pending(NOW)
    declared.now = declared.now.with_dance(NOW, {"rate": ("", ())})
    assert reconciler.pending(NOW) == [Order("rate", (1.0,))]


def test_a_phrase_is_called_with_its_own_fade(parts: StageParts, command: Commanded) -> None:
    assert command("/phrase", 1.0, text="slow") == ""
    parts.motion.advance()
    assert parts.motion.jumped
    assert "plays already" in command("/phrase", 1.0, text="slow")
    assert command("/phrase", text="main") == ""


def test_a_phrase_that_is_called_again_plays_as_a_whole(parts: StageParts, command: Commanded) -> None:
    command("/phrase", text="slow")
    parts.motion.excerpt(1.0, 2.0)
    assert command("/phrase", text="slow") == ""
    assert parts.motion.excerpt_s == pytest.approx((0.0, 5.0), abs=0.1)


def test_a_hand_lets_go_and_holds(parts: StageParts, command: Commanded, tick: Tick) -> None:
    place = parts.first.hand_places[0]
    danced(tick, 50)
    assert parts.hands.weights[place] == 1.0
    command("/hold", 0.0, text="lShldr")
    danced(tick, 60, 50)
    assert parts.hands.weights[place] == 0.0
    command("/hold", 1.0, text="lShldr")
    danced(tick, 60, 110)
    assert parts.hands.weights[place] == 1.0


def test_iterations_that_leave_the_hands_idle_are_told(parts: StageParts, command: Commanded) -> None:
    idle = "None of the iterations is interactive: the hands move nothing."
    assert command("/iterations", 1.0, 0.0) == idle
    command("/cue", text="alone")
    assert command("/iterations", 1.0, 0.0) == ""


def test_a_hand_by_osc_that_was_told_nothing_holds_its_joint_where_it_is(
    parts: StageParts, command: Commanded, tick: Tick
) -> None:
    chest = FIGURE.index("Chest")
    before = danced(tick, 62)
    assert quaternion.angle_between(before[-1, chest], before[-20, chest]) > 0.1  # it sways
    command("/hold", 1.0, text="Chest")
    held = parts.hands.puppeteers[1].pull(11.24).orientation.copy()
    assert quaternion.angle_between(held, before[-1, chest]) < 1e-3
    after = danced(tick, 100, 62)
    assert quaternion.angle_between(after[-50:, chest], held).max() < 1e-3


def test_a_kept_joint_holds_and_lets_go(tmp_path: Path) -> None:
    parts = assemble(load_show(write_show(tmp_path / "kept", [{"kept": True, "joint": "Chest"}])), BOX)
    place = parts.first.hand_places[0]
    for holds, begins in ((True, 0), (False, 60), (True, 120)):
        obey(Order("hand", (float(holds),), "Chest"), parts, Iterations(3, 3, 8))
        for tick in range(60):
            window = parts.first.puppet.select(parts.motion.window())
            parts.hands.pull(10.0 + 0.02 * (begins + tick), window)
            assert np.array_equal(parts.hands.targets[:, place], window[:, place])
            parts.motion.advance()
        assert parts.hands.weights[place] == float(holds)
    parts.close()


def test_a_cue_shows_no_jump(command: Commanded, tick: Tick) -> None:
    parts = [danced(tick, 70)]
    for place, name in enumerate(("storm", "start", "alone", "storm")):
        command("/cue", text=name)
        parts.append(danced(tick, 70, 70 * (place + 1)))
    poses = np.concatenate(parts)
    from_tick_to_tick = np.sum(poses[1:] * poses[:-1], axis=-1).min(axis=-1)
    before_the_first_cue = from_tick_to_tick[:69].min()
    assert from_tick_to_tick.min() > 0.99 * before_the_first_cue > 0.8
    still = FIGURE.index("lForeArm")
    assert quaternion.angle_between(poses[1:, still], poses[:-1, still]).max() < 1e-3


def test_a_stage_without_a_checkpoint_begins_with_what_is_declared(
    parts: StageParts, iterations: Iterations, reconciler: Reconciler, declared: Declared
) -> None:
    called = {"phrase": ("slow", (2.0,)), "iterations": ("", (12.0, 11.0, 2.0))}
    hands = {"hand lShldr": ("lShldr", (0.0,)), "hand Chest": ("Chest", (1.0,))}
    declared.now = replace(declared.now.with_dance(NOW, called | hands), cue="storm")
    sentence = reconciler.begin(NOW)
    assert "goes on in the cue 'storm'" in sentence and "at most 8 fit" in sentence
    assert (reconciler.cue, parts.motion.phrase, parts.motion.position_s) == ("storm", "slow", 0.0)
    assert (iterations.coding, iterations.interaction) == (8, 7)
    assert enabled(parts) == {"lShldr": False, "Chest": True}
    parts.motion.advance()
    assert not parts.motion.jumped
    first = parts.motion.window()[0][FIGURE.index("Chest")]
    held = parts.hands.puppeteers[1].pull(10.0).orientation
    assert quaternion.angle_between(held, first) < 0.1


@pytest.mark.parametrize(
    "show_state",
    [ShowState(), ShowState(show="Another", cue="storm").with_dance(NOW, {"rate": ("", (0.5,))})],
)
def test_with_nothing_declared_for_this_show_it_begins_as_it_does(
    parts: StageParts,
    iterations: Iterations,
    reconciler: Reconciler,
    declared: Declared,
    show_state: ShowState,
) -> None:
    declared.now = show_state
    assert reconciler.begin(NOW) == ""
    assert (reconciler.cue, parts.motion.phrase, parts.motion.rate, iterations.coding) == ("", "main", 1.0, 3)


@pytest.fixture
def box(tmp_path: Path) -> BoxConfig:
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    return BOX.model_copy(update={"runtime": runtime, "realtime": RealtimeConfig(enabled=False)})


def test_the_stage_begins_with_the_show_state_of_its_folder(show: Show, box: BoxConfig) -> None:
    for cue, phrase in (("storm", "slow"), ("", "main")):
        with closing(ShowStateWriter(box.runtime)) as writer:
            declared = ShowState(show="A test", cue=cue)
            writer.write(declared.with_dance(NOW, {"phrase": (phrase, (0.0,))}) if cue else declared)
        said: list[str] = []
        stage = Stage(show, box, said.append)
        with closing(stage):
            stage.dance(0.1, lambda: False)
            assert (stage.reconciler.cue, stage.parts.motion.phrase) == (cue, phrase)
        assert any("goes on in the cue 'storm'" in words for words in said) == (cue == "storm")


def test_the_dance_follows_within_a_tick_reports_it_and_notes_it_before(show: Show, box: BoxConfig) -> None:
    with (
        closing(ShowStateWriter(box.runtime)) as writer,
        closing(Stage(show, box, print)) as stage,
        closing(CheckpointReader(box.runtime)) as checkpoint,
        closing(FrameReader(box.runtime)) as frames,
    ):
        declared = ShowState(show="A test", cue="storm").with_dance(NOW, {"phrase": ("slow", (1.0,))})
        ticks: list[int] = []

        def follows() -> bool:
            """The stage asks this before each tick."""
            ticks.append(stage.health.ticks)
            if len(ticks) == 2:
                writer.write(declared)
            return len(ticks) == 4

        stage.dance(None, follows)
        frames.state(time.monotonic())
        health, place = frames.health(), checkpoint.read()
        assert health is not None and place is not None
        assert health["applied"] == [declared.generation, ""]
        assert health["cue"] == place.cue == "storm"
        assert (place.phrase, place.applied) == ("slow", declared.generation)
        reads = [stage.reconciler.pending(time.monotonic()) for _ in range(100)]
        assert reads == [[]] * 100


def test_an_unchanged_show_state_leaves_nothing_to_the_collector(show: Show, box: BoxConfig) -> None:
    with closing(ShowStateWriter(box.runtime)) as writer, closing(Stage(show, box, print)) as stage:
        writer.write(ShowState(show="A test").with_dance(NOW, {"rate": ("", (1.0,))}))
        stage.reconciler.pending(NOW)
        gc.collect()
        gc.disable()
        before = gc.get_count()[0]
        for _ in range(100):
            stage.reconciler.pending(NOW)
        grown = gc.get_count()[0] - before
        gc.enable()
    assert grown < 20
