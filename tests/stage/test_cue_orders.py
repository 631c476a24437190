"""Cues, phrases and hands by order: what show control asks of the dance, carried out between two ticks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import yaml

from appliance.box.clock import Slot
from appliance.box.show_state import ShowState, ShowStateWriter
from appliance.pose import quaternion
from appliance.pose.bvh import write_bvh
from appliance.show.box import BoxConfig, OutputsConfig, RealtimeConfig, SensorsConfig
from appliance.show.show import Show, load_show
from appliance.show_control.orders import Order
from appliance.stage.carry_out import obey, resume
from appliance.stage.iterations import Iterations
from appliance.stage.run import Stage
from appliance.stage.sensor_fit import SensorFit
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.tick import Tick
from tests.bundles import FIGURE, swaying_phrase, write_show

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


@pytest.fixture
def show(tmp_path: Path) -> Show:
    folder = write_show(tmp_path / "show", HANDS)
    write_bvh(folder / "slow.bvh", swaying_phrase(5.0).resampled(60.0))  # brought to 50 at the start
    values = yaml.safe_load((folder / "show.yaml").read_text())
    values |= {"motion": {"phrases": {"slow": "slow.bvh"}}, "cues": CUES}
    (folder / "show.yaml").write_text(yaml.safe_dump(values))
    return load_show(folder)


@pytest.fixture
def cast(show: Show) -> Iterator[StageParts]:
    cast = assemble(show, BOX)
    yield cast
    cast.close()


@pytest.fixture
def iterations() -> Iterations:
    return Iterations(3, 2, most=8)


@pytest.fixture
def tick(cast: StageParts, iterations: Iterations) -> Tick:
    return Tick(cast, SensorFit(cast, SensorMemory(None, print), print), iterations, 1.0)


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


def enabled(cast: StageParts) -> dict[str, bool]:
    return {puppeteer.joint: puppeteer.enabled for puppeteer in cast.hands.puppeteers}


def test_a_cue_changes_phrase_iterations_and_hands(cast: StageParts, iterations: Iterations) -> None:
    done, words = obey(Order("cue", text="storm"), cast, iterations, 1.0)
    assert done and "with 8 and 7: at most 8 fit" in words  # the cue asks for 12 and 11
    assert reached(iterations) == (8, 7)
    assert enabled(cast) == {"lShldr": False, "Chest": True}
    assert cast.cue == "storm"
    for _ in range(20):
        cast.motion.advance()
    assert cast.motion.phrase == "slow"
    assert obey(Order("cue", text="start"), cast, iterations, 1.0) == (True, "")
    assert reached(iterations) == (4, 3)
    assert enabled(cast) == {"lShldr": True, "Chest": True}


def test_what_a_cue_leaves_out_stays(cast: StageParts, iterations: Iterations) -> None:
    obey(Order("cue", text="storm"), cast, iterations, 1.0)
    obey(Order("cue", text="lights only"), cast, iterations, 1.0)
    assert reached(iterations) == (8, 7)
    assert enabled(cast) == {"lShldr": False, "Chest": True}
    assert cast.cue == "lights only"
    obey(Order("cue", text="alone"), cast, iterations, 1.0)
    assert enabled(cast) == {"lShldr": False, "Chest": False}


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (Order("cue", text="strom"), "Did you mean 'storm'?"),
        (Order("cue", text=""), "Known: start, storm, alone, lights only."),
        (Order("phrase", text="slwo"), "Did you mean 'slow'?"),
        (Order("hand", (0.0,), "Chst"), "Did you mean 'Chest'?"),
        (Order("hand", (0.0,), 99), "no joint 99"),
        (Order("hand", (0.0,), "Hips"), "No hand of this show holds 'Hips'"),
    ],
)
def test_an_unknown_name_changes_nothing(
    cast: StageParts, iterations: Iterations, order: Order, words: str
) -> None:
    done, said = obey(order, cast, iterations, 1.0)
    assert not done and words in said
    cast.motion.advance()
    assert (cast.cue, cast.motion.jumped, enabled(cast)) == ("", False, {"lShldr": True, "Chest": True})


def test_a_phrase_is_called_with_its_own_fade(cast: StageParts, iterations: Iterations) -> None:
    assert obey(Order("phrase", (1.0,), "slow"), cast, iterations, 1.0) == (True, "")
    cast.motion.advance()
    assert cast.motion.jumped
    assert "plays already" in obey(Order("phrase", (1.0,), "slow"), cast, iterations, 1.0)[1]
    assert obey(Order("phrase", text="main"), cast, iterations, 1.0) == (True, "")


def test_a_hand_lets_go_and_holds_by_name_or_number(
    cast: StageParts, iterations: Iterations, tick: Tick
) -> None:
    place = cast.hand_places[0]
    danced(tick, 50)
    assert cast.hands.weights[place] == 1.0
    done, words = obey(Order("hand", (0.0,), FIGURE.index("lShldr")), cast, iterations, 1.0)
    assert done and words == "The hand of lShldr lets go."
    danced(tick, 60, 50)
    assert cast.hands.weights[place] == 0.0
    obey(Order("hand", (1.0,), "lShldr"), cast, iterations, 1.0)
    danced(tick, 60, 110)
    assert cast.hands.weights[place] == 1.0


def test_a_hand_by_osc_that_was_told_nothing_holds_its_joint_where_it_is(
    cast: StageParts, iterations: Iterations, tick: Tick
) -> None:
    chest = FIGURE.index("Chest")
    before = danced(tick, 62)
    assert quaternion.angle_between(before[-1, chest], before[-20, chest]) > 0.1  # it sways
    obey(Order("hand", (1.0,), "Chest"), cast, iterations, 1.0)
    held = cast.hands.puppeteers[1].pull(11.24).orientation.copy()
    assert quaternion.angle_between(held, before[-1, chest]) < 1e-3
    after = danced(tick, 100, 62)
    assert quaternion.angle_between(after[-50:, chest], held).max() < 1e-3


def test_a_cue_shows_no_jump(cast: StageParts, iterations: Iterations, tick: Tick) -> None:
    parts = [danced(tick, 70)]
    for place, name in enumerate(("storm", "start", "alone", "storm")):
        obey(Order("cue", text=name), cast, iterations, 1.0)
        parts.append(danced(tick, 70, 70 * (place + 1)))
    poses = np.concatenate(parts)
    assert np.sum(poses[1:] * poses[:-1], axis=-1).min() > 0.9
    still = FIGURE.index("lForeArm")
    assert quaternion.angle_between(poses[1:, still], poses[:-1, still]).max() < 1e-3


def test_a_show_that_is_started_again_comes_back_in_its_cue(cast: StageParts, iterations: Iterations) -> None:
    sentence = resume("storm", cast, iterations)
    assert "goes on in the cue 'storm'" in sentence and "at most 8 fit" in sentence
    assert (cast.cue, cast.motion.phrase, cast.motion.position_s) == ("storm", "slow", 0.0)
    assert (iterations.coding, iterations.interaction) == (8, 7)
    assert enabled(cast) == {"lShldr": False, "Chest": True}
    cast.motion.advance()
    assert not cast.motion.jumped
    first = cast.motion.window()[0][FIGURE.index("Chest")]
    held = cast.hands.puppeteers[1].pull(10.0).orientation
    assert quaternion.angle_between(held, first) < 0.1


@pytest.mark.parametrize("name", ["", "of another show"])
def test_without_a_cue_of_this_show_it_begins_as_it_does(
    cast: StageParts, iterations: Iterations, name: str
) -> None:
    assert resume(name, cast, iterations) == ""
    assert (cast.cue, cast.motion.phrase, iterations.coding) == ("", "main", 3)


def test_the_stage_asks_the_house_in_which_cue_it_was(show: Show, tmp_path: Path) -> None:
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    box = BOX.model_copy(update={"runtime": runtime, "realtime": RealtimeConfig(enabled=False)})
    for cue, phrase in (("storm", "slow"), ("", "main")):
        with closing(ShowStateWriter(runtime)) as show_state:
            show_state.write(ShowState(cue=cue))
        said: list[str] = []
        stage = Stage(show, box, said.append)
        with closing(stage):
            stage.dance(0.1, lambda: False)
            assert (stage.cast.cue, stage.cast.motion.phrase) == (cue, phrase)
        assert any("goes on in the cue 'storm'" in words for words in said) == (cue == "storm")
