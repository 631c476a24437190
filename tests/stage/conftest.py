"""Shows, the dance that follows what is declared or resumes; an evening on which sensors are put on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from appliance.box.show_state import ShowStateReader
from appliance.show.box import BoxConfig, RealtimeConfig
from appliance.show.show import Show, load_show
from appliance.show_control.command import Command
from appliance.show_control.show_state_commands import declare
from appliance.stage.iterations import Iterations
from appliance.stage.reconcile import Reconciler
from appliance.stage.sensor_memory import SensorMemory
from appliance.stage.sharing import facts_of
from appliance.stage.stage_parts import StageParts, assemble
from tests.bundles import swaying_phrase, write_show
from tests.stage.declared import Commanded, Declared, follow
from tests.stage.shows import BOX, NOW, walking, write_show_with_phrase
from tests.stage.worn import HAND, Evening, Stage

CUES = [
    {"name": "start", "phrase": "main", "iterations": [4, 3], "hands": ["lShldr", "Chest"]},
    {"name": "storm", "phrase": "slow", "iterations": [12, 11], "hands": ["Chest"], "fade_s": 0.2},
    {"name": "alone", "hands": []},
    {"name": "lights only", "master": 0.5},
    {"name": "calm", "liveliness": 0.25, "seed": 2**31 - 1, "fade_s": 1.0},
]


@pytest.fixture
def show(tmp_path: Path) -> Show:
    phrase = swaying_phrase(5.0).resampled(60.0)  # brought to 50 at the start
    return load_show(write_show_with_phrase(tmp_path / "show", "slow", phrase, CUES))


@pytest.fixture
def parts(show: Show) -> Iterator[StageParts]:
    parts = assemble(show, BOX)
    parts.led.iterations = Iterations(3, 2, most=8)
    yield parts
    parts.close()


@pytest.fixture
def iterations(parts: StageParts) -> Iterations:
    return parts.led.iterations


@pytest.fixture
def declared() -> Declared:
    return Declared()


@pytest.fixture
def reconciler(parts: StageParts, declared: Declared) -> Reconciler:
    return Reconciler("A test", parts, declared)  # type: ignore[arg-type]


@pytest.fixture
def command(show: Show, iterations: Iterations, declared: Declared, reconciler: Reconciler) -> Commanded:
    """Lets show control declare what a command says, and the dance follow; gives what it says about it."""
    facts = facts_of(show, None, iterations, NOW)

    def command(address: str, *values: float, text: str = "") -> str:
        declared.now, _ = declare(declared.now, Command(address, values, text), facts, NOW)
        message = follow(reconciler)
        assert not reconciler.pending(NOW)
        return message

    return command


@pytest.fixture
def walking_show(tmp_path: Path) -> Show:
    storm = {"name": "storm", "phrase": "walk", "iterations": [6, 5], "hands": ["Chest"], "fade_s": 0.2}
    return load_show(write_show_with_phrase(tmp_path / "show", "walk", walking(), [storm]))


@pytest.fixture
def runtime(tmp_path: Path) -> Path:
    (tmp_path / "runtime").mkdir(mode=0o700)
    return tmp_path / "runtime"


@pytest.fixture
def dance_of(walking_show: Show, runtime: Path) -> Iterator[Callable[[], Reconciler]]:
    """A dance from its beginning, as a stage of this folder makes it before it resumes."""
    made: list[Reconciler] = []

    def dance() -> Reconciler:
        reader = ShowStateReader(runtime)
        parts = assemble(walking_show, BOX)
        parts.led.iterations = Iterations(3, 2, 20)
        made.append(Reconciler("A test", parts, reader))
        return made[-1]

    yield dance
    for one in made:
        one.parts.close()


@pytest.fixture
def box(runtime: Path) -> BoxConfig:
    return BOX.model_copy(update={"runtime": runtime, "realtime": RealtimeConfig(enabled=False)})


@pytest.fixture
def memory() -> SensorMemory:
    return SensorMemory(None)


@pytest.fixture
def evening(tmp_path: Path, memory: SensorMemory) -> Iterator[Evening]:
    all_parts: list[StageParts] = []

    def begun(hands: list[dict[str, object]] | None = None) -> Stage:
        """The box is switched on; what it remembers of before stays."""
        show = load_show(write_show(tmp_path / f"show{len(all_parts)}", hands or [HAND]))
        all_parts.append(assemble(show, BOX))
        return Stage(all_parts[-1], memory)

    yield begun
    for parts in all_parts:
        parts.close()
