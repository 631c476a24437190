"""Every fallback of the stage: counted when it happens, in force while it lasts, with words for people."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from appliance.box.fallback import RECENT_S, Fallback, Fallbacks, Fallen, fallen
from appliance.box.process_health import OF_THE_COMPANY
from appliance.console.fallback import OF_THE_PAGE
from appliance.generator.fallback import OF_THE_GENERATOR
from appliance.keeper.fallback import OF_THE_KEEPER
from appliance.lights.fallback import OF_THE_LIGHTS
from appliance.projector.fallback import OF_THE_PROJECTOR
from appliance.remote.fallback import OF_THE_REMOTE
from appliance.sensor.keys import SensorKey
from appliance.sensor.link import SensorReading
from appliance.show.box import BoxConfig, OutputsConfig, SensorsConfig, SerialConfig
from appliance.show.osc import OscConfig
from appliance.show.show import load_show
from appliance.show_control.fallback import OF_CONTROL
from appliance.sound.fallback import OF_THE_SOUND
from appliance.stage import fallback as rows
from appliance.stage.admission import Admission
from appliance.stage.fallback import OF_THE_STAGE
from appliance.stage.health import Health
from appliance.stage.resume import Resumption
from appliance.stage.stage_parts import StageParts, assemble
from appliance.stage.watch import Watch
from tests.bundles import write_show

FITS = Admission(3, 2, 3, 2, 64, 0.1, 0.2, 0.3, 10.0)
DOES_NOT_FIT = Admission(30, 20, 9, 6, 9, 1.0, 20.0, 30.0, 10.0)


@pytest.fixture
def danced(tmp_path: Path) -> Iterator[StageParts]:
    """A cast with one sensor, a cable that is not there, and a receiver."""
    cable = SerialConfig(device=str(tmp_path / "ttyACM0"))
    box = BoxConfig(
        sensors=SensorsConfig(udp=None, serial=[cable]), outputs=OutputsConfig(osc=[OscConfig(port=9)])
    )
    cast = assemble(load_show(write_show(tmp_path / "show")), box)
    yield cast
    cast.close()


@pytest.fixture
def stage(danced: StageParts) -> Watch:
    return Watch(danced, FITS)


def of(stage: Watch, row: Fallback, now: float) -> Fallen:
    found = [one for one in stage.fallbacks.happened(now) if one.name == row.name]
    return found[0] if found else Fallen(row.name, 0, False, row.message)


def hear(danced: StageParts, at: float) -> None:
    danced.hear(SensorReading("left-wrist", (1.0, 0.0, 0.0, 0.0), 1, 0, at, at, 90, 255))


def test_sensor_silent(stage: Watch, danced: StageParts) -> None:
    for now in (1.0, 1.02):
        stage.count_silences(now)
    assert of(stage, rows.SENSOR_SILENT, 1.0).times == 0, "one that was never heard is not silent"
    hear(danced, 2.0)
    for now in (2.08, 2.12, 2.14, 20.0):
        stage.count_silences(now)
    stage.check(20.0, Health())
    assert of(stage, rows.SENSOR_SILENT, 20.0)[1:3] == (1, True)
    hear(danced, 20.5)
    stage.count_silences(20.52)
    stage.check(21.0, Health())
    assert of(stage, rows.SENSOR_SILENT, 21.0)[1:3] == (1, False)


def test_reading_refused(stage: Watch, danced: StageParts) -> None:
    danced.link._counts["norm"] += 3
    stage.check(1.0, Health())
    stage.check(2.0, Health())
    assert of(stage, rows.READING_REFUSED, 2.0)[1:3] == (3, True)
    assert not of(stage, rows.READING_REFUSED, 1.1 + RECENT_S).active


@pytest.mark.parametrize("reason", ["length", "magic", "device", "tag"])
def test_packet_refused(stage: Watch, danced: StageParts, reason: str) -> None:
    danced.link._counts[reason] += 1
    stage.check(1.0, Health())
    assert of(stage, rows.PACKET_REFUSED, 1.0)[1:3] == (1, True)


def test_cable_away(stage: Watch, danced: StageParts) -> None:
    stage.check(1.0, Health())
    reported = of(stage, rows.CABLE_AWAY, 1.0)
    assert reported[1:3] == (1, True)
    assert "ttyACM0" in reported.message
    danced.link.intakes[0].trouble = None  # type: ignore[attr-defined]
    stage.check(2.0, Health())
    assert of(stage, rows.CABLE_AWAY, 2.0)[1:3] == (1, False)


def test_address_absent(stage: Watch, danced: StageParts) -> None:
    stage.check(1.0, Health())
    assert of(stage, rows.ADDRESS_ABSENT, 1.0).times == 0
    danced.link.intakes[0].address_is_absent = True  # type: ignore[attr-defined]
    stage.check(2.0, Health())
    assert of(stage, rows.ADDRESS_ABSENT, 2.0)[1:3] == (1, True)


def test_sensor_not_let_in(stage: Watch) -> None:
    reported = of(stage, rows.NOT_LET_IN, 1.0)
    assert reported[1:3] == (1, True)
    assert "key file" in reported.message


@pytest.mark.parametrize(
    ("row", "counter"),
    [
        (rows.TICK_LATE, "late"),
        (rows.TICK_SKIPPED, "skipped"),
        (rows.OVER_BUDGET, "over_budget"),
        (rows.NETWORK_FAILED, "not_finite"),
    ],
)
def test_what_health_counts(stage: Watch, row: Fallback, counter: str) -> None:
    health = Health()
    setattr(health, counter, 2)
    stage.check(1.0, health)
    setattr(health, counter, 5)
    stage.check(2.0, health)
    assert of(stage, row, 2.0)[1:3] == (5, True)
    stage.check(3.0 + RECENT_S, health)
    assert of(stage, row, 3.0 + RECENT_S)[1:3] == (5, False)


def test_iterations_lowered(danced: StageParts, stage: Watch) -> None:
    assert of(stage, rows.ITERATIONS_LOWERED, 0.0).times == 0
    reported = of(Watch(danced, DOES_NOT_FIT), rows.ITERATIONS_LOWERED, 0.0)
    assert reported[1:3] == (1, True)
    assert "30 coding iterations do not fit" in reported.message


def test_receiver_gone(stage: Watch, danced: StageParts) -> None:
    stage.check(1.0, Health())
    danced.outputs.receivers[0].dropped += 4
    stage.check(2.0, Health())
    assert of(stage, rows.RECEIVER_GONE, 2.0)[1:3] == (1, True)
    stage.check(3.0, Health())
    assert of(stage, rows.RECEIVER_GONE, 3.0)[1:3] == (1, False)


def test_what_a_fallback_is_about_is_told_by_name(stage: Watch, danced: StageParts) -> None:
    for now in (2.0, 2.12):
        hear(danced, 2.0)
        stage.count_silences(now)
    danced.outputs.receivers[0].dropped += 4
    stage.check(3.0, Health())
    receiver = danced.outputs.receivers[0].name
    assert danced.outputs.receivers[0].is_gone
    for row, name in (
        (rows.SENSOR_SILENT, "left-wrist"),
        (rows.NOT_LET_IN, "left-wrist"),
        (rows.RECEIVER_GONE, receiver),
        (rows.CABLE_AWAY, danced.link.intakes[0].name),
    ):
        reported = of(stage, row, 3.0)
        assert reported.active and reported.about == name and name in reported.message, row.name
    hear(danced, 3.1)  # it is back, and the name of what was silent stays
    stage.count_silences(3.12)
    stage.check(4.0, Health())
    reported = of(stage, rows.SENSOR_SILENT, 20.0)
    assert (reported.active, reported.about) == (False, "left-wrist")


def test_a_system_that_stamps_no_datagrams_is_told_once(stage: Watch, danced: StageParts) -> None:
    assert not any("stamp" in message for message in stage.check(1.0, Health()))
    danced.link.intakes[0].has_stamps = False  # type: ignore[attr-defined]
    assert [message for message in stage.check(2.0, Health()) if "does not stamp" in message]
    assert not any("stamp" in message for message in stage.check(3.0, Health()))


def test_a_sensor_that_has_a_key_by_now_is_let_in(stage: Watch, danced: StageParts) -> None:
    assert of(stage, rows.NOT_LET_IN, 0.0).active
    danced.link.set_keys({"left-wrist": SensorKey("left-wrist", 7, bytes(16))})
    stage.check(1.0, Health())
    assert not of(stage, rows.NOT_LET_IN, 1.0).active
    danced.link.set_keys({})
    stage.check(2.0, Health())
    assert of(stage, rows.NOT_LET_IN, 2.0)[1:3] == (2, True)


def test_not_realtime(stage: Watch) -> None:
    stage.note_missing_rights(())
    assert of(stage, rows.NOT_REALTIME, 0.0).times == 0
    stage.note_missing_rights(("Memory is not locked.",))
    assert of(stage, rows.NOT_REALTIME, 0.0) == Fallen("not-realtime", 1, True, "Memory is not locked.")


def resumed(**changes: Any) -> Resumption:
    usual: dict[str, Any] = {"restarts": 0, "power_cuts": 0, "complaint": "", "dropped": False}
    return cast(Resumption, SimpleNamespace(**usual | changes))


BEGINNINGS: dict[str, tuple[Fallback, Callable[[Watch], None]]] = {
    "restarts": (rows.STAGE_RESTARTED, lambda stage: stage.note_start(1.0, resumed(restarts=2), "", True)),
    "power cuts": (rows.POWER_CUT, lambda stage: stage.note_start(1.0, resumed(power_cuts=2), "", True)),
    "place": (
        rows.PLACE_NOT_NOTED,
        lambda stage: stage.note_start(1.0, resumed(complaint="Full."), "", True),
    ),
    "a wrong place": (
        rows.PLACE_DROPPED,
        lambda stage: stage.note_start(1.0, resumed(dropped=True), "", True),
    ),
    "frames": (rows.NOT_SHARED, lambda stage: stage.note_start(1.0, resumed(), "Full.", True)),
    "journal": (rows.NOT_RECORDED, lambda stage: stage.note_start(1.0, resumed(), "", False)),
}


@pytest.mark.parametrize("what", BEGINNINGS)
def test_how_a_stage_begins(stage: Watch, what: str) -> None:
    row, begins = BEGINNINGS[what]
    stage.note_start(0.0, resumed(), "", True)
    before = of(stage, row, 0.0).times
    begins(stage)
    assert (before, of(stage, row, 1.0).active) == (0, True)
    others = {one.name for one, _ in BEGINNINGS.values()} - {row.name}
    assert not others & {one.name for one in stage.fallbacks.happened(1.0)}


def test_the_status_line_names_what_is_in_force() -> None:
    every = Fallbacks(OF_THE_STAGE)
    assert every.line(0.0) == ""
    every.count(rows.TICK_LATE.name, 10.0)
    every.set(rows.RECEIVER_GONE.name, True)
    assert every.line(11.0) == "fallbacks: tick-late, receiver-gone"
    assert every.line(10.0 + RECENT_S) == "fallbacks: receiver-gone"


def test_what_begins_counts_once_until_it_is_over() -> None:
    every = Fallbacks(OF_THE_STAGE)
    for active in (True, True, False, True):
        every.set(rows.RECEIVER_GONE.name, active)
    assert every.happened(0.0)[0].times == 2


def test_other_versions_say_what_they_like() -> None:
    assert fallen(None) == fallen({"a": 1}) == fallen([1, "x", ["name"]]) == ()
    assert fallen([["tick-late", 2, True, "Words."]]) == (Fallen("tick-late", 2, True, "Words."),)


def test_counting_silences_allocates_nothing(stage: Watch, danced: StageParts) -> None:
    """Objects that a tick leaves behind would call the collector, which is switched off during a show."""
    import sys

    hear(danced, 1.0)
    stage.count_silences(1.0)
    grown = []
    for _ in range(3):  # others of this process leave something now and then
        before = sys.getallocatedblocks()
        for _ in range(1000):
            stage.count_silences(1.05)
        grown.append(sys.getallocatedblocks() - before)
    assert min(grown) < 50


ROOT = Path(__file__).resolve().parents[2]
TABLE = re.compile(r"^\| [^|]+ \| `([a-z-]+)` \|.*\| `(\S+)::(\w+)` \|$", re.MULTILINE)
EVERY = {
    row.name: row
    for row in (
        *OF_THE_STAGE,
        *OF_THE_KEEPER,
        *OF_THE_LIGHTS,
        *OF_THE_PROJECTOR,
        *OF_THE_GENERATOR,
        *OF_THE_SOUND,
        *OF_THE_COMPANY,
        *OF_CONTROL,
        *OF_THE_PAGE,
        *OF_THE_REMOTE,
    )
}


def test_the_table_for_technicians_has_each_fallback_and_a_test_that_names_it() -> None:
    page = (ROOT / "docs" / "troubleshooting.md").read_text()
    rows_of_table = TABLE.findall(page[page.index("## When things go wrong") :])
    assert sorted(name for name, _, _ in rows_of_table) == sorted(EVERY)
    for name, file, test in rows_of_table:
        source = (ROOT / "tests" / file).read_text()
        assert f"def {test}(" in source, f"{name}: {file} has no {test}"


def test_the_table_for_desks_has_each_fallback() -> None:
    page = (ROOT / "docs" / "osc.md").read_text()
    page = page[page.index("### Fallbacks") : page.index("### Show controllers")]
    assert sorted(re.findall(r"^\| `([a-z-]+)` \|", page, re.MULTILINE)) == sorted(EVERY)


@pytest.mark.parametrize("name", EVERY)
def test_names_are_for_scripts_and_words_are_sentences(name: str) -> None:
    row = EVERY[name]
    assert re.fullmatch(r"[a-z]+(-[a-z]+)+", row.name)
    assert row.message[0].isupper() and row.message.endswith(".")
