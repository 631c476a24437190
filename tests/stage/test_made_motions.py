"""Motion made ahead on the stage: it comes when it is there, changes at returns, and its absence is told."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from appliance.box.made_motion import FOLDER, MadeMotion, MadeMotionWriter
from appliance.box.show_state import ShowStateReader, ShowStateWriter
from appliance.dancer.loop import Loop
from appliance.dancer.material.maker import Maker
from appliance.dancer.material.material_file import Material, recipe_text, write_material
from appliance.dancer.material.prompt import end_of, prompt_of
from appliance.dancer.phrase import NUMBER
from appliance.levers.show_state import ShowState
from appliance.levers.table import PHRASE
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig
from appliance.show.show import Show, load_show
from appliance.stage import fallback as rows
from appliance.stage.admission import Admission
from appliance.stage.carry_out import obey
from appliance.stage.made_motions import LATE_S, open_made_motions
from appliance.stage.reconcile import Reconciler
from appliance.stage.resume import Resumption
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.watch import Watch
from tests.bundles import FIGURE
from tests.sources import write_show_with_sources

BOX = BoxConfig(sensors=SensorsConfig(udp=None), outputs=OutputsConfig(osc=[]))
FITS = Admission(3, 2, 3, 2, 64, 0.1, 0.2, 0.3, 10.0)
TICK_S = 0.02


class Dance:
    """A stage's playback, reconciled tick by tick, and a generator's end."""

    def __init__(self, show: Show, folder: Path) -> None:
        self.show, self.now, self.folder = show, 1000.0, folder
        self.parts: StageParts = assemble(show, BOX)
        self.made = open_made_motions(folder, show, self.parts)
        reader = ShowStateReader(folder)
        source = show.config.motion.source
        self.reconciler = Reconciler("A test", self.parts, reader, self.made, source)
        self.watch = Watch(self.parts, FITS, self.made)
        self._maker = Maker(show.skeleton, show.motion_networks, self.parts.led.motion.loop_of, grounded=True)

    def run(self, seconds: float) -> set[str]:
        """Tick on; the names of what was danced."""
        seen = set()
        for _ in range(round(seconds / TICK_S)):
            for order in self.reconciler.pending(self.now):
                done, message = obey(order, self.parts)
                assert done, message
            self.watch.count_silences(self.now)
            for puppet in self.parts.puppets:
                puppet.motion.advance()
            self.now += TICK_S
            seen.add(self.parts.led.source)
        return seen

    def make(self, writer: MadeMotionWriter, at_once: bool, **recipe: Any) -> None:
        """What the generator does."""
        whole = {"source": "vary", "phrase": "main", "sigma": 1.0, "seed": 1} | recipe
        self.hand_over(writer, at_once, whole)

    def improvise(
        self, writer: MadeMotionWriter, at_once: bool, number: int, after: Loop, frame: int
    ) -> Loop:
        """The same of an improvisation that goes on from a frame of a loop."""
        network = self._maker.network("improvise")
        recipe = {"source": "improvise", "temperature": 1.0, "seconds": 5.0, "seed": number, "number": number}
        prompt = prompt_of(after, frame, FIGURE, network, network.places)  # type: ignore[arg-type]
        from_s = after.start_s + frame / 50
        recipe |= {"after": round(float(after.track[0, NUMBER])), "from_s": from_s, "prompt": prompt}
        return self.hand_over(writer, at_once, recipe)

    def hand_over(self, writer: MadeMotionWriter, at_once: bool, whole: dict[str, Any]) -> Loop:
        file = f"{whole['number']}.material"
        loop, text = self._maker.make(whole), recipe_text(whole)
        write_material(self.folder / FOLDER / file, Material(text, loop), FIGURE.names)
        writer.write(MadeMotion(text, file, whole["source"], at_once, whole.get("from_s")))
        return loop

    def late(self) -> int:
        """How often a source was late."""
        reported = {one.name: one for one in self.watch.fallbacks.happened(self.now)}
        return reported[rows.SOURCE_LATE.name].times if rows.SOURCE_LATE.name in reported else 0


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[MadeMotionWriter]:
    with closing(MadeMotionWriter(tmp_path)) as writer:
        yield writer


@pytest.fixture
def dance_of(tmp_path: Path) -> Iterator[Callable[..., Dance]]:
    opened: list[Dance] = []

    def made(puppets: Sequence[dict[str, Any]] = (), **motion: Any) -> Dance:
        show = load_show(write_show_with_sources(tmp_path / "show", motion, puppets=[*puppets]))
        opened.append(Dance(show, tmp_path))
        return opened[-1]

    yield made
    for dance in opened:
        dance.parts.close()


def declare(folder: Path, *names: str) -> None:
    state = ShowState(show="A test")
    for name in names:
        state = state.to(PHRASE, name, 5.0, 0.2)
    with closing(ShowStateWriter(folder)) as writer:
        writer.write(state)


def test_the_phrase_plays_on_until_it_is_made_and_the_wait_is_told_once(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    dance = dance_of()
    declare(tmp_path, "vary")
    assert dance.run(LATE_S - 0.5) == {"main"} and dance.late() == 0
    assert dance.run(1.0) == {"main"} and dance.late() == 1
    dance.run(2.0)
    assert dance.late() == 1
    dance.make(writer, True, number=1001)
    assert dance.run(1.0) == {"main", "vary"} and dance.parts.led.source == "vary"
    declare(tmp_path, "vary", "main")
    dance.run(1.0)
    assert dance.parts.led.source == "main" and dance.parts.led.motion.made is None


def test_what_is_made_for_the_return_waits_for_it_and_what_is_not_does_not(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    dance = dance_of()
    declare(tmp_path, "vary")
    dance.make(writer, True, number=1001)
    dance.run(0.5)
    dance.make(writer, False, number=1002, seed=2)
    number = dance.parts.led.motion
    dance.run(1.5)
    assert number.made is not None and number.made.number == 1001
    dance.run(1.5)  # the phrase has three seconds
    assert number.made.number == 1002
    dance.make(writer, True, number=1003, sigma=2.0)
    dance.run(0.1)
    assert number.made.number == 1003
    assert dance.late() == 0
    dance.run(4.0)  # nothing more comes: the last one plays on, and that is told
    assert number.made.number == 1003 and dance.parts.led.source == "vary" and dance.late() == 1
    dance.make(writer, False, number=1004, seed=3)
    dance.run(3.2)
    assert number.made.number == 1004


def test_improvisations_follow_each_other_in_step_and_come_round_where_none_is_there(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    dance = dance_of()
    motion = dance.parts.led.motion
    declare(tmp_path, "improvise")
    dance.run(0.5)
    first = dance.improvise(writer, True, 1001, motion.loop_of("main"), 75)
    dance.run(0.9)
    assert motion.made is None, "it waits for the moment that it goes on from"
    dance.run(0.2)
    assert motion.made is not None and motion.made.number == 1001
    dance.run(0.2)
    assert motion.position_s == pytest.approx(0.3, abs=0.05), "in step: as far on as the phrase is"
    end = end_of(first)
    second = dance.improvise(writer, False, 1002, first, end)
    dance.run(end / 50 - motion.position_s - 0.1)
    assert motion.made.number == 1001
    dance.run(0.3)
    assert motion.made.number == 1002 and dance.late() == 0
    dance.run(0.4)
    assert 0.4 < motion.position_s < 0.7, "in step with what is left"
    dance.run(second.length / 50)
    assert motion.made.number == 1002 and dance.late() == 1, "nothing came: it comes round, and that is told"
    dance.improvise(writer, True, 1003, second, 0)
    dance.run(0.1)
    assert motion.made.number == 1003, "its moment is over: it does not wait"


def test_backwards_a_return_is_the_other_end(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    dance = dance_of(rate=-1.0)
    declare(tmp_path, "vary")
    dance.make(writer, True, number=1001)
    dance.run(1.0)  # it begins at the phrase's start, and comes from its end at once
    dance.make(writer, False, number=1002, seed=2)
    dance.run(0.5)
    assert dance.parts.led.motion.made is not None and dance.parts.led.motion.made.number == 1001
    dance.run(3.0)
    assert dance.parts.led.motion.made.number == 1002


def test_a_show_may_start_from_it(dance_of: Callable[..., Dance], writer: MadeMotionWriter) -> None:
    dance = dance_of(source="vary")
    dance.make(writer, True, number=1001)
    dance.run(1.5)
    assert dance.parts.led.source == "vary"


def test_a_file_that_is_gone_or_foreign_changes_nothing(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    dance = dance_of()
    dance.make(writer, True, number=1001)
    recipe = recipe_text({"source": "vary", "phrase": "main", "sigma": 1.0, "seed": 1, "number": 1001})
    (tmp_path / FOLDER / "1001.material").write_bytes(b"damaged")
    with pytest.raises(ValueError, match="no material"):
        dance.parts.led.play_made(recipe, 0.2)
    (tmp_path / FOLDER / "1001.material").unlink()
    with pytest.raises(ValueError, match="cannot be read"):
        dance.parts.led.play_made(recipe, 0.2)
    with pytest.raises(ValueError, match="no sound recipe"):
        dance.parts.led.play_made("{}", 0.2)
    assert dance.run(0.2) == {"main"}


def test_each_puppet_dances_its_own_source(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    puppets = [{"name": "a"}, {"name": "b", "phrase": "vary", "x": 1.0}, {"name": "c"}]
    dance = dance_of(puppets=puppets)
    with closing(MadeMotionWriter(tmp_path, 1)) as second:
        dance.make(second, True, number=1001)
        dance.run(1.5)
        assert [one.source for one in dance.parts.puppets] == ["main", "vary", "main"]
        declare(tmp_path, "vary")
        dance.make(writer, True, number=1002, seed=5)
        dance.make(second, False, number=1003, seed=2)
        dance.run(3.2)
    first, other, _ = dance.parts.puppets
    assert first.source == "vary" and first.motion.going_on[2] == 1002
    assert other.motion.going_on[2] == 1003, "the second's next variation came with its return"
    dance.run(4.0)
    assert dance.late() == 1, "nothing more comes"


def test_a_restarted_stage_goes_on_in_what_was_made(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path
) -> None:
    puppets = [{"name": "a"}, {"name": "b", "phrase": "vary"}]
    dance = dance_of(puppets=puppets)
    declare(tmp_path, "improvise")
    dance.improvise(writer, True, 1001, dance.parts.led.motion.loop_of("main"), 75)
    with closing(MadeMotionWriter(tmp_path, 1)) as second:
        dance.make(second, True, number=1002)
    dance.run(3.0)
    assert [one.source for one in dance.parts.puppets] == ["improvise", "vary"]
    (runtime := tmp_path / "place").mkdir()
    with closing(Resumption("A test", runtime, None, "always")) as noted:
        noted.write_checkpoint(dance.reconciler, 7)
    windows = [one.motion.window().copy() for one in dance.parts.puppets]
    roots = [one.motion.roots().copy() for one in dance.parts.puppets]
    again = dance_of(puppets=puppets)
    with closing(Resumption("A test", runtime, None, "always")) as resumed:
        assert "After a restart" in resumed.go_on(again.reconciler, again.now)
    for one, window, root in zip(again.parts.puppets, windows, roots, strict=True):
        assert np.abs(np.sum(one.motion.window() * window, axis=-1)).min() > 0.9999, "the very poses"
        assert one.motion.roots() == pytest.approx(root, abs=1e-3)
    again.run(0.5)
    assert not any(one.motion.jumped for one in again.parts.puppets)
    assert [one.motion.going_on[2] for one in again.parts.puppets] == [1001, 1002]
    (tmp_path / FOLDER / "1001.material").unlink()
    third = dance_of(puppets=puppets)
    with closing(Resumption("A test", runtime, None, "always")) as resumed:
        resumed.go_on(third.reconciler, third.now)
    assert [one.motion.going_on[2] for one in third.parts.puppets] == [0, 1002], "the phrase, if it is gone"


def test_after_a_power_cut_it_goes_on_with_its_source(
    dance_of: Callable[..., Dance], writer: MadeMotionWriter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dance = dance_of()
    declare(tmp_path, "vary")
    dance.make(writer, True, number=1001)
    dance.run(1.5)
    (runtime := tmp_path / "place").mkdir()
    with closing(Resumption("A test", runtime, None, "always")) as noted:
        noted.write_checkpoint(dance.reconciler, 7)
    monkeypatch.setattr("appliance.stage.resume.boot_id", lambda: "another")
    (tmp_path / "show_state").unlink()
    again = dance_of()
    with closing(Resumption("A test", runtime, None, "always")) as resumed:
        assert "After a power cut" in resumed.go_on(again.reconciler, again.now)
        again.run(0.5)
        assert again.reconciler.wanted == "vary" and again.parts.led.source == "vary"
