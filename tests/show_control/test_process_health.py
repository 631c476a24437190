"""All processes of a box tell how they are, and show control tells it on; who dies is counted."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

from appliance.box.fallback import Fallback, Fallbacks
from appliance.box.process_health import LATE_S, ProcessHealth, ProcessHealthWriter
from appliance.keeper.fallback import CHOICE_NOT_SAVED, JOURNAL_STOPPED, PLACE_NOT_SAVED, SENSORS_NOT_SAVED
from appliance.keeper.journal import MirroredJournal
from appliance.keeper.keeper import KeeperHealth
from appliance.keeper.mirror import Mirror, Mirrored
from appliance.keeper.records import mirrored_checkpoint, mirrored_sensor_memory
from appliance.outputs.shared_frame import FrameWriter
from appliance.projector.fallback import OF_THE_PROJECTOR, PICTURES_SMALLER, STAGE_UNSEEN
from appliance.release.choice import CHOSEN, Aside, Choice, ShowAndBox
from appliance.release.trial import MirroredProof
from appliance.show_control.stage_observer import StageObserver
from tests.bundles import FIGURE
from tests.outputs.small_stage import one_puppet
from tests.show_control.doubles import Asker, ControlInThread, StageDouble, facts, until

DMX = Fallback("dmx-away", "A wire is away.")


def reported(processes: ProcessHealth, now: float) -> dict[str, tuple[str, int, bool]]:
    return {one.name: (who, one.times, one.active) for who, one in processes.fallbacks(now)}


def test_a_process_tells_its_fallbacks(folder: Path) -> None:
    fallbacks, processes = Fallbacks([DMX]), ProcessHealth(folder)
    lights = ProcessHealthWriter(folder, "lights", fallbacks)
    lights.publish_health(10.0)
    assert reported(processes, 10.0) == {}
    fallbacks.set("dmx-away", "The adapter is unplugged.")
    lights.publish_health(10.5)
    assert reported(processes, 10.5) == {}, "once a second is enough"
    lights.publish_health(11.0)
    assert reported(processes, 11.0) == {"dmx-away": ("lights", 1, True)}
    lights.end(11.5)
    lights.close()
    processes.close()


def test_a_network_that_is_away_from_all_universes_is_told_in_short(folder: Path) -> None:
    """Their sentences do not fit a block, which ended the process of the lights."""
    wires = {f"sACN multicast from 192.168.178.200, universe {number}": "Away. " * 40 for number in range(32)}
    fallbacks, processes = Fallbacks([DMX]), ProcessHealth(folder)
    fallbacks.parts = wires
    fallbacks.set("dmx-away", " ".join(wires.values()))
    with closing(ProcessHealthWriter(folder, "lights", fallbacks)) as lights:
        lights.publish_health(10.0)
        (member,) = processes.members(10.0)
    assert member.parts.keys() == wires.keys() and all(member.parts.values())
    assert reported(processes, 10.0) == {"dmx-away": ("lights", 1, True)}
    assert all(one.message.endswith("…") for one in member.fallbacks)
    processes.close()


def test_a_report_that_does_not_fit_is_left_out_and_the_rest_is_told(folder: Path) -> None:
    """Sixteen gestures with long Cyrillic names: JSON has six letters for each of theirs."""
    gestures = [{"name": "ж" * 60, "cue": "ц" * 60, "hand": "LeftArm"} for _ in range(16)]
    fallbacks, processes = Fallbacks([DMX]), ProcessHealth(folder)
    fallbacks.set("dmx-away", "Away.")
    with closing(ProcessHealthWriter(folder, "control", fallbacks)) as control:
        control.reported = {"refused": 3, "gestures": {"list": gestures}}
        control.publish_health(10.0)
        assert processes.reported("control", 10.0) == {"refused": 3}
    assert reported(processes, 10.0) == {"dmx-away": ("control", 1, True)}
    processes.close()


def test_lights_projector_and_keeper_that_die_are_counted(folder: Path) -> None:
    processes = ProcessHealth(folder)
    for who in ("lights", "projector", "keeper", "console", "sound"):
        first = ProcessHealthWriter(folder, who, Fallbacks(()))
        first.publish_health(10.0)
        first.close()  # and never says that it ends
        assert reported(processes, 10.0 + LATE_S) == {}
        late = reported(processes, 10.1 + LATE_S)
        assert late == {f"{who}-died": (who, 1, True)}
        second = ProcessHealthWriter(folder, who, Fallbacks(()))
        second.publish_health(20.0)
        assert reported(processes, 20.0) == {f"{who}-died": (who, 1, False)}
        second.end(21.0)
        second.close()
        assert reported(processes, 90.0) == {f"{who}-died": (who, 1, False)}, "what has ended is not late"
        third = ProcessHealthWriter(folder, who, Fallbacks(()))
        third.publish_health(100.0)
        assert reported(processes, 100.0) == {}
        third.close()
        (folder / f"{who}.health").unlink()
        processes = ProcessHealth(folder)


def test_a_second_projector_says_nothing(folder: Path) -> None:
    first = ProcessHealthWriter(folder, "projector", Fallbacks(OF_THE_PROJECTOR))
    second_fallbacks = Fallbacks(OF_THE_PROJECTOR)
    second = ProcessHealthWriter(folder, "projector", second_fallbacks)
    for row in (STAGE_UNSEEN, PICTURES_SMALLER):
        second_fallbacks.set(row.name, True)
    first.publish_health(10.0)
    second.publish_health(10.0)
    assert reported(ProcessHealth(folder), 10.0) == {}
    second.close()
    first.close()


def mirror(mirrored: Mirrored) -> Mirror:
    return Mirror(mirrored)


def test_the_keeper_tells_that_the_journal_has_stopped(folder: Path) -> None:
    journal = mirror(MirroredJournal(folder, Path("/nowhere/at/all"), 1.0))
    journal.complaint = "The disk is full."
    keeper = KeeperHealth(folder)
    keeper.report([journal], 10.0)
    assert reported(ProcessHealth(folder), 10.0) == {JOURNAL_STOPPED.name: ("keeper", 1, True)}
    keeper.end(11.0)


def test_the_keeper_tells_all_that_it_cannot_keep(folder: Path) -> None:
    chosen, place = (
        mirror(MirroredProof(folder, folder / CHOSEN)),
        mirror(mirrored_checkpoint(folder, folder)),
    )
    sensors = mirror(mirrored_sensor_memory(folder, folder))
    chosen.complaint = place.complaint = sensors.complaint = "The disk is read-only."
    keeper = KeeperHealth(folder)
    keeper.report([chosen, place, sensors], 10.0)
    rows = {PLACE_NOT_SAVED.name, SENSORS_NOT_SAVED.name, CHOICE_NOT_SAVED.name}
    assert set(reported(ProcessHealth(folder), 10.0)) == rows
    chosen.complaint = place.complaint = sensors.complaint = ""
    keeper.report([chosen, place, sensors], 12.0)
    assert not any(active for _, _, active in reported(ProcessHealth(folder), 12.0).values())
    keeper.end(13.0)


def test_refused_and_put_aside_shows_are_told(folder: Path) -> None:
    processes = ProcessHealth(folder)
    assert reported(processes, 1.0) == {}
    aside = (Aside("a+", "Did not dance."),)
    Choice((ShowAndBox(),), ("Broken one.", "Broken two."), aside).write(folder / CHOSEN)
    assert reported(processes, 1.0) == {
        "show-refused": ("preflight", 2, True),
        "show-put-aside": ("preflight", 1, True),
    }
    assert [one.message for _, one in processes.fallbacks(1.0)] == [
        "Broken one. Broken two.",
        "Did not dance.",
    ]
    Choice(refused=("/media/a stick/show.yaml:3: no such key.", "It is not danced.")).write(folder / CHOSEN)
    assert [one.about for _, one in processes.fallbacks(1.0)] == ["show.yaml:3"]
    (folder / CHOSEN).write_bytes(b"{")
    assert reported(processes, 1.0) == {}


def test_a_stage_that_hangs_is_counted_once(folder: Path) -> None:
    writer = FrameWriter(folder, facts())
    frame = one_puppet(len(FIGURE))
    frame.frame_time = time.monotonic()
    writer.write(frame)
    sight = StageObserver(folder)
    now = frame.frame_time
    assert sight.fallbacks(now) == []
    for later in (0.6, 0.7, 0.8):
        assert sight.state(now + later) == "hung"
    [(who, hung)] = sight.fallbacks(now + 0.9)
    assert (who, hung.name, hung.times, hung.active) == ("control", "stage-hung", 1, True)
    sight.close()
    writer.close()


def test_a_stage_is_not_absent_for_who_was_held_up_between_its_clock_and_its_look(folder: Path) -> None:
    writer, frame = FrameWriter(folder, facts()), one_puppet(len(FIGURE))
    frame.frame_time = time.monotonic()
    writer.write(frame)
    sight = StageObserver(folder)
    assert sight.state(frame.frame_time - 5.0) == "dancing"
    frame.frame_time += 3600.0  # left from before this machine was started anew
    writer.write(frame)
    assert sight.state(frame.frame_time - 3600.0) == "absent"
    sight.close()
    writer.close()


def test_the_desk_answers_and_the_status_counts(folder: Path) -> None:
    message = "A tick was late."
    control = ControlInThread(folder)
    with StageDouble(folder) as stage:
        stage.tell(fallbacks=[["tick-late", 3, True, message], ["receiver-gone", 1, False, "Gone."]])
        asker = Asker(control.port)

        def reported() -> list[list[object]]:
            *answers, end = asker.ask_all("/fallbacks")
            assert end == ["/end", "/fallbacks", len(answers)]
            return [answer for answer in answers if answer[2] == "stage"]  # a busy machine has others, too

        until(lambda: len(reported()) == 2)
        assert reported()[0] == ["/fallbacks/fallback", "tick-late", "stage", 3, 1, message, ""]
        until(lambda: asker.status().fallbacks == 1)
        asker.close()
    control.close()
